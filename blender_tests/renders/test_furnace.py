# SPDX-License-Identifier: GPL-3.0-or-later
"""A closed box that emits 1 - r and reflects r shines with radiance 1 everywhere: the energy of all bounces, summed."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("bpy")

from blender_tests.scenes import furnace, rendering

TOLERANCE = 0.01


@pytest.mark.parametrize("voxels", [32, 64])
@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_furnace(albedo: float, voxels: int) -> None:
    furnace.scene(albedo)
    picture = rendering.conelight(voxels=voxels, samples=4, bounces=32)[..., :3]  # 0.8^34 is 0.0005
    assert picture.mean(dtype=np.float64) == pytest.approx(1.0, abs=TOLERANCE)
    assert np.abs(picture - 1.0).max() < 5 * TOLERANCE  # corners included


@pytest.mark.parametrize("bounces", [0, 1, 4])
def test_each_bounce_adds_its_share(bounces: int) -> None:
    """Emission is seen directly, then reflected by the gather, by faces, and by each bounce between them."""
    albedo = 0.5
    furnace.scene(albedo)
    picture = rendering.conelight(voxels=32, samples=4, bounces=bounces)[..., :3]
    assert picture.mean(dtype=np.float64) == pytest.approx(1.0 - albedo ** (bounces + 3), rel=TOLERANCE)
