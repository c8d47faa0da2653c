# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders the pictures of Cycles that tests compare with, into this folder: ``python make_references.py [NAME ...]``.

Run it in the environment that ``scripts/test`` makes, with the repository's folder as PYTHONPATH. It takes minutes.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from blender_tests.pictures import write
from blender_tests.scenes import rendering
from blender_tests.scenes.catalogue import SCENES

FOLDER = Path(__file__).parent
SAMPLES = 4096


def main(names: list[str]) -> None:
    for name in names or SCENES:
        SCENES[name].build()
        write(FOLDER / f"{name}.cycles.exr", rendering.cycles(SCENES[name].size, samples=SAMPLES))
        print(f"wrote {name}.cycles.exr", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # Blender 4.5 hangs at exit once it has rendered
