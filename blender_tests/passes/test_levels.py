# SPDX-License-Identifier: GPL-3.0-or-later
"""Nested levels: rays across their borders against every triangle, and each triangle in the cells that it enters."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.grid import VoxelGrid
from addon.levels import nested
from blender_tests.passes import reference, scenes
from blender_tests.passes.run import voxelized
from blender_tests.passes.test_trace import shoot, unit

#: Grid space, cells of the finest level: what is covered is lopsided, so that holes lie at borders too.
BOX = np.array([[-70.0, -60.0, -9.0], [50.0, 90.0, 40.0]])


def grid() -> VoxelGrid:
    """World space is grid space."""
    return nested(BOX, np.zeros(3), 32, 1.0)


def soup(kind: str, rng: np.random.Generator) -> np.ndarray:
    """(N, 3, 3) float32 in BOX: as many around the middle as far from it."""
    count = 160
    middle = rng.uniform(BOX[0] + 1.0, BOX[1] - 1.0, (count, 1, 3))
    middle *= rng.choice([1.0, 0.5, 0.25, 0.1], (count, 1, 1))
    size = 3.0 + 0.1 * np.abs(middle).max(axis=2, keepdims=True)
    made = middle + rng.normal(size=(count, 3, 3)) * (40.0 if kind == "huge" else size)
    made = np.clip(made, BOX[0] + 0.01, BOX[1] - 0.01)
    if kind == "on borders":  # of levels, where these are planes
        for k in range(count):
            made[k, :, k % 3] = (-16.0, 16.0, -32.0, 32.0, 0.0)[k // 3 % 5] if k % 3 < 2 else (-8.0, 16.0, 32.0)[k % 2]
    return made.astype(np.float32)


def rays_of(kind: str, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    origins = rng.uniform(BOX[0], BOX[1], (count, 3)) * rng.choice([1.0, 0.4, 0.1], (count, 1))
    directions = unit(rng.normal(size=(count, 3)))
    if kind == "along axes":
        directions = np.eye(3)[rng.integers(0, 3, count)] * rng.choice([-1.0, 1.0], (count, 1))
    if kind == "from borders":
        axis = rng.integers(0, 3, count)
        origins[np.arange(count), axis] = rng.choice([-32.0, -16.0, -8.0, 0.0, 16.0, 32.0], count)
    if kind == "along borders":
        axis = rng.integers(0, 3, count)
        origins[np.arange(count), axis] = rng.choice([-32.0, -16.0, -8.0, 16.0, 32.0], count)
        directions[np.arange(count), axis] = 0.0
        directions = unit(directions)
    if kind == "from outside":
        origins = unit(rng.normal(size=(count, 3))) * rng.uniform(150.0, 400.0, (count, 1))
        directions = unit(rng.uniform(BOX[0], BOX[1], (count, 3)) * 0.5 - origins)
    return origins.astype(np.float32).astype(np.float64), directions.astype(np.float32).astype(np.float64)


def place_in_stack(made: VoxelGrid, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of cells of the stack (N, 3): their lowest corners in grid space, and their sides (N, 1)."""
    layers = np.array([level.layer for level in made.levels])
    which = np.searchsorted(layers, cells[:, 2], side="right") - 1
    first = np.array([level.first for level in made.levels])[which]
    side = 2.0 ** which[:, None]
    return (cells - np.eye(3)[2] * layers[which, None] + first) * side, side


@pytest.mark.parametrize("rays", ["random", "along axes", "from borders", "along borders", "from outside"])
@pytest.mark.parametrize("kind", ["ordinary", "huge", "on borders"])
def test_hits_agree_with_every_triangle_tried(kind: str, rays: str, gpu: GpuContext) -> None:
    rng = np.random.default_rng(5)
    triangles = soup(kind, rng)
    origins, directions = rays_of(rays, 3000, rng)
    distances, margins = reference.trace(triangles.astype(np.float64), origins, directions)
    nearest = distances.min(axis=1)
    expected = np.where(np.isfinite(nearest), distances.argmin(axis=1), -1)
    # Rounding decides where a ray passes an edge closely, starts on a surface or grazes it.
    a, b, c = (triangles[:, k].astype(np.float64) for k in range(3))
    normals = unit(np.cross(b - a, c - a))
    along = np.abs(directions @ normals.T)
    grazing = (along < 1e-3) & (along > 1e-9)
    on_plane = np.abs(np.einsum("rtk,tk->rt", a[None] - origins[:, None], normals)) < 1e-2
    doubtful = ((np.abs(margins) < 1e-3) | grazing | on_plane).any(axis=1)
    second = np.partition(distances, 1, axis=1)[:, 1]
    tie = np.isfinite(second) & (second < nearest + 1e-2)
    clear = ~doubtful
    assert clear.mean() > 0.05 and (expected[clear] >= 0).sum() > 50

    made = grid()
    assert len(made.levels) >= 4
    with voxelized(gpu, scenes.scene((scenes.soup(triangles), scenes.diffuse())), made) as found:
        distance, triangle, _, cell = shoot(gpu, found, origins, directions)
        hit = clear & (expected >= 0)
        np.testing.assert_array_equal(triangle[clear & ~tie], expected[clear & ~tie])
        np.testing.assert_allclose(distance[hit], nearest[hit], rtol=1e-5, atol=3e-3)
        corner, side = place_in_stack(made, cell[hit])
        inside = (origins[hit] + directions[hit] * nearest[hit, None] - corner) / side
        assert (inside > -5e-3).all() and (inside < 1.005).all()

        limit = rng.uniform(0.5, 60.0, len(origins))
        _, any_triangle, _, _ = shoot(gpu, found, origins, directions, limit, any_hit=True)
        decided = clear & (np.abs(nearest - limit) > 1e-2)
        np.testing.assert_array_equal((any_triangle >= 0)[decided], (nearest < limit)[decided])
