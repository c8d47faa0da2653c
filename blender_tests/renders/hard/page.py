# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders the hard cases with Conelight, Cycles and EEVEE and writes docs/hard_cases.md: ``python page.py [NAME ...]``.

Run it in the environment that ``scripts/test`` makes, with the repository's folder as PYTHONPATH. Cycles and EEVEE
render what answers.json does not have yet, or has of another scene, or whose picture is missing; names: these anew.
``--stored``: they render nothing.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from addon.gpu.context import GpuContext
from blender_tests.pictures import Picture, write
from blender_tests.scenes import rendering

from . import answers, measure
from .case import VARIANTS, Case
from .catalogue import CASES

DOCS = Path(__file__).resolve().parents[3] / "docs"
PICTURES = "hard_cases"
EEVEE_SAMPLES = 16
#: Pixels that a picture's long side has on the page.
SIDE = 96

HEAD = """# Hard cases

Written by `python -m blender_tests.renders.hard.page`; the same cases are tests (`blender_tests/renders/hard/`). The
answer of a case is exact by formula, or is Cycles' picture ({cycles} samples, where a case does not say more, and 16
bounces). *Bound* is how far the mean
of the picture may be from it, and of each sixth of the picture, in shares of the picture's mean. The next columns say
how far the means of Conelight ({note}), Cycles and EEVEE ({eevee} samples, ray tracing on) are from the answer; for
Conelight then the worst part, and the largest change of the mean when the scene is moved, turned by 17 degrees, or
made three times as large with lamps as much stronger. Each is also finite everywhere and the same bits on a repeat.
Pictures: Conelight, Cycles, EEVEE.

| case | what | answer | bound | Conelight | Cycles | EEVEE | worst part | moved, turned, larger | pictures |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


def eevee() -> Picture:
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0, 0) else "BLENDER_EEVEE"
    scene.eevee.taa_render_samples = EEVEE_SAMPLES
    scene.eevee.use_raytracing = True
    return rendering.render_current(scene)


def ask(case: Case, engine: str, stored: dict[str, Any], anew: bool) -> dict[str, Any]:
    """What an engine of Blender gives for a case, added to what is stored of it; the picture goes to ``output``."""
    scene = measure.fingerprint(measure.set_up(case))
    path = _picture_path(case, engine)
    stored = stored if stored.get("scene") == scene else {"scene": scene}
    if not anew and engine in stored and path.exists():
        return stored
    picture = (rendering.cycles(samples=case.cycles_samples) if engine == "cycles" else eevee())[..., :3]
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, picture)
    return {**stored, engine: [float(f"{value:.6g}") for value in measure.parts(picture)]}


def _picture_path(case: Case, engine: str) -> Path:
    return Path(__file__).resolve().parents[2] / "output" / "hard" / f"{case.name}.{engine}.npy"


def row(gpu: GpuContext, case: Case) -> str:
    """The case's line of the table; writes its picture."""
    stored = answers.read()[case.name]
    picture = measure.conelight(gpu, case)
    found = measure.parts(picture)
    answer = answers.of(case, found)
    changes = []
    for variant in VARIANTS:
        if variant in case.skipped:
            continue
        moved = measure.parts(measure.conelight(gpu, case, variant))
        changes.append(f"{100 * abs(measure.deviation(moved[0], found[0], case.exact)):.1f} %")
    paths = [_picture_path(case, engine) for engine in ("cycles", "eevee")]
    _write_picture(case, [picture, *(np.load(path) for path in paths if path.exists())])
    has_answer = "brightness" not in case.skipped
    unit = " W/(m2 sr)" if has_answer and answer[0] == 0.0 else " %"

    def away(value: float) -> str:
        if not has_answer:
            return f"mean {value:.3g}"
        return f"{measure.deviation(value, answer[0]) * (1 if answer[0] == 0.0 else 100):+.2f}{unit}"

    says = case.formula or "Cycles"
    says = f"{answer[0]:.4g}: {says}" if has_answer else "none"
    notes = [case.reason] if case.reason else []
    notes += [f"**not reached: {check}**: {reason}" for check, reason in case.missed.items()]
    notes += [f"not asked: {', '.join(k for k, v in case.skipped.items() if v == r)}: {r}"
              for r in dict.fromkeys(case.skipped.values())]
    bound = f"{100 * case.bound:g} %, parts {100 * case.parts_bound:g} %"
    worst = f"{100 * measure.worst_part(found, answer):.1f} %" if "parts" not in case.skipped else "-"
    beside = away(stored["eevee"][0]) if "eevee" in stored else "-"
    cells = (
        f"`{case.name}`", ". ".join([case.what, *notes]), says, bound, f"**{away(found[0])}**",
        away(stored["cycles"][0]), beside, worst, ", ".join(changes) or "-",
        f"![{case.name}]({PICTURES}/{case.name}.jpg)",
    )
    return "| " + " | ".join(cells) + " |\n"


def _write_picture(case: Case, pictures: list[Picture]) -> None:
    """Side by side, as bright as Cycles'. (Blender renders no less than 4 pixels a side.)"""
    white = max(float(np.nanpercentile(pictures[1], 95)), 1e-30) * 1.2
    height, width = pictures[0].shape[:2]
    times = max(SIDE // max(height, width), 1)
    step = max(max(height, width) // SIDE, 1)
    tiles = []
    for picture in pictures:
        shown = np.clip(np.nan_to_num(picture[:height:step, :width:step]) / white, 0.0, 1.0) ** (1 / 2.2)
        tile = np.kron(shown, np.ones((max(times, 8 // max(height, 1)), times, 1)))
        tiles.append(np.pad(tile, ((0, 0), (0, 4), (0, 0)), constant_values=1.0))
    (DOCS / PICTURES).mkdir(parents=True, exist_ok=True)
    write(DOCS / PICTURES / f"{case.name}.jpg", np.concatenate(tiles, axis=1)[:, :-4])


def main(names: list[str]) -> None:
    everything = dict(answers.read())
    for engine in ("cycles", "eevee") if names != ["--stored"] else ():
        for name, case in CASES.items():
            everything[name] = ask(case, engine, everything.get(name, {}), name in names)
            kept = {key: everything[key] for key in CASES if key in everything}
            lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in kept.items()]
            answers.FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="ascii")
            print(engine, name, everything[name][engine][0], flush=True)
    answers.read.cache_clear()
    gpu = GpuContext.standalone()
    note = "32 voxels along the longest side, 16 samples where a case does not say more"
    text = HEAD.format(cycles=Case.cycles_samples, eevee=EEVEE_SAMPLES, note=note)
    text += "".join(row(gpu, case) for case in CASES.values())
    (DOCS / "hard_cases.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # Blender 4.5 hangs at exit once it has rendered
