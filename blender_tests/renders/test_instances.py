# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances of every kind give the picture of the one mesh that holds all copies."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("bpy")

from blender_tests.pictures import Picture, bias, relative_mse
from blender_tests.scenes import placements, rendering

RENDER = {"voxels": 64, "samples": 8}
#: Triangles come in another order, so that random decisions fall otherwise here and there: it is noise that is left.
RELATIVE_MSE = 0.002
BRIGHTNESS = 0.002


@pytest.fixture(scope="module")
def realised() -> Picture:
    placements.scene("realised")
    return rendering.conelight(**RENDER)


def test_copies_are_seen(realised: Picture) -> None:
    """The picture that the others are compared with shows something: boxes of another colour than the ground."""
    red_over_blue = realised[..., 0] / realised[..., 2]
    assert (red_over_blue > 1.5).mean() > 0.05
    assert (red_over_blue < 1.0).mean() > 0.2


@pytest.mark.parametrize("how", ["objects", "collections", "nodes"])
def test_instances_are_as_realised(how: str, realised: Picture) -> None:
    placements.scene(how)
    picture = rendering.conelight(**RENDER)
    assert rendering.last_warnings() == []
    assert relative_mse(picture, realised) < RELATIVE_MSE
    assert abs(bias(picture, realised)) < BRIGHTNESS
    assert np.array_equal(picture[..., 3], realised[..., 3])


def test_meshes_are_stored_once() -> None:
    memory = {}
    for how in ("nodes", "realised"):
        placements.scene(how)
        rendering.conelight(voxels=32, samples=1, bounces=0)
        memory[how] = rendering.last_statistics()["memory"]
    assert memory["nodes"]["vertex positions"] < 0.1 * memory["realised"]["vertex positions"]
