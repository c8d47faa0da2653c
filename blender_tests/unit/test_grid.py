# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the grid lies, how fine it is, and what that costs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from addon.gpu.interface import BRICK
from addon.grid import (
    FINEST,
    MARGIN,
    SurfaceMeasure,
    VoxelGrid,
    choose_resolution,
    estimate_memory,
    measure_surfaces,
    scene_bounds,
)  # fmt: skip
from addon.links import link_count
from addon.settings import Settings
from blender_tests.passes import scenes


@pytest.mark.parametrize("extent", [(2.0, 2.0, 2.0), (10.0, 3.0, 0.5), (0.0, 4.0, 0.0), (1e-4, 1e-4, 1e-4)])
@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (1e6, -2e5, 3.0)])
@pytest.mark.parametrize("resolution", [8, 64, 333])
def test_around(extent: tuple[float, ...], centre: tuple[float, ...], resolution: int) -> None:
    """Cubic cells, whole bricks, the bounds inside with a margin of at least one cell."""
    bounds = np.array([np.subtract(centre, np.divide(extent, 2)), np.add(centre, np.divide(extent, 2))])
    grid = VoxelGrid.around(bounds, resolution)
    assert all(side % BRICK == 0 and side >= BRICK for side in grid.size)
    at = (np.concatenate([bounds, np.ones((2, 1))], axis=1) @ grid.grid_from_world.T)[:, :3]
    assert (at[0] > 1.0).all() and (at[1] < np.array(grid.size) - 1.0).all()
    cells = max(bounds[1] - bounds[0]) / grid.cell_size + 2 * MARGIN
    assert cells <= resolution + 1e-3


def test_a_point_and_nothing() -> None:
    grid = VoxelGrid.around(np.zeros((2, 3)), 64)
    assert grid.cell_size > 0 and min(grid.size) >= BRICK
    assert np.isfinite(grid.grid_from_world).all()
    assert scene_bounds(scenes.scene()) is None
    assert choose_resolution(scenes.scene(), Settings()) >= 8
    empty = scenes.mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    assert scene_bounds(scenes.scene((empty, scenes.diffuse()))) is None


def test_grid_from_world() -> None:
    grid = VoxelGrid((1.0, 2.0, 3.0), 0.5, (8, 8, 8))
    np.testing.assert_allclose(grid.grid_from_world @ [2.0, 2.0, 4.0, 1.0], [2.0, 0.0, 2.0, 1.0])
    assert grid.bricks == (2, 2, 2)


def test_bounds_hold_every_instance() -> None:
    """Transformed boxes of meshes; unused vertices do not count."""
    shape = scenes.box()
    loose = dataclasses.replace(shape, positions=np.concatenate([shape.positions, [[90, 90, 90]]]).astype(np.float32))
    turned = np.eye(4)
    turned[:2, :2] = [[0, -1], [1, 0]]
    made = scenes.scene(
        (loose, scenes.diffuse(), scenes.at(5.0, 0.0, 0.0, (2.0, 1.0, 1.0))), (shape, scenes.diffuse(), turned)
    )
    np.testing.assert_allclose(scene_bounds(made), [[-1, -1, -1], [7, 1, 1]])


def test_measure() -> None:
    """A box of side 2: 24 m2 and twelve triangles with sides of 2, 2 and their diagonal; scaled by 3: nine and three
    times as much."""
    shape, surface = scenes.box(), scenes.diffuse()
    made = scenes.scene(
        (shape, surface), (shape, surface, scenes.at(scale=3.0)), (shape, surface, scenes.at(scale=(1, 1, -1)))
    )
    measure = measure_surfaces(made)
    assert measure.area == pytest.approx(24.0 * 11, rel=1e-5)
    assert measure.perimeter == pytest.approx(12 * (4.0 + 8.0**0.5) * 5, rel=1e-5)
    assert measure.triangles == 36
    assert measure_surfaces(scenes.scene()) == SurfaceMeasure(0.0)


def test_automatic_resolution_fits_the_budget() -> None:
    """More memory, finer cells; what is chosen is estimated to fit; off: as set."""
    made = scenes.scene((scenes.box((-10, -10, -2), (10, 10, 2)), scenes.diffuse()))
    chosen = [choose_resolution(made, Settings(memory_budget=budget)) for budget in (16, 64, 256, 1024)]
    assert chosen == sorted(chosen) and chosen[0] < chosen[-1]
    surfaces = measure_surfaces(made)
    for budget, resolution in zip((16, 64, 256, 1024), chosen, strict=True):
        assert estimate_memory(resolution, (20.0, 20.0, 4.0), surfaces, 8) <= budget * 2**20 or resolution <= 16
    assert choose_resolution(made, Settings(memory_budget=65536)) == FINEST
    assert choose_resolution(made, Settings(voxel_auto=False, voxel_resolution=77)) == 77


def test_memory_grows_with_the_square() -> None:
    one, two = (estimate_memory(n, (2.0, 2.0, 2.0), SurfaceMeasure(24.0), 8) for n in (128, 256))
    assert 3.5 < two / one < 5.0


def test_many_triangles_take_memory_at_any_resolution() -> None:
    """A cell's list of triangles grows with their number where they are smaller than cells."""
    extent, few, many = (2.0, 2.0, 2.0), SurfaceMeasure(24.0), SurfaceMeasure(24.0, 4000.0, 1_000_000)
    assert estimate_memory(16, extent, many, 8) > estimate_memory(16, extent, few, 8) + 4_000_000


def test_what_no_resolution_saves_makes_cells_no_coarser_than_half_of_the_budget_does() -> None:
    """A crowd of 20 million triangles, whose lists alone exceed the budget, at any resolution."""
    shape, surface = scenes.sphere(0.1, 72), scenes.diffuse()
    crowd = scenes.scene(*((shape, surface, scenes.at(k % 32, k // 32)) for k in range(1024)))
    surfaces = measure_surfaces(crowd)
    listed = surfaces.triangles * surfaces.bytes_per_pair
    assert surfaces.is_shared and surfaces.bytes_per_pair == 8 and listed > 100 * 2**20
    chosen = choose_resolution(crowd, Settings(memory_budget=64))
    assert 16 < chosen < FINEST
    assert estimate_memory(chosen, (31.2, 31.2, 0.2), surfaces, Settings().bounce_rays) <= listed + 32 * 2**20


def test_measure_of_many_instances_is_the_sum_of_each() -> None:
    """Instances of several meshes in mixed order, one without triangles among them."""
    surface = scenes.diffuse()
    meshes = [scenes.box(), scenes.sphere(0.7, 4), scenes.mesh(np.zeros((0, 3)), np.zeros((0, 3)))]
    rng = np.random.default_rng(4)
    objects = [
        (meshes[k % 3], surface, scenes.at(*rng.normal(size=3), rng.uniform(0.5, 2.0, 3))) for k in (0, 1, 4, 2, 3, 1)
    ]
    together = measure_surfaces(scenes.scene(*objects))
    alone = [measure_surfaces(scenes.scene(one)) for one in objects]
    assert together.area == pytest.approx(sum(one.area for one in alone))
    assert together.perimeter == pytest.approx(sum(one.perimeter for one in alone))
    assert together.triangles == sum(one.triangles for one in alone)
    boxes = [scene_bounds(scenes.scene(one)) for one in objects]
    lows, highs = zip(*(box for box in boxes if box is not None), strict=True)
    bounds = [np.min(lows, axis=0), np.max(highs, axis=0)]
    np.testing.assert_allclose(scene_bounds(scenes.scene(*objects)), bounds)


def test_links() -> None:
    """As set, four to a texel; more where faces are few, up to a limit."""
    assert [link_count(n, 1e7) for n in (1, 4, 5, 8, 255)] == [4, 4, 8, 8, 256]
    assert [link_count(4, n) for n in (0, 1, 1000, 10_000, 40_000, 60_000, 70_000)] == [64, 64, 64, 28, 8, 4, 4]
    assert [link_count(8, n) for n in (10_000, 40_000, 131_072, 200_000)] == [64, 28, 8, 8]
    assert link_count(128, 1000) == 128


def test_few_faces_have_more_links_in_the_estimate() -> None:
    """With 64 links for a face the memory is what it is when so many are asked for."""
    few = SurfaceMeasure(24.0)
    assert estimate_memory(8, (2.0, 2.0, 2.0), few, 4) == estimate_memory(8, (2.0, 2.0, 2.0), few, 64)
