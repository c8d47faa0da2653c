# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes shaded smooth, their corner normals means over three sides, against Cycles: light bounces by those normals."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("bpy")

from blender_tests.scenes import build, rendering

SIZE = (32, 24)


def room(albedo: float, radiance: float) -> None:
    """A closed box seen from inside."""
    build.empty_scene()
    wall = build.diffuse_and_emission("Wall", albedo, radiance)
    build.add_box("Room", (4.0, 4.0, 3.0), (0.0, 0.0, 0.0), material=wall, inward=True).data.shade_smooth()
    build.add_camera((-1.8, -1.8, -0.3), (1.0, 1.0, 0.1), lens=18.0)


def test_first_bounce() -> None:
    """Light of a lamp off the walls once; by the walls' own normals it would be 16 % less."""
    room(0.8, 0.0)
    build.add_light("POINT", (0.5, 0.3, 0.4), energy=100.0, shadow_soft_size=0.05)
    cycles = rendering.cycles(SIZE, samples=64, bounces=1) - rendering.cycles(SIZE, samples=64, bounces=0)
    ours = rendering.conelight(SIZE, voxels=32, samples=16, bounces=0, use_direct=False)
    ours, cycles = (picture[..., :3].reshape(4, 6, 4, 8, 3).mean(axis=(1, 3, 4)) for picture in (ours, cycles))
    assert ours.mean() == pytest.approx(cycles.mean(), rel=0.01)
    np.testing.assert_allclose(ours, cycles, rtol=0.04)


def test_furnace() -> None:
    """Walls that emit 1 - r and reflect r: what is below a surface brings its shading normals no light, in Cycles too.
    By the walls' own normals it would be 4 % more."""
    room(0.5, 0.5)
    cycles = rendering.cycles(SIZE, samples=64)[..., :3]
    ours = rendering.conelight(SIZE, voxels=32, samples=16)[..., :3]
    assert cycles.mean() < 0.97
    assert ours.mean() == pytest.approx(cycles.mean(), rel=0.01)
