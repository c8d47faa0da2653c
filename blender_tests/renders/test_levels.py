# SPDX-License-Identifier: GPL-3.0-or-later
"""Two kilometres of landscape, with things of a few centimetres before the camera, in the default memory budget."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("bpy")

from addon.settings import Settings
from blender_tests.scenes import landscape, rendering

SIZE = (60, 40)


def error(picture: np.ndarray, reference: np.ndarray) -> float:
    """relMSE."""
    scale = reference**2 + 0.01 * reference.mean(axis=(0, 1)) ** 2
    return float(((picture - reference) ** 2 / scale).mean())


def test_a_landscape_with_detail_before_the_camera() -> None:
    """Voxels are 5 cm wide there, all memory is inside the budget, and light is that of Cycles; voxels of one size, of
    as much memory, are metres wide, and far from it."""
    landscape.scene()
    expected = rendering.cycles(SIZE, samples=256)[..., :3]
    errors = []
    for levels in ("AUTO", "OFF"):
        picture = rendering.conelight(SIZE, voxel_auto=True, voxel_levels=levels, samples=32)[..., :3]
        statistics = rendering.last_statistics()
        errors.append(error(picture, expected))
        assert bool(statistics["levels"]) == (levels == "AUTO") == ("levels" in statistics["features"])
        assert sum(statistics["memory"].values()) < Settings().memory_budget * 2**20 and not statistics["warnings"]
        if levels == "AUTO":
            assert statistics["levels"][0]["voxel_size"] <= 0.05 + 1e-9
            np.testing.assert_allclose(picture.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.03)
    nested, single = errors
    assert nested < 0.3 * single
