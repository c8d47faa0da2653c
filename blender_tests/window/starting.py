# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts a Blender with a window that runs one case of a driver, where the environment names such a Blender."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
from typing import Any

import pytest

HERE = pathlib.Path(__file__).parent
WINDOW = ("--window-geometry", "0", "0", "1280", "800")
SMALL_WINDOW = ("--window-geometry", "0", "0", "640", "480")  # pictures of viewports take long without a GPU
BLENDER = os.environ.get("CONELIGHT_BLENDER_WINDOW", "")

#: Seconds that a case may take: edits at random are made as long as they are asked for, and then once more for
#: comparison.
LIMIT = 800.0 + 3.0 * float(os.environ.get("CONELIGHT_RANDOM_SECONDS", "0"))

MARKS = [
    pytest.mark.skipif(not BLENDER, reason="CONELIGHT_BLENDER_WINDOW names no Blender: no test in a window"),
    pytest.mark.skipif(not os.environ.get("DISPLAY"), reason="there is no display: no test in a window"),
    pytest.mark.slow,
    pytest.mark.timeout(LIMIT + 100.0),
]


def drive(driver: str, case: str, archive: str, folder: pathlib.Path, *options: str) -> dict[str, Any]:
    """What the driver measured. Fails when Blender crashed, hung, or wrote a traceback."""
    resources = folder / f"resources_{case}"
    resources.mkdir()
    environ = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER_"))}
    command = [
        BLENDER, "--factory-startup", *options, "--python", str(HERE / driver), "--", case, archive, str(folder),
    ]
    result = subprocess.run(
        command, env={**environ, "BLENDER_USER_RESOURCES": str(resources)}, capture_output=True, text=True,
        timeout=LIMIT, check=False,
    )
    printed = result.stdout + result.stderr
    assert result.returncode == 0, printed
    assert "Traceback" not in printed, printed
    measured = json.loads((folder / f"{case}.json").read_text(encoding="utf-8"))
    assert "error" not in measured, measured["error"]
    return measured


