# SPDX-License-Identifier: GPL-3.0-or-later
"""F12 in a Blender with a window: what drive_f12.py measured there. Runs only where the environment names a Blender."""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np
import pytest

from blender_tests.pictures import read
from blender_tests.window.starting import MARKS, WINDOW, drive

pytestmark = MARKS

DRIVER = "drive_f12.py"


@pytest.fixture(scope="module")
def f12(archive: str, folder: pathlib.Path) -> dict[str, Any]:
    return drive(DRIVER, "f12", archive, folder, *WINDOW, "--gpu-backend", "opengl")


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


def test_icons_of_materials_look_as_with_cycles(archive: str, folder: pathlib.Path) -> None:
    """Colour in the middle and what is left free around it. Cycles renders less noise, and the floor in reflections."""
    measured = drive(DRIVER, "previews", archive, folder, *WINDOW, "--gpu-backend", "opengl")
    assert measured["previews"] >= 2
    for name in ("Sphere", "Torus"):
        found, expected = (np.load(folder / f"previews_{engine}_{name}.npy") for engine in ("CONELIGHT", "CYCLES"))
        assert found.shape == expected.shape
        side = len(found)
        assert np.abs(found[..., 3] - expected[..., 3]).mean() < 0.03, "free where Cycles leaves it free"
        middle = np.s_[side // 3 : 2 * side // 3, side // 3 : 2 * side // 3, :3]
        np.testing.assert_allclose(found[middle].mean(), expected[middle].mean(), rtol=0.15)
    assert np.load(folder / "previews_CONELIGHT_Sphere.npy")[..., 3].min() == 0.0


def test_other_engines_still_work(f12: dict[str, Any]) -> None:
    assert f12["eevee"] == "render_complete"
    assert f12["engine_when_disabled"] != "CONELIGHT"


def test_the_window_and_background_agree(f12: dict[str, Any], archive: str, folder: pathlib.Path) -> None:
    assert drive(DRIVER, "background", archive, folder, "--background")["error_of_first"] is None
    first, background = read(folder / "f12_first.exr"), read(folder / "background_first.exr")
    assert np.abs(first - background)[..., :3].mean() < 1e-3 * first[..., :3].mean()


def test_f12_without_gl_in_blender(archive: str, folder: pathlib.Path) -> None:
    measured = drive(DRIVER, "vulkan", archive, folder, *WINDOW, "--gpu-backend", "vulkan")
    if measured["backend"] != "VULKAN":
        pytest.skip("this Blender does not start with Vulkan here")
    assert measured["first"] == "render_complete" and measured["error_of_first"] is None
    assert read(folder / "vulkan_first.exr")[..., :3].mean() > 0.01


def test_gl_that_is_too_old_is_said(archive: str, folder: pathlib.Path) -> None:
    measured = drive(DRIVER, "old_gl", archive, folder, *WINDOW, "--gpu-backend", "vulkan")
    if measured["backend"] != "VULKAN":
        pytest.skip("this Blender does not start with Vulkan here")
    assert "OpenGL 4.3" in measured["error_of_first"] and "driver" in measured["error_of_first"]
    assert measured["problems"] == [measured["error_of_first"]], "a viewport says the same"
