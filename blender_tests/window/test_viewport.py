# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport in a Blender with a window: what drive_viewport.py measured there, on both of Blender's backends."""

from __future__ import annotations

import itertools
import pathlib
from typing import Any

import numpy as np
import pytest

from blender_tests.pictures import read
from blender_tests.window.starting import MARKS, SMALL_WINDOW, drive

pytestmark = MARKS

DRIVER = "drive_viewport.py"

#: Passes that make voxels and light in them: whatever is not needed for another view.
VOXEL_PASSES = {"materials", "geometry", "emitters", "voxelize", "link", "inject", "bounce", "cones"}


@pytest.fixture(scope="module", params=["opengl", "vulkan"])
def viewport(request: pytest.FixtureRequest, archive: str, folder: pathlib.Path) -> dict[str, Any]:
    backend = request.param
    measured = drive(DRIVER, f"viewport_{backend}", archive, folder, *SMALL_WINDOW, "--gpu-backend", backend)
    if measured["backend"] != backend.upper():
        pytest.skip(f"this Blender does not start with {backend} here")
    return measured


def film(viewport: dict[str, Any], folder: pathlib.Path, name: str) -> np.ndarray:
    """(H, W, 3) scene-linear, row 0 at the top."""
    return np.load(folder / f"{viewport['case']}_{name}.npy")[::-1, :, :3]


def screen(viewport: dict[str, Any], folder: pathlib.Path, name: str) -> np.ndarray:
    """(H, W, 3) what the region shows, 0..1."""
    left, bottom, width, height = viewport["region"]
    picture = read(folder / f"{viewport['case']}_{name}.png")[..., :3]
    top = picture.shape[0] - bottom - height
    return picture[top : top + height, left : left + width]


def passes(viewport: dict[str, Any], edit: str) -> set[str]:
    return set(viewport["viewport"][edit]["passes"])


def test_there_is_never_a_problem(viewport: dict[str, Any]) -> None:
    assert all(found["problem"] == [None] for found in viewport["viewport"].values())


def test_a_done_viewport_is_f12(viewport: dict[str, Any], folder: pathlib.Path) -> None:
    assert viewport["error_of_f12"] is None
    reference = read(folder / f"{viewport['case']}_f12.exr")[..., :3]
    found = film(viewport, folder, "camera")
    assert ((found - reference) ** 2 / (reference**2 + 0.01 * reference.mean() ** 2)).mean() < 1e-5, "the same passes"


def test_colours_are_those_of_f12(viewport: dict[str, Any], folder: pathlib.Path) -> None:
    reference = read(folder / f"{viewport['case']}_f12.png")[..., :3]
    assert np.abs(screen(viewport, folder, "camera") - reference).mean() < 2 / 255


def test_another_view_redoes_nothing_with_voxels(viewport: dict[str, Any]) -> None:
    assert "surface" in passes(viewport, "orbit") and not VOXEL_PASSES & passes(viewport, "orbit")


def test_nothing_is_done_for_nothing(viewport: dict[str, Any]) -> None:
    assert not passes(viewport, "select")
    assert viewport["draws_at_rest"] <= 1


def test_edits_redo_what_follows_from_them(viewport: dict[str, Any]) -> None:
    redone = {name: VOXEL_PASSES & passes(viewport, name) for name in viewport["viewport"]}
    assert redone["light"] == {"inject", "bounce"}
    assert "link" in redone["world"] and not {"geometry", "voxelize", "materials"} & redone["world"]
    assert redone["material"] == {"materials", "voxelize", "bounce"}
    assert {"geometry", "voxelize"} <= redone["move"] and "materials" not in redone["move"]
    assert not redone["settings"], "reflections at pixels are no matter of voxels"


def test_edits_are_seen(viewport: dict[str, Any], folder: pathlib.Path) -> None:
    assert not VOXEL_PASSES & passes(viewport, "normals")
    names = ("select", "light", "material", "move", "world", "settings", "orbit")
    pictures = [film(viewport, folder, name) for name in names]
    for name, before, after in zip(names[1:], pictures, pictures[1:], strict=False):
        assert np.abs(after - before).mean() > 0.01 * before.mean(), name
    assert np.isfinite(pictures).all()


def test_leaving_frees_everything(viewport: dict[str, Any]) -> None:
    assert viewport["viewports_left"] == 0
    assert set(viewport["objects_left"]) == {0}


def test_entering_again_makes_no_voxels(viewport: dict[str, Any]) -> None:
    """The picture is F12's all the same."""
    assert "link" in passes(viewport, "first")
    assert not VOXEL_PASSES & passes(viewport, "again") and "surface" in passes(viewport, "again")


def test_edits_in_solid_view_are_seen(viewport: dict[str, Any], folder: pathlib.Path) -> None:
    """As by a viewport that knows nothing of before, to the bit, and no more is made again than what they change."""
    names = ("nothing", "solid_move", "solid_undo", "solid_light", "solid_material", "solid_mesh")
    pictures = {name: film(viewport, folder, f"{name}_known") for name in names}
    for name in names:
        assert np.array_equal(pictures[name], film(viewport, folder, f"{name}_unknown")), name
        assert VOXEL_PASSES - {"cones"} <= passes(viewport, f"{name}_unknown") | {"emitters"}
    for one, other in itertools.pairwise(names):
        assert np.abs(pictures[one] - pictures[other]).mean() > 0.001 * pictures[one].mean(), (one, other)
    assert not VOXEL_PASSES & passes(viewport, "nothing_known")
    assert VOXEL_PASSES & passes(viewport, "solid_light_known") == {"inject", "bounce"}
    assert "materials" not in passes(viewport, "solid_move_known")


def test_solid_view_is_drawn_as_before(viewport: dict[str, Any], folder: pathlib.Path) -> None:
    before, after = (screen(viewport, folder, f"solid_{when}") for when in ("before", "after"))
    assert np.array_equal(before, after)
    assert before.std() > 0.01, "there is something to be seen"


@pytest.fixture(scope="module", params=["opengl", "vulkan"])
def life(request: pytest.FixtureRequest, archive: str, folder: pathlib.Path) -> dict[str, Any]:
    measured = drive(DRIVER, f"life_{request.param}", archive, folder, *SMALL_WINDOW, "--gpu-backend", request.param)
    if measured["backend"] != request.param.upper():
        pytest.skip(f"this Blender does not start with {request.param} here")
    return measured


def test_a_viewport_survives_what_is_around_it(life: dict[str, Any]) -> None:
    assert all(set(found["problem"]) == {None} for found in life["viewport"].values())
    assert life["error_of_f12"] is None


def test_views_differ(life: dict[str, Any], folder: pathlib.Path) -> None:
    """The four of a divided view, and those of two areas, which are as large as these."""
    for name, count in (("four_views", 4), ("two_areas", 2)):
        assert len(life[name]) == count
        pictures = [film(life, folder, f"{name}_{number}") for number in range(count)]
        for number, one in enumerate(pictures):
            assert list(one.shape[1::-1]) == life[name][number] and np.isfinite(one).all() and one.mean() > 0.01
            assert not any(one.shape == other.shape and np.allclose(one, other) for other in pictures[:number])
    whole, again = (life["viewport"][name]["statistics"]["resolution"] for name in ("one_view", "one_area"))
    assert whole == again and sum(width for width, _ in life["two_areas"]) <= whole[0]


def test_undo_and_redo_are_seen(life: dict[str, Any], folder: pathlib.Path) -> None:
    start, moved, undone, redone = (film(life, folder, name) for name in ("start", "moved", "undone", "redone"))
    assert np.abs(moved - start).mean() > 0.002 * start.mean()
    assert np.array_equal(undone, start) and np.array_equal(redone, moved)


def test_overlays_know_what_is_before_them(life: dict[str, Any], folder: pathlib.Path) -> None:
    """Wires in front of everything are drawn over the picture, those under the floor are not seen."""
    names = ("no_wires", "wires_before", "wires_behind", "gizmo")
    bare, before, behind, gizmo = (screen(life, folder, name) for name in names)
    drawn = [(np.abs(shown - bare).max(axis=-1) > 0.1).sum() for shown in (before, behind)]
    assert drawn[0] > 100 and drawn[1] < 0.05 * drawn[0]
    assert (np.abs(gizmo - behind).max(axis=-1) > 0.1).sum() > 100


def test_none_stays_behind(life: dict[str, Any]) -> None:
    assert life["left_when_disabled"] == life["left_after_load"] == life["viewports_left"] == 0
    assert set(life["objects_left"]) == {0}
    assert kept(life, "conelight") - kept(life, "idle") < 2**24, "entering and leaving again and again takes no memory"


def kept(measured: dict[str, Any], by: str) -> int:
    """Bytes that the process has got in six of something; the first time does not count."""
    return sum(measured["kept"][by][1:])


def test_what_a_view_hides_is_not_there(life: dict[str, Any], folder: pathlib.Path) -> None:
    shown, hidden = film(life, folder, "no_local_view"), film(life, folder, "local_view")
    assert np.abs(shown - hidden).mean() > 0.1 * shown.mean()
    alpha = np.load(folder / f"{life['case']}_transparent.npy")[..., 3]
    assert alpha.min() == 0.0 and alpha.max() == 1.0


def test_parts_and_large_pixels_are_less_work(life: dict[str, Any]) -> None:
    size = {name: found["statistics"]["resolution"] for name, found in life["viewport"].items()}
    width, height = size["start"]
    assert size["border"] == [round(0.75 * width) - round(0.25 * width), round(0.6 * height) - round(0.2 * height)]
    assert size["large_pixels"] == [-(-width // 4), -(-height // 4)]


@pytest.mark.parametrize("backend", ["opengl", "vulkan"])
def test_random_edits(backend: str, archive: str, folder: pathlib.Path) -> None:
    measured = drive(DRIVER, f"random_{backend}", archive, folder, *SMALL_WINDOW, "--gpu-backend", backend)
    if measured["backend"] != backend.upper():
        pytest.skip(f"this Blender does not start with {backend} here")
    assert all(set(found["problem"]) == {None} for found in measured["viewport"].values())
    assert measured["objects_left"] == [0] and measured["viewports_left"] == 0
    assert len(measured["edits"]) > 5, "there were edits of many kinds"
    assert len(set(measured["objects"])) == 1, "the scene of the beginning needs what it needed then, in GL objects"
    assert len(set(measured["programs"])) == 1, "and in programs"
    # What programs take that are compiled the first time, in whatever order, stays with the driver (it comes to 2**28,
    # and to no more in ten minutes), and Blender with lavapipe takes much by itself.
    taken = sum(measured["kept"]["edits"]) - sum(measured["kept"]["idle"])
    assert taken < 2**28 + measured["entered"] * 2**23, "a viewport that stays behind takes 2**26"
