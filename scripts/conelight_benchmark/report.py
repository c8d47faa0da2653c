# SPDX-License-Identifier: GPL-3.0-or-later
"""The report: all numbers as JSON, tables in Markdown, plots and pictures."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from . import numbers, plots
from .numbers import KERNEL_BAR, LIST_KINDS, MOVING_PEER, RATED_KERNELS, RAW_KINDS, TARGET_PEER, Row, find, time_to
from .peers import COUNTED_SAMPLES
from .plan import Plan
from .store import Store, blender_version, code_digest, machine

#: Peers whose picture is shown beside the reference; the first that is there.
SHOWN = ("conelight-balanced", "conelight-final", "conelight-draft")


def write(folder: Path, store: Store, todo: Sequence[Plan], failures: Sequence[str]) -> Path:
    """Writes ``report.json``, ``report.md`` and pictures into ``folder``; returns the path of the Markdown file."""
    folder.mkdir(parents=True, exist_ok=True)
    scenes: list[Row] = []
    for plan in todo:
        reference = numbers.reference_of(plan, store)
        entry = numbers.of_scene(plan, store, reference)
        if not entry["stills"] and not entry["frames"]:
            continue
        scenes.append(entry)
        entry["pictures"] = plots.of_scene(folder, entry)
        shown = next((name for name in SHOWN if find(entry, name)), None)
        result = store.result(plan.scene, plan.stills[shown]) if shown else None
        if result is not None and reference is not None:
            entry["pictures"].append(plots.pictures(folder, plan.scene.name, result.picture(), reference.full.mean))
    content = {
        "machine": machine(), "blender": blender_version(), "engine": code_digest(), "failures": list(failures),
        "scenes": scenes,
    }
    (folder / "report.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    path = folder / "report.md"
    path.write_text("\n".join(markdown(content)) + "\n", encoding="utf-8")
    return path


def markdown(content: Row) -> Iterator[str]:
    """The lines of the tables."""
    scenes = content["scenes"]
    yield from ("# Speed against error", "")
    yield f"{content['machine']}, Blender {content['blender']}, engine {content['engine']}. Times are of the render"
    yield "call, CPU of all threads. Errors are explained in docs/benchmark.md."
    yield from (f"\n**Failed:** {text}" for text in content["failures"])
    sections = (
        ("Bars", _bars(scenes)), ("Constant pictures", _constant(scenes)), ("Brightness", _brightness(scenes)),
        (f"Time to the error of {TARGET_PEER}", _quality(scenes)),
        ("Published kernels at equal time", _kernels(scenes)), ("Texel fetches", _fetches(scenes)),
        ("Rates of fetches, millions a second", _rates(scenes)),
        ("Moving camera", _moving(scenes)),
    )
    for title, table in sections:
        lines = list(table)
        if len(lines) > 2:
            yield from ("", f"## {title}", "", *lines)
    for entry in scenes:
        if "reference_noise" in entry and entry["stills"]:
            yield from ("", f"## {entry['scene']}", "", *_scene(entry))


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield "| " + " | ".join(header) + " |"
    yield "|" + " --- |" * len(header)
    for row in rows:
        yield "| " + " | ".join(row) + " |"


def _seconds(milliseconds: float) -> str:
    return f"{milliseconds / 1e3:.3g}"


def _error(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _percent(value: float) -> str:
    return f"{100 * value:+.2f} %"


def _judged_error(row: Row) -> float | None:
    judged: dict[str, Any] = row["judged"]
    return judged.get("relative_mse", judged.get("largest"))


def _bars(scenes: Sequence[Row]) -> Iterator[str]:
    rows = [
        (entry["scene"], entry["measure"], row["peer"], _error(_judged_error(row)),
         _error(row["bar"]["error"] or None), _percent(row["judged"]["bias"]), f"{100 * row['bar']['bias']:.3g} %",
         "holds" if row["bar"]["holds"] else "**fails**")
        for entry in scenes for row in entry["stills"] if "bar" in row
    ]
    return _table(("scene", "measure", "peer", "error", "bar", "bias or leak", "bar", ""), rows)


def _constant(scenes: Sequence[Row]) -> Iterator[str]:
    rows = [
        (entry["scene"], row["peer"], _seconds(row["cpu_ms"]), _percent(row["judged"]["bias"]),
         _error(row["judged"].get("largest")))
        for entry in scenes if entry["measure"] in ("constant", "dark") for row in entry["stills"]
    ]
    return _table(("scene", "peer", "CPU s", "mean - 1, or leak", "largest deviation"), rows)


def _brightness(scenes: Sequence[Row]) -> Iterator[str]:
    rows = []
    for entry in scenes:
        coarse, fine = find(entry, "voxels-64"), find(entry, "voxels-256")
        if coarse and fine and entry["measure"] != "dark":
            rows.append((entry["scene"], _percent(fine["mean"] / coarse["mean"] - 1.0)))
    return _table(("scene", "from 64 to 256 voxels"), rows)


def _quality(scenes: Sequence[Row]) -> Iterator[str]:
    rows = []
    for entry in scenes:
        target = find(entry, TARGET_PEER)
        if target is not None and "full" in target:
            error = target["full"]["relative_mse"]
            own = time_to(entry, error)
            rows.append((
                entry["scene"], _error(error), _seconds(target["cpu_ms"]), _seconds(own) if own else "not reached",
                f"{own / target['cpu_ms']:.2f}" if own else "",
            ))
    return _table(("scene", "relMSE, full image", f"{TARGET_PEER}, CPU s", "Conelight, CPU s", "ratio"), rows)


def _kernels(scenes: Sequence[Row]) -> Iterator[str]:
    rows = []
    for entry in scenes:
        for row in entry["stills"]:
            if "equal_time" in row:
                own = row["equal_time"]
                verdict = "holds" if own["holds"] else "**fails**"
                rows.append((
                    entry["scene"], row["peer"], _seconds(row["cpu_ms"]), _error(_judged_error(row)),
                    _error(own["relative_mse"]), f"{own['ratio']:.3g}",
                    verdict if own["is_reached"] else f"{verdict}, in more time",
                ))
    return _table(("scene", "peer", "CPU s", "relMSE", "Conelight in that time", "ratio",
                   f"at least {KERNEL_BAR:g}"), rows)


def _fetches(scenes: Sequence[Row]) -> Iterator[str]:
    pixel, face = ("gather", "reflect", "direct"), ("link", "inject")
    rows = []
    for entry in scenes:
        for row in entry.get("fetches", ()):
            cells = [f"{row['each'][name]:.0f}" if name in row["each"] else "" for name in (*pixel, *face)]
            rows.append((entry["scene"], row["peer"], *cells, f"{sum(row['total'].values()) / 1e6:.0f}"))
    return _table(("scene", "peer", *(f"{name}, each pixel and pass" for name in pixel),
                   *(f"{name}, each face" for name in face), f"all, {COUNTED_SAMPLES} passes, millions"), rows)


def _rates(scenes: Sequence[Row]) -> Iterator[str]:
    """Millions of fetches per second of CPU time; of kernels also the shares of what lists allow."""

    def rated(row: Row, name: str) -> str:
        if name not in row["rates"]:
            return ""
        shares = ", ".join(f"{row['shares'][name][kind]:.0%}" for kind in LIST_KINDS)
        return f"{row['rates'][name] / 1e6:.0f} ({shares})"

    rows = []
    for entry in scenes:
        for row in entry.get("fetches", ()):
            if "rates" in row:
                raw = (f"{row['raw'][kind] / 1e6:.0f}" for kind in RAW_KINDS)
                cells = (rated(row, name) for name in RATED_KERNELS)
                rows.append((entry["scene"], row["peer"], *raw, *cells))
    of_lists = ", ".join(f"of {kind}" for kind in LIST_KINDS)
    return _table(("scene", "peer", *RAW_KINDS, *(f"{name} ({of_lists})" for name in RATED_KERNELS)), rows)


def _moving(scenes: Sequence[Row]) -> Iterator[str]:
    header = ("scene", "peer", "CPU s, all frames", "wall s", "relMSE", "bias", "flicker", "flicker, rms",
              "first frame, CPU s", "first frame, relMSE", f"time, error, flicker rms / {MOVING_PEER}")
    rows = []
    for entry in scenes:
        target = find(entry, MOVING_PEER, "frames")
        for row in entry["frames"]:
            ratios = [row[key] / target[key] for key in ("cpu_ms", "relative_mse", "flicker_rms")] if target else []
            rows.append((
                entry["scene"], row["peer"], _seconds(row["cpu_ms"]), _seconds(row["wall_ms"]),
                _error(row["relative_mse"]), _percent(row["bias"]), _error(row["flicker"]),
                _error(row["flicker_rms"]), _seconds(row["first_cpu_ms"]), _error(row["first_relative_mse"]),
                ", ".join(f"{ratio:.2f}" for ratio in ratios),
            ))
    return _table(header, rows)


def _scene(entry: Row) -> Iterator[str]:
    noise = ", ".join(f"{_error(value)} {name}" for name, value in entry["reference_noise"].items())
    yield f"{entry['size'][0]}x{entry['size'][1]}; reference of {entry['reference_samples']} samples, whose own noise "
    yield f"(relMSE {noise}) cancels in the numbers below."
    yield ""
    has_indirect = any("indirect" in row for row in entry["stills"])
    header = ["peer", "CPU s", "of it preparation", "wall s", "relMSE", "bias", "median", "FLIP"]
    header += ["relMSE, indirect", "bias, indirect"] if has_indirect else []
    rows = []
    for row in entry["stills"]:
        full, indirect = row["full"], row.get("indirect")
        cells = [
            row["peer"], _seconds(row["cpu_ms"]), _seconds(row["preparation_cpu_ms"]), _seconds(row["wall_ms"]),
            _error(full["relative_mse"]), _percent(full["bias"]), _error(full["median_error"]), _error(full["flip"]),
        ]
        if has_indirect:
            cells += [_error(indirect["relative_mse"]), _percent(indirect["bias"])] if indirect else ["", ""]
        objects = sum(row["statistics"].get("memory", {}).values())
        rows.append([*cells, f"{row['peak_rss'] / 2**20:.0f}", f"{objects / 2**20:.0f}" if objects else ""])
    yield from _table([*header, "peak MiB", "buffers and textures, MiB"], rows)
    for name in entry["pictures"]:
        yield from ("", f"![{entry['scene']}]({name})")
