# SPDX-License-Identifier: GPL-3.0-or-later
"""The same scene gives the same bits, in two processes that know nothing of each other."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("bpy")

from blender_tests.pictures import read, write

ROOT = Path(__file__).resolve().parents[2]
CASES = ("cornell", "balls", "alpha_cards")


def main(name: str, path: str) -> None:
    """In a process of its own: one picture with everything that decides by chance."""
    from blender_tests.scenes import alpha_cards, balls, cornell, rendering

    {"cornell": cornell, "balls": balls, "alpha_cards": alpha_cards}[name].scene()
    write(path, rendering.conelight((48, 32), voxels=48, samples=3), half=False)
    sys.stdout.flush()
    os._exit(0)  # Blender 4.5 hangs at exit once it has rendered on a GPU


@pytest.mark.parametrize("name", CASES)
def test_two_runs_give_the_same_bits(name: str, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    paths = [tmp_path / "first.exr", tmp_path / "second.exr"]
    for path in paths:
        result = subprocess.run(
            [sys.executable, __file__, name, str(path)], cwd=tmp_path, env=environment, timeout=120, check=False,
            capture_output=True, text=True, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        assert path.exists(), result.stderr[-2000:]
    first, second = (read(path) for path in paths)
    assert first[..., :3].mean() > 0.01
    same_bits = (first.view(np.uint32) == second.view(np.uint32)).all(axis=2)
    assert same_bits.all(), f"{(~same_bits).sum()} pixels differ"


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
