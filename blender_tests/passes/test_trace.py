# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays through the voxels against rays against every triangle, in float64."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.scene import RayVisibility
from blender_tests.passes import reference, scenes
from blender_tests.passes.run import VoxelData, map_list, test_kernel, unit_grid, voxelized
from blender_tests.passes.test_voxelize import triangles_in_grid

SIZE = 24


def shoot(
    gpu: GpuContext,
    found: VoxelData,
    origins: np.ndarray,
    directions: np.ndarray,
    limit: float | np.ndarray = 1e30,
    *,
    any_hit: bool = False,
    mask: RayVisibility = RayVisibility.ALL,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Distance, triangle (-1: none), normal and cell of each ray."""
    rays = np.zeros((len(origins), 8), np.float32)
    rays[:, :3], rays[:, 3], rays[:, 4:7], rays[:, 7] = origins, limit, directions, any_hit
    kernel = test_kernel(gpu, "trace", found.voxels.trace_defines)
    found.voxels.bind(kernel)
    result = map_list(gpu, kernel, rays, 12, ray_mask=int(mask))
    return result[:, 0], result[:, 1].astype(np.int64) - 1, result[:, 4:7], result[:, 8:11].astype(np.int64)


def assert_blocked(
    gpu: GpuContext, found: VoxelData, origins: np.ndarray, directions: np.ndarray, limit: np.ndarray,
    nearest: np.ndarray,
) -> None:
    """Rays that end at any hit say the same as the nearest hit does to whether there is one before ``limit``."""
    triangle = shoot(gpu, found, origins, directions, limit, any_hit=True)[1]
    np.testing.assert_array_equal(triangle >= 0, nearest < limit)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def rays_of(kind: str, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    origins = rng.uniform(0.0, SIZE, (count, 3))
    directions = unit(rng.normal(size=(count, 3)))
    if kind == "along axes":
        directions = np.eye(3)[rng.integers(0, 3, count)] * rng.choice([-1.0, 1.0], (count, 1))
        origins = np.where(rng.random((count, 1)) < 0.5, np.floor(origins * 4) / 4, origins)
    if kind == "in a plane":
        directions[np.arange(count), rng.integers(0, 3, count)] = 0.0
        directions = unit(directions)
    if kind == "from cell planes":
        origins = np.round(origins)
    if kind == "from outside":
        origins = SIZE / 2 + unit(rng.normal(size=(count, 3))) * rng.uniform(25.0, 200.0, (count, 1))
        directions = unit(rng.uniform(2.0, SIZE - 2.0, (count, 3)) - origins)
        directions[: count // 10] *= -1.0
    return origins.astype(np.float32).astype(np.float64), directions.astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("rays", ["random", "along axes", "in a plane", "from cell planes", "from outside"])
@pytest.mark.parametrize("soup", ["ordinary", "huge", "on planes"])
def test_hits_agree_with_every_triangle_tried(soup: str, rays: str, gpu: GpuContext) -> None:
    rng = np.random.default_rng(9)
    triangles = triangles_in_grid(soup, 60 if soup == "ordinary" else 25)
    origins, directions = rays_of(rays, 1500, rng)
    distances, margins = reference.trace(triangles.astype(np.float64), origins, directions)
    nearest = distances.min(axis=1)
    expected = np.where(np.isfinite(nearest), distances.argmin(axis=1), -1)
    # Rounding decides where a ray passes an edge closely, starts on a surface or grazes it.
    a, b, c = (triangles[:, k].astype(np.float64) for k in range(3))
    normals = unit(np.cross(b - a, c - a))
    along = np.abs(directions @ normals.T)
    grazing = (along < 1e-3) & (along > 1e-9)  # what is exactly parallel is missed by both
    on_plane = np.abs(np.einsum("rtk,tk->rt", a[None] - origins[:, None], normals)) < 1e-3
    doubtful = ((np.abs(margins) < 1e-3) | grazing | on_plane).any(axis=1)
    second = np.partition(distances, 1, axis=1)[:, 1]
    tie = np.isfinite(second) & (second < nearest + 1e-3)
    clear = ~doubtful
    assert clear.mean() > 0.2 and (expected[clear] >= 0).sum() > 50

    with voxelized(gpu, scenes.scene((scenes.soup(triangles), scenes.diffuse())), unit_grid(SIZE)) as found:
        distance, triangle, normal, cell = shoot(gpu, found, origins, directions)
        hit = clear & (expected >= 0)
        np.testing.assert_array_equal(triangle[clear & ~tie], expected[clear & ~tie])
        np.testing.assert_allclose(distance[hit], nearest[hit], rtol=1e-5, atol=1e-3)
        assert (distance[triangle < 0] == np.float32(1e30)).all()
        across = np.abs(np.einsum("rk,rk->r", normal, directions))
        flat = np.einsum("rk,rk->r", normal[hit & ~tie], normals[expected[hit & ~tie]])
        np.testing.assert_allclose(np.abs(flat), 1.0, atol=1e-4)
        assert (np.einsum("rk,rk->r", normal, directions)[triangle >= 0] <= 0).all() and across.max() <= 1.0 + 1e-5
        inside = origins[hit] + directions[hit] * nearest[hit, None] - cell[hit]
        assert (inside > -1e-3).all() and (inside < 1.001).all()

        # Any hit: the same answer to "is it free?", also with a limit.
        limit = rng.uniform(0.5, 20.0, len(origins))
        decided = clear & (np.abs(nearest - limit) > 1e-2)
        assert_blocked(gpu, found, origins[decided], directions[decided], limit[decided], nearest[decided])


def test_empty_grid_stops_nothing(gpu: GpuContext) -> None:
    """No triangle at all, and one that lies far from every ray."""
    rng = np.random.default_rng(1)
    origins, directions = rays_of("random", 300, rng)
    with voxelized(gpu, scenes.scene(), unit_grid(8)) as found:
        assert (shoot(gpu, found, origins, directions)[1] == -1).all()


def test_rays_see_what_their_kind_sees(gpu: GpuContext) -> None:
    """Two sheets: the upper one is seen by shadow rays only."""
    made = scenes.scene(
        (scenes.plane(6.0, 5.5), scenes.diffuse(), scenes.at(4, 4), RayVisibility.SHADOW),
        (scenes.plane(6.0, 2.5), scenes.diffuse(), scenes.at(4, 4)),
    )
    origins, directions = np.array([[3.3, 3.7, 7.2]]), np.array([[0.0, 0.0, -1.0]])
    with voxelized(gpu, made, unit_grid(8)) as found:
        for mask, distance in ((RayVisibility.SHADOW, 1.7), (RayVisibility.DIFFUSE, 4.7), (RayVisibility.ALL, 1.7)):
            assert shoot(gpu, found, origins, directions, mask=mask)[0][0] == pytest.approx(distance, abs=1e-4)


def test_partly_transparent_surfaces_stop_their_share(gpu: GpuContext) -> None:
    """Alpha 0.3: three rays of ten, the same ones whether the nearest or any hit is asked for."""
    count = 4000
    origins = np.random.default_rng(2).uniform(1.5, 6.5, (count, 3))
    origins[:, 2] = 7.1
    directions = np.broadcast_to([0.0, 0.0, -1.0], (count, 3))
    with voxelized(
        gpu, scenes.scene((scenes.plane(20.0, 3.4), scenes.principled(0.8, Alpha=0.3))), unit_grid(8)
    ) as found:
        assert found.voxels.cell_opacities is not None
        nearest = shoot(gpu, found, origins, directions)[1] >= 0
        assert nearest.mean() == pytest.approx(0.3, abs=0.03)
        np.testing.assert_array_equal(shoot(gpu, found, origins, directions, any_hit=True)[1] >= 0, nearest)


def test_a_closed_box_lets_nothing_out(gpu: GpuContext) -> None:
    """Of 30 000 rays in a rotated closed box at most a few in a hundred thousand slip through an edge."""
    angle = 0.7
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    turn[:3, 3] = SIZE / 2
    shape = scenes.box((-7, -7, -7), (7, 7, 7))
    count = 30000
    rng = np.random.default_rng(6)
    origins = SIZE / 2 + rng.uniform(-4.0, 4.0, (count, 3))
    with voxelized(gpu, scenes.scene((shape, scenes.diffuse(), turn)), unit_grid(SIZE)) as found:
        assert (shoot(gpu, found, origins, unit(rng.normal(size=(count, 3))))[1] < 0).sum() <= 3
