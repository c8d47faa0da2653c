# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares pictures with stored ones, and shows them side by side on a page: New, Reference, Difference, Cycles.

References are ``blender_tests/references/NAME.exr`` (ours) and ``NAME.cycles.exr`` (Cycles', where there is one).
CONELIGHT_ACCEPT=1 in the environment makes the new pictures the references.
"""

from __future__ import annotations

import html
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from blender_tests.pictures import Picture, bias, read, relative_mse, write

FOLDER = Path(__file__).parent
REFERENCES = FOLDER / "references"
OUTPUT = FOLDER / "output"
ACCEPT_VARIABLE = "CONELIGHT_ACCEPT"
MAGNIFICATION = 16
PIXEL_SIZE = 4  # of the page, for each pixel of a picture


@dataclass(frozen=True)
class Tolerance:
    """How far a picture may be from its reference. Of the same code on the same software rasterizer they are equal up
    to the half floats of the file; another compiler rounds otherwise, and then single rays go elsewhere."""

    pixel: float = 0.02  # a channel farther off (as a share of 1, or of its value if larger) makes a pixel different
    share: float = 0.01  # of the pixels may be different
    mean: float = 0.002  # mean difference of all channels


@dataclass(frozen=True)
class Comparison:
    """One row of the page. ``problem``: None when the picture is as its reference."""

    name: str
    problem: str | None
    notes: str


def difference(picture: Picture, reference: Picture) -> Picture:
    """(H, W, 3) absolute difference, as a share of the reference where that is above 1."""
    a, b = picture[..., :3].astype(np.float64), reference[..., :3].astype(np.float64)
    return np.abs(a - b) / np.maximum(np.abs(b), 1.0)


def problem_of(picture: Picture, reference: Picture, tolerance: Tolerance) -> str | None:
    """What is wrong with the picture, in one sentence; None: nothing."""
    if picture.shape != reference.shape:
        return f"its size is {picture.shape}, that of the reference is {reference.shape}"
    if not np.isfinite(picture).all():
        return f"{int((~np.isfinite(picture)).any(axis=2).sum())} pixels are not finite"
    alpha = np.abs(picture[..., 3:] - reference[..., 3:]).max(initial=0.0)
    if alpha > tolerance.pixel:
        return f"its alpha differs by {alpha:.3f}"
    shown = difference(picture, reference)
    zero = np.zeros_like(shown, np.float32)
    result = oiio.ImageBufAlgo.compare(
        oiio.ImageBuf(np.ascontiguousarray(shown, np.float32)), oiio.ImageBuf(zero), tolerance.pixel, tolerance.pixel
    )
    share = result.nfail / (shown.shape[0] * shown.shape[1])
    if share > tolerance.share:
        allowed = f"allowed: {100 * tolerance.share:g} %"
        return f"{100 * share:.1f} % of its pixels differ by more than {tolerance.pixel:g} ({allowed})"
    if result.meanerror > tolerance.mean:
        return f"its mean difference is {result.meanerror:.4f} (allowed: {tolerance.mean:g})"
    return None


def compare(name: str, picture: Picture, command: str, tolerance: Tolerance | None = None) -> Comparison:
    """Compares a picture with its reference, and keeps what the page shows of it.

    ``command`` runs this one comparison again. With CONELIGHT_ACCEPT=1 the picture becomes the reference.
    """
    path = REFERENCES / f"{name}.exr"
    if os.environ.get(ACCEPT_VARIABLE, "") not in ("", "0"):
        write(path, picture)
    reference = read(path) if path.exists() else None
    if reference is None:
        problem: str | None = "there is no reference"
    else:
        problem = problem_of(picture, reference, tolerance or Tolerance())

    OUTPUT.mkdir(exist_ok=True)
    write(OUTPUT / f"{name}.new.exr", picture)
    _write_png(f"{name}.new", picture)
    if reference is not None and reference.shape == picture.shape:
        _write_png(f"{name}.reference", reference)
        _write_png(f"{name}.difference", (difference(picture, reference) * MAGNIFICATION).astype(np.float32))
    notes = ""
    cycles_path = REFERENCES / f"{name}.cycles.exr"
    if cycles_path.exists():
        cycles = read(cycles_path)
        _write_png(f"{name}.cycles", cycles)
        error, brightness = relative_mse(picture, cycles), 100 * bias(picture, cycles)
        notes = f"against Cycles: relMSE {error:.4f}, brightness {brightness:+.1f} %"
    if problem is not None:
        problem = (
            f"picture '{name}': {problem}. New, reference and difference are in {OUTPUT}; if the new one is right, "
            f"accept it with: {ACCEPT_VARIABLE}=1 {command}"
        )
    return Comparison(name, problem, notes)


def write_page(comparisons: list[Comparison]) -> Path:
    """Writes ``output/index.html``; pictures that failed come first."""
    rows = []
    for found in sorted(comparisons, key=lambda c: (c.problem is None, c.name)):
        cells = "".join(_cell(f"{found.name}.{kind}") for kind in ("new", "reference", "difference", "cycles"))
        said = html.escape(found.problem or "as its reference")
        rows.append(
            f'<tr class="{"good" if found.problem is None else "bad"}"><th>{html.escape(found.name)}<p>{said}</p>'
            f"<p>{html.escape(found.notes)}</p></th>{cells}</tr>"
        )
    page = OUTPUT / "index.html"
    OUTPUT.mkdir(exist_ok=True)
    page.write_text(_PAGE.format(rows="\n".join(rows), magnification=MAGNIFICATION), encoding="utf-8")
    return page


def _cell(stem: str) -> str:
    path = OUTPUT / f"{stem}.png"
    if not path.exists():
        return "<td></td>"
    spec = oiio.ImageBuf(str(path)).spec()
    return f'<td><img src="{html.escape(path.name)}" width="{spec.width * PIXEL_SIZE}"></td>'


def _write_png(stem: str, picture: Picture) -> None:
    """As a screen shows it: sRGB, without a view transform."""
    x = np.clip(np.nan_to_num(picture[..., :3]), 0.0, 1.0)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    write(OUTPUT / f"{stem}.png", encoded.astype(np.float32))


_PAGE = """<!DOCTYPE html>
<html><head><meta charset="utf-8"><title>Conelight: pictures and their references</title><style>
body {{ font-family: sans-serif; background: #222; color: #ddd; }}
th {{ text-align: left; vertical-align: top; width: 16em; font-weight: normal; }}
thead th {{ font-weight: bold; width: auto; }}
.bad th {{ color: #f88; }}
p {{ font-size: 80%; }}
img {{ image-rendering: pixelated; display: block; }}
</style></head><body><table>
<thead><tr><th></th><th>New</th><th>Reference</th><th>Difference x {magnification}</th><th>Cycles</th></tr></thead>
{rows}
</table></body></html>
"""
