# SPDX-License-Identifier: GPL-3.0-or-later
"""Cones through prefiltered voxels: nothing stops in empty space, walls stop, and no level loses area."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.passes.cones import LEVELS, ConeVolume
from addon.scene import SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import VoxelData, map_list, pack_light, pipeline, test_kernel, unit_grid, voxelized
from blender_tests.passes.test_voxelize import area_vectors, both_sides, triangles_in_grid

SIZE = 64


@contextlib.contextmanager
def cones_of(
    gpu: GpuContext, made: SceneData, size: int = SIZE, radiance: float = 1.0
) -> Iterator[tuple[ConeVolume, VoxelData]]:
    """The cone volume of a scene all of whose faces have one radiance."""
    volume = ConeVolume(gpu)
    with voxelized(gpu, made, unit_grid(size)) as found:
        count = found.voxels.faces.count
        packed = pack_light(np.full((max(count, 1), 3), radiance, np.float32))
        light = gpu.list_texture("test radiance", count, 2, "u4", packed)
        try:
            volume.run(found.voxels, light)
            yield volume, found
        finally:
            volume.release()
            gpu.free(light)


def shoot(
    gpu: GpuContext, volume: ConeVolume, origins: np.ndarray, direction: np.ndarray, tan_half: float
) -> np.ndarray:
    """(radiance, transmittance) of cones from ``origins`` that start along ``direction``."""
    rays = np.zeros((len(origins), 12), np.float32)
    rays[:, :3], rays[:, 3], rays[:, 4:7], rays[:, 7], rays[:, 8:11] = origins, 1e30, direction, tan_half, direction
    kernel = test_kernel(gpu, "cone", {"FETCH": False})
    volume.bind(kernel)
    return map_list(gpu, kernel, rays, 4)


def level_sums(gpu: GpuContext, volume: ConeVolume) -> np.ndarray:
    """(levels, 6): sum of opacities of each level and facing."""
    kernel = test_kernel(gpu, "cone", {"FETCH": True})
    sums = np.zeros((LEVELS, 6))
    for level in range(LEVELS):
        x, y, z = (side >> level for side in volume.size)
        stride = volume.stride >> level
        grid = np.stack(np.meshgrid(np.arange(x), np.arange(y), np.arange(z), indexing="ij"), axis=-1).reshape(-1, 3)
        for facing in range(6):
            texels = np.full((len(grid), 4), level)
            texels[:, :3] = grid
            texels[:, 2] += facing * stride
            volume.bind(kernel)
            sums[level, facing] = map_list(gpu, kernel, texels, 4)[:, 3].sum(dtype=np.float64)
    return sums


def test_empty_space_lets_everything_through(gpu: GpuContext) -> None:
    with cones_of(gpu, scenes.scene()) as (volume, _):
        origins = np.random.default_rng(0).uniform(10, 50, (50, 3))
        for tan_half in (0.0, 0.1, 0.577):
            found = shoot(gpu, volume, origins, np.array([0.6, -0.48, 0.64]), tan_half)
            np.testing.assert_array_equal(found, np.broadcast_to([0.0, 0.0, 0.0, 1.0], found.shape))


@pytest.mark.parametrize("degrees", [0.0, 30.0, 45.0])
@pytest.mark.parametrize("half_angle", [0.0, 2.0, 10.0])
def test_a_wall_stops_cones(degrees: float, half_angle: float, gpu: GpuContext) -> None:
    """A closed wall one voxel thick, seen head on and at an angle, near and far: at most 3 % get through."""
    wall = scenes.scene((scenes.plane(400.0, 30.37), scenes.diffuse()))
    angle = np.radians(degrees)
    direction = np.array([np.sin(angle) * 0.8, np.sin(angle) * 0.6, np.cos(angle)])
    rng = np.random.default_rng(1)
    with cones_of(gpu, wall) as (volume, _):
        target = rng.uniform(28.0, 36.0, (200, 3))
        target[:, 2] = 30.37
        origins = target - direction * rng.uniform(8.0, 24.0, (200, 1))
        found = shoot(gpu, volume, origins, direction, float(np.tan(np.radians(half_angle))))
        assert found[:, 3].max() <= 0.03, found[:, 3].max()
        np.testing.assert_allclose(found[:, 0] + found[:, 3], 1.0, atol=0.01)  # what it stops, it shows


def test_the_back_of_the_receiver_does_not_count(gpu: GpuContext) -> None:
    """A cone that starts on a sheet and leaves it is free."""
    with cones_of(gpu, scenes.scene((scenes.plane(400.0, 20.37), scenes.diffuse()))) as (volume, _):
        origins = np.random.default_rng(2).uniform(28, 36, (100, 3))
        origins[:, 2] = 20.37
        for tan_half in (0.0, 0.2, 0.577):
            assert shoot(gpu, volume, origins, np.array([0.0, 0.0, 1.0]), tan_half)[:, 3].min() > 0.97


@pytest.mark.parametrize("degrees", [0.0, 41.0, 60.0])
def test_wide_cones_see_what_is_opposite(degrees: float, gpu: GpuContext) -> None:
    """In a closed room all of whose faces have radiance 1 a cone from the floor brings 1, though its cells reach from
    the ceiling to the floor's own back: 90 % on average."""
    room = scenes.scene((scenes.box((5.3,) * 3, (58.7,) * 3, inside_out=True), scenes.diffuse()))
    rng, angle = np.random.default_rng(4), np.radians(degrees)
    count = 200
    phi = rng.uniform(0.0, 2.0 * np.pi, count)
    rays = np.zeros((count, 12), np.float32)
    rays[:, :2], rays[:, 2], rays[:, 3] = rng.uniform(7.0, 57.0, (count, 2)), 5.3, 1e30
    rays[:, 4], rays[:, 5] = np.sin(angle) * np.cos(phi), np.sin(angle) * np.sin(phi)
    rays[:, 6], rays[:, 10] = np.cos(angle), 1.0
    with cones_of(gpu, room) as (volume, _):
        for tan_half in (0.3, 0.466, 0.577):
            rays[:, 7] = tan_half
            kernel = test_kernel(gpu, "cone", {"FETCH": False})
            volume.bind(kernel)
            assert map_list(gpu, kernel, rays, 4)[:, 0].mean() > 0.9


@pytest.mark.parametrize("degrees", [10.0, 30.0, 45.0])
def test_a_slanted_receiver_does_not_shade_itself(degrees: float, gpu: GpuContext) -> None:
    """Cones that leave a slanted sheet at 60 degrees from its normal are free: 90 % on average."""
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, 32.37
    rng, count = np.random.default_rng(5), 400
    phi = rng.uniform(0.0, 2.0 * np.pi, count)
    places = np.concatenate([rng.uniform(-6.0, 6.0, (count, 2)), np.zeros((count, 1))], axis=1)
    directions = np.stack([np.sqrt(0.75) * np.cos(phi), np.sqrt(0.75) * np.sin(phi), np.full(count, 0.5)], axis=1)
    rays = np.zeros((count, 12), np.float32)
    rays[:, :3], rays[:, 3], rays[:, 4:7] = places @ turn.T + 32.37, 1e30, directions @ turn.T
    rays[:, 7], rays[:, 8:11] = 0.577, turn[:, 2]
    with cones_of(gpu, scenes.scene((scenes.plane(40.0), scenes.diffuse(), matrix))) as (volume, _):
        kernel = test_kernel(gpu, "cone", {"FETCH": False})
        volume.bind(kernel)
        assert map_list(gpu, kernel, rays, 4)[:, 3].mean() > 0.9


def test_every_level_holds_all_area(gpu: GpuContext) -> None:
    """A cell of side s holds area / s^2: four times the sum of a level is the sum of the finer one. Level 0 holds
    A |n.d|, as the triangles have it, but for cells where surfaces of several normals share a face: its normal is that
    of one of them, more often of one that lies flat."""
    triangles = triangles_in_grid("ordinary") * 2.0
    made = scenes.scene((scenes.soup(both_sides(triangles)), scenes.diffuse()))
    with cones_of(gpu, made) as (volume, _):
        sums = level_sums(gpu, volume) * 4.0 ** np.arange(LEVELS)[:, None]
        expected = np.repeat(np.abs(area_vectors(triangles)).sum(axis=0), 2)
        np.testing.assert_allclose(sums[0], expected, rtol=1e-2)
        np.testing.assert_allclose(sums, np.broadcast_to(sums[0], sums.shape), rtol=5e-3)


def test_large_grids_are_read_coarser(gpu: GpuContext) -> None:
    """More than 128 cells: two cells a side make one of the volume, and a wall still stops cones."""
    with cones_of(gpu, scenes.scene((scenes.plane(1000.0, 70.4), scenes.diffuse())), 160) as (volume, _):
        assert volume.children == 2 and max(volume.size) <= 128
        origins = np.random.default_rng(3).uniform(60, 100, (50, 3))
        origins[:, 2] = 40.0
        assert shoot(gpu, volume, origins, np.array([0.0, 0.0, 1.0]), 0.05)[:, 3].max() <= 0.03


def test_faces_and_radiance_belong_together(gpu: GpuContext) -> None:
    """The volume shows the radiance it was given, however bright."""
    with cones_of(gpu, scenes.scene((scenes.plane(400.0, 30.37), scenes.diffuse())), radiance=250.0) as (volume, _):
        found = shoot(gpu, volume, np.array([[32.2, 31.9, 12.0]]), np.array([0.0, 0.0, 1.0]), 0.0)
        assert found[0, 0] == pytest.approx(250.0, rel=0.01)


def test_six_cones_see_the_whole_sky(gpu: GpuContext) -> None:
    """A plane of albedo 0.6 under a sky of radiance 1, gathered by cones."""
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse(0.6)),
        world=scenes.world(1.0),
        camera=scenes.camera((0.0, 0.0, 2.0), width=0.5),
    )
    with pipeline(gpu, made, scenes.settings(32, gather_mode="CONES"), (8, 8), samples=1) as ready:
        assert ready.film.read("combined")[..., :3].mean() == pytest.approx(0.6, rel=0.05)


def test_cones_where_long_lists_have_boxes(gpu: GpuContext) -> None:
    """A ball of many triangles in few cells, gathered by cones."""
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse(0.6)),
        (scenes.sphere(0.1, 40), scenes.diffuse(0.6), scenes.at(1.0, 1.0, 0.2)),
        world=scenes.world(1.0),
        camera=scenes.camera((-1.0, -1.0, 2.0), width=0.5),
    )
    with pipeline(gpu, made, scenes.settings(16, gather_mode="CONES"), (8, 8), samples=1) as ready:
        voxels = ready.voxel_light.voxelize.voxels
        assert voxels is not None and voxels.has_boxes
        assert ready.film.read("combined")[..., :3].mean() == pytest.approx(0.6, rel=0.05)
