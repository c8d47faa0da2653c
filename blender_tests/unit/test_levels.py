# SPDX-License-Identifier: GPL-3.0-or-later
"""Nested levels: when they are chosen, that they fit each other and the budget, and where they lie."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest

from addon.gpu.interface import BRICK
from addon.grid import VoxelGrid, scene_bounds
from addon.levels import MOST_CELLS, MOST_LAYERS, MOST_LEVELS, Parts, Plan, coarsened, nested
from addon.passes.voxel_numbers import cell_positions, empty_octants, level_octants
from addon.scene import SceneData
from addon.settings import Settings
from blender_tests.passes import scenes


def country(half: float = 1000.0, **camera: Any) -> SceneData:
    """A plain, with a house in its middle."""
    return scenes.scene(
        (scenes.plane(2.0 * half), scenes.diffuse()),
        (scenes.box((-4.0, -3.0, 0.0), (4.0, 3.0, 6.0)), scenes.diffuse()),
        camera=scenes.camera(**({"position": (0.0, -9.0, 1.7)} | camera)),
    )


def chosen(scene: SceneData, **settings: Any) -> VoxelGrid:
    made = Settings(**settings)
    plan = Plan.of(scene, made)
    return plan.grid(scene, made, plan.middle(scene.camera, made, (), None))


def test_large_scenes_seen_from_inside_get_levels() -> None:
    assert chosen(country()).levels
    assert not chosen(country(10.0)).levels, "cells of one size are fine enough"
    assert not chosen(country(), voxel_levels="OFF").levels
    assert not chosen(country(), voxel_auto=False).levels, "what is set is set"
    assert not chosen(country(), gather_mode="CONES").levels and not chosen(country(), shadow_mode="CONE").levels
    assert not chosen(country(position=(0.0, 0.0, 90000.0))).levels, "from afar none of it is near"
    assert not chosen(country(width=100.0)).levels, "orthographic cameras are near nothing"
    assert chosen(country(10.0), voxel_levels="ON").levels
    assert chosen(country(10.0), voxel_levels="ON", voxel_auto=False, voxel_resolution=60).levels[0].size[0] == 64
    assert not chosen(scenes.scene(), voxel_levels="ON").levels, "there is nothing"


def test_cells_near_the_camera_are_as_fine_as_asked_and_fit_the_budget() -> None:
    made = country()
    sizes = []
    for budget in (32, 48, 128, 512):
        grid = chosen(made, memory_budget=budget)
        assert grid.cell_size == 0.05 and max(grid.levels[0].size) <= MOST_CELLS
        assert Parts.of(made).estimate_memory(grid, 4, Settings().bounce_rays) <= budget * 2**20
        low, high = (np.array(end) * 0.05 + grid.origin for end in (grid.levels[0].first, grid.levels[0].end))
        eye = made.camera.world_from_camera[:3, 3]
        assert (eye > low + 0.5).all() and (eye < high - 0.5).all()
        sizes.append(grid.levels[0].size[0])
    assert sizes == sorted(sizes) and sizes[0] < sizes[-1]
    assert chosen(made, voxel_detail=0.2).cell_size == 0.2
    coarse = chosen(made, memory_budget=4)
    assert not coarse.levels or coarse.cell_size > 0.05


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (980.0, -999.0, 5.0), (-333.3, 20.0, 1.7)])
def test_levels_fit_into_each_other(place: tuple[float, float, float]) -> None:
    bounds = np.array([[-1000.0, -1000.0, -7.0], [1000.0, 900.0, 60.0]])
    grid = nested(bounds, np.array(place), 96, 0.05)
    layer = 0
    for level in grid.levels:
        assert level.layer == layer and all(side > 0 for side in level.size) and max(level.size) <= 96
        assert all(place % (2 * BRICK) == 0 for place in (*level.first, *level.end))
        layer += level.size[2]
    assert grid.size == (*(max(level.size[axis] for level in grid.levels) for axis in (0, 1)), layer)
    for finer, coarser in itertools.pairwise(grid.levels):
        assert (np.array(finer.first) // 2 >= coarser.first).all() and (np.array(finer.end) // 2 <= coarser.end).all()
    at = (np.concatenate([bounds, np.ones((2, 1))], axis=1) @ grid.grid_from_world.T)[:, :3]
    assert (at[0] > grid.box[0]).all() and (at[1] < grid.box[1]).all()


def test_floors_at_round_heights_lie_inside_cells() -> None:
    """Of every level, wherever the camera is."""
    made, settings = country(), Settings()
    plan = Plan.of(made, settings)
    for k in range(20):
        camera = scenes.camera((0.37 * k, 1.0, 0.31 * k))
        middle = plan.middle(camera, settings, (), None)
        for width in (0.05 * 2.0**k for k in range(6)):
            inside = (0.0 - middle[2]) / width % 1.0
            assert 0.1 < inside < 0.9


@pytest.mark.parametrize("resolution", [8, 32, 64, 500])
def test_the_camera_stands_in_the_finest_level(resolution: int) -> None:
    """However small that is."""
    for x in np.linspace(-3.0, 3.0, 41):
        made = country(position=(float(x), -9.0 + 0.7 * float(x), 1.7))
        grid = chosen(made, voxel_levels="ON", voxel_auto=False, voxel_resolution=resolution)
        eye = (made.camera.world_from_camera[:3, 3] - grid.origin) / grid.cell_size
        reach = 0.5 * max(grid.levels[0].size)
        assert (np.abs(eye) < 0.7 * reach).all()


def test_levels_follow_the_camera_in_steps() -> None:
    made, settings = country(), Settings()
    plan = Plan.of(made, settings)

    def middle(x: float, before: tuple[float, ...] = (), grid: VoxelGrid | None = None) -> tuple[float, ...]:
        return plan.middle(scenes.camera((x, 0.0, 1.7)), settings, before, grid)

    first = middle(0.0)
    assert middle(0.3) == first and middle(5.0) != first
    assert middle(801.0) != first, "from where it stands alone"
    grid = plan.grid(made, settings, first)
    assert middle(0.81) != first and middle(0.81, first, grid) == first, "while somebody looks on, it stays a while"
    assert middle(5.0, first, grid) == middle(5.0)


def test_less_memory_than_estimated() -> None:
    """What does not fit becomes coarser: half as many voxels along each side, again and again, until there are few."""
    made, settings = country(), Settings()
    sides = []
    grid = chosen(made)
    while values := coarsened(Plan.of(made, settings), grid):
        settings = settings.with_values(**values)
        grid = chosen(made, **dataclasses.asdict(settings))
        sides.append(max(grid.levels[0].size))
    assert len(sides) > 1 and sides == sorted(sides, reverse=True) and sides[-1] == 32
    single = coarsened(Plan.of(made, Settings(voxel_levels="OFF")), chosen(made, voxel_levels="OFF"))
    assert single["voxel_levels"] == "OFF"


@pytest.mark.parametrize("half", [1e3, 1e6, 1e12])
@pytest.mark.parametrize("detail", [1e-4, 0.05])
def test_levels_of_worlds_of_any_size(half: float, detail: float) -> None:
    """A tall block: as many levels, and as high a stack, as shaders and textures can have."""
    made = scenes.scene((scenes.box((-half,) * 3, (half,) * 3), scenes.diffuse()))
    bounds = scene_bounds(made)
    assert bounds is not None
    for more in ({"memory_budget": 65536}, {"voxel_auto": False, "voxel_resolution": 512}):
        grid = chosen(made, voxel_levels="ON", voxel_detail=detail, **more)
        assert 1 < len(grid.levels) <= MOST_LEVELS and grid.size[2] <= MOST_LAYERS
        assert grid.cell_size == pytest.approx(detail) or half > 1e3
        low, high = grid.box * grid.cell_size + grid.origin
        assert (low < bounds[0]).all() and (high > bounds[1]).all()


def test_shares_of_surfaces() -> None:
    """A plain that lies level, half of it inside; a wall across; what is beside."""
    parts = Parts.of(scenes.scene((scenes.plane(2.0), scenes.diffuse())))
    for box, share in (
        ([[-1, -1, -1], [0, 1, 1]], 0.5), ([[-9, -9, -9], [9, 9, 9]], 1.0), ([[-0.5, -0.5, -1], [0.5, 0.5, 1]], 0.25),
        ([[2, 2, 2], [3, 3, 3]], 0.0),
    ):  # fmt: skip
        assert parts.shares(np.array(box, float))[0] == pytest.approx(share)
    bounds = scene_bounds(country())
    assert bounds is not None and Parts.of(country()).shares(bounds).tolist() == [1.0, 1.0]


def test_leaps_stop_at_holes() -> None:
    """Each level knows its own empty space; the hole in it is not empty."""
    grid = nested(np.array([[-100.0] * 3, [100.0] * 3]), np.zeros(3), 32, 1.0)
    occupied = np.zeros(grid.bricks[::-1], bool)
    leaps = level_octants(occupied, grid.levels)
    first, second = (level.layer // BRICK for level in grid.levels[:2])
    side = 32 // BRICK
    assert (leaps[first:second] == empty_octants(np.zeros((side, side, side), bool))).all()
    hole = np.zeros((side, side, side), bool)
    hole[2:6, 2:6, 2:6] = True
    assert (leaps[second : second + side] == empty_octants(hole)).all()
    assert (leaps[second : second + side][hole] == 0).all()


def test_positions_in_high_stacks() -> None:
    masks = np.zeros(2 * 2 * 1000, np.uint64)
    masks[-1] = 1 << 63
    packed = int(cell_positions(masks, (2, 2, 1000), (9, 9))[0])
    assert (packed & 511, packed >> 9 & 511, packed >> 18) == (7, 7, 3999)
