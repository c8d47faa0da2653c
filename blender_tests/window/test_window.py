# SPDX-License-Identifier: GPL-3.0-or-later
"""F12 in a Blender with a window: what drive_f12.py measured there. Runs only where the environment names a Blender."""

from __future__ import annotations

import json
import os
import pathlib
import shutil
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from blender_tests.pictures import read

ROOT = pathlib.Path(__file__).parents[2]
DRIVER = pathlib.Path(__file__).with_name("drive_f12.py")
WINDOW = ("--window-geometry", "0", "0", "1280", "800")
BLENDER = os.environ.get("CONELIGHT_BLENDER_WINDOW", "")

pytestmark = [
    pytest.mark.skipif(not BLENDER, reason="CONELIGHT_BLENDER_WINDOW names no Blender: no test in a window"),
    pytest.mark.skipif(not os.environ.get("DISPLAY"), reason="there is no display: no test in a window"),
    pytest.mark.skipif(not shutil.which("xdotool"), reason="there is no xdotool: no test in a window"),
    pytest.mark.slow,
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return tmp_path_factory.mktemp("window")


@pytest.fixture(scope="module")
def archive() -> str:
    """The zip that users install."""
    command = [sys.executable, str(ROOT / "scripts" / "build_extension")]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=240).stdout.strip()


def drive(case: str, archive: str, folder: pathlib.Path, *options: str) -> dict[str, Any]:
    """What the driver measured. Fails when Blender crashed, hung, or wrote a traceback."""
    resources = folder / f"resources_{case}"
    resources.mkdir()
    environ = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER_"))}
    command = [
        BLENDER, "--factory-startup", *options, "--python", str(DRIVER), "--", case, archive, str(folder),
    ]
    result = subprocess.run(
        command, env={**environ, "BLENDER_USER_RESOURCES": str(resources)}, capture_output=True, text=True,
        timeout=400, check=False,
    )
    printed = result.stdout + result.stderr
    assert result.returncode == 0, printed
    assert "Traceback" not in printed, printed
    measured = json.loads((folder / f"{case}.json").read_text(encoding="utf-8"))
    assert "error" not in measured, measured["error"]
    return measured


@pytest.fixture(scope="module")
def f12(archive: str, folder: pathlib.Path) -> dict[str, Any]:
    return drive("f12", archive, folder, *WINDOW, "--gpu-backend", "opengl")


def test_f12_renders_and_says_how_far_it_is(f12: dict[str, Any]) -> None:
    assert f12["first"] == "render_complete" and f12["error_of_first"] is None
    assert any("Voxelizing" in text for text in f12["stats"]) and any("Sample 8/8" in text for text in f12["stats"])
    assert f12["pauses"][0] < 10, "the user interface stood still while a picture was rendered"


def test_escape_cancels_soon(f12: dict[str, Any]) -> None:
    assert f12["after_escape"] == "render_cancel"
    assert f12["seconds_to_escape"] < 3, "half a second of work, on a machine that does other things as well"


def test_every_render_of_the_scene_is_the_same(f12: dict[str, Any], folder: pathlib.Path) -> None:
    first = read(folder / "f12_first.exr")
    assert np.isfinite(first).all() and first[..., :3].mean() > 0.01
    for name in ("second", "after_escape", "from_rendered_view", "after_preview", "after_undo", "after_enabling"):
        assert np.array_equal(first, read(folder / f"f12_{name}.exr")), name


def test_the_window_draws_the_same_after_f12(f12: dict[str, Any], folder: pathlib.Path) -> None:
    before, after = (read(folder / f"f12_solid_{when}.png")[..., :3] for when in ("before", "after"))
    view = np.s_[90:700, 60:1000]  # without what is beside the 3D view
    assert np.abs(before[view] - after[view]).mean() < 0.002


def test_material_previews_are_rendered(f12: dict[str, Any]) -> None:
    assert f12["previews"] > 0


def test_other_engines_still_work(f12: dict[str, Any]) -> None:
    assert f12["eevee"] == "render_complete"
    assert f12["engine_when_disabled"] != "CONELIGHT"


def test_the_window_and_background_agree(f12: dict[str, Any], archive: str, folder: pathlib.Path) -> None:
    assert drive("background", archive, folder, "--background")["error_of_first"] is None
    first, background = read(folder / "f12_first.exr"), read(folder / "background_first.exr")
    assert np.abs(first - background)[..., :3].mean() < 1e-3 * first[..., :3].mean()


def test_f12_without_gl_in_blender(archive: str, folder: pathlib.Path) -> None:
    measured = drive("vulkan", archive, folder, *WINDOW, "--gpu-backend", "vulkan")
    if measured["backend"] != "VULKAN":
        pytest.skip("this Blender does not start with Vulkan here")
    assert measured["first"] == "render_complete" and measured["error_of_first"] is None
    assert read(folder / "vulkan_first.exr")[..., :3].mean() > 0.01


def test_gl_that_is_too_old_is_said(archive: str, folder: pathlib.Path) -> None:
    measured = drive("old_gl", archive, folder, *WINDOW, "--gpu-backend", "vulkan")
    if measured["backend"] != "VULKAN":
        pytest.skip("this Blender does not start with Vulkan here")
    assert "OpenGL 4.3" in measured["error_of_first"] and "driver" in measured["error_of_first"]
