# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells that hold surfaces of different parts of space: cut in two, with faces for each side."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.grid import VoxelGrid
from addon.scene import LightKind, SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, radiance, read_voxels, unit_grid, voxelized

WHITE = scenes.diffuse(0.9)
BLACK = scenes.diffuse(0.1)


def turned(axis: int) -> np.ndarray:
    """Moves x to ``axis``, and the others on."""
    return np.roll(np.eye(4)[:3], axis, axis=0) if axis else np.eye(4)[:3]


def placed(matrix: np.ndarray) -> np.ndarray:
    full = np.eye(4)
    full[:3] = matrix
    return full


@pytest.mark.parametrize("thickness", [0.0, 0.1, 0.6])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_floor_on_both_sides_of_a_wall(axis: int, thickness: float, gpu: GpuContext) -> None:
    """A wall thinner than a cell stands on a floor of one piece: on each side the floor has a face of its own, whose
    point lies on that side; so does the wall itself."""
    floor = (scenes.plane(40.0, 3.3), WHITE, placed(turned(axis)))
    low, high = 5.5 - 0.5 * thickness, 5.5 + 0.5 * thickness
    wall = (scenes.box((low, 0.2, 3.3), (high, 11.8, 11.8)), WHITE, placed(turned(axis)))
    with voxelized(gpu, scenes.scene(floor, wall), unit_grid(12)) as found:
        across, up = axis, (axis + 2) % 3
        cells = found.face_cells
        inside = (cells > 0).all(axis=1) & (cells < 11).all(axis=1)
        foot = inside & (cells[:, across] == 5) & (cells[:, up] == 3)
        places = found.faces["position"][foot & (found.faces["facing"] == 2 * up)][:, across]
        assert len(places) == 20
        assert (places < low + 1e-3).sum() == 10 and (places > high - 1e-3).sum() == 10
        for facing, place in ((2 * across, high), (2 * across + 1, low)):
            own = foot & (found.faces["facing"] == facing)
            assert np.isclose(found.faces["position"][own][:, across], place, atol=1e-3).sum() >= 10


def test_light_stays_on_its_side(gpu: GpuContext) -> None:
    """The sun shines on one side of a thin wall: faces at its foot are lit there as anywhere, and black behind."""
    sun = scenes.light(LightKind.SUN, np.pi, direction=(1.0, 0.0, -1.0))
    wall = scenes.box((5.4, 0.2, 3.0), (5.6, 11.8, 11.8))
    made = scenes.scene((scenes.plane(11.0), WHITE, scenes.at(6.0, 6.0, 3.3)), (wall, WHITE), lights=[sun])
    with pipeline(gpu, made, scenes.settings(15, bounces=0), samples=0) as ready:
        found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
        grid = found.voxels.grid
        place = found.faces["position"] * grid.cell_size + grid.origin
        floor = (found.faces["facing"] == 4) & (np.abs(place[:, 2] - 3.3) < 1e-3)
        leaving = radiance(ready)[:, 0]
        lit, dark = floor & (place[:, 0] < 5.4), floor & (place[:, 0] > 5.6)
        foot = [np.abs(place[side, 0] - 5.5).min() for side in (lit, dark)]
        assert max(foot) < grid.cell_size  # each side has faces at the wall
        np.testing.assert_allclose(leaving[lit], 0.9 * np.sqrt(0.5), rtol=2e-3)
        assert leaving[dark].max() == 0.0


def test_layers_keep_their_colours(gpu: GpuContext) -> None:
    """Two sheets that face the same way in one cell, and two that face each other: four points, four colours."""
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    for turn in (np.eye(4), down):
        sheet = scenes.plane(3.0)
        made = scenes.scene((sheet, WHITE, scenes.at(4, 4, 3.2)), (sheet, BLACK, scenes.at(4, 4, 3.7) @ turn))
        with voxelized(gpu, made, unit_grid(8)) as found:
            whole = (found.face_cells[:, :2] == 3).all(axis=1)
            for facing in (4, 5):
                faces = found.faces[whole & (found.faces["facing"] == facing)]
                np.testing.assert_allclose(sorted(faces["position"][:, 2]), [3.2, 3.7], atol=1e-3)
                upper = faces["position"][:, 2] > 3.5
                np.testing.assert_allclose(faces["reflectance"][upper], 0.1, atol=1e-3)
                np.testing.assert_allclose(faces["reflectance"][~upper], 0.9, atol=1e-3)


def test_simple_shapes_have_no_more_faces(gpu: GpuContext) -> None:
    """A plane at any angle, and the corners of a room: two faces for each axis that something faces."""
    tilted = scenes.soup([[[0.3, 0.2, 1.0], [9.0, 0.5, 5.0], [0.5, 9.0, 7.0]]])
    room = scenes.box((1.3, 1.4, 1.6), (8.7, 8.3, 8.6), inside_out=True)
    for shape in (tilted, room):
        with voxelized(gpu, scenes.scene((shape, WHITE)), unit_grid(12)) as found:
            for cell in range(len(found.cells)):
                facings = found.faces["facing"][found.faces["cell"] == cell]
                assert len(facings) == len(set(facings))


def test_points_are_spread_over_cells(gpu: GpuContext) -> None:
    """Points that faces of a plane stand for: all over cells, and evenly even along a line of few."""
    grid = VoxelGrid((0.0, 0.0, 0.0), 1.0, (16, 16, 8))
    with voxelized(gpu, scenes.scene((scenes.plane(100.0, 3.4), WHITE)), grid) as found:
        faces = found.faces["facing"] == 4
        inside = found.faces["position"][faces][:, :2] - found.face_cells[faces][:, :2]
        cells = found.face_cells[faces][:, :2]
    assert inside.min() >= 0.0 and inside.max() <= 1.0
    for axis in range(2):
        assert np.histogram(inside[:, axis], 4, (0.0, 1.0))[0].min() > 40
        for line in range(16):
            assert inside[cells[:, 1 - axis] == line, axis].mean() == pytest.approx(0.5, abs=0.1)


def rotation(axis: tuple[float, float, float], degrees: float) -> np.ndarray:
    """(4, 4), about an axis through the origin."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(degrees)
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return matrix


def lit_faces(gpu: GpuContext, made: SceneData, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places and normals of faces where nothing is turned, and what leaves them after all bounces."""
    with pipeline(gpu, made, scenes.settings(16), samples=0) as ready:
        found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
        grid = found.voxels.grid
        assert found.voxels.has_aslant_cuts
        places = found.faces["position"] * grid.cell_size + grid.origin
        return places @ matrix[:3, :3], found.faces["normal"] @ matrix[:3, :3], radiance(ready)[:, 0]


TURNS = [((0.36, 0.48, 0.8), 17.0), ((0.36, 0.48, 0.8), 0.3), ((1.0, -0.4, 0.2), 51.0), ((0.2, 0.3, -1.0), 126.0)]


@pytest.mark.parametrize("thickness", [1e-4, 0.02, 0.1])
@pytest.mark.parametrize("turn", TURNS)
def test_a_room_behind_a_wall_aslant_stays_dark(
    turn: tuple[tuple[float, float, float], float], thickness: float, gpu: GpuContext
) -> None:
    """A lamp in one of two closed rooms, all of whose walls lie aslant; that between them is thinner than a cell."""
    matrix = rotation(*turn)
    rooms = [scenes.box((-2.0 - 0.5 * thickness, -1, -1), (-0.5 * thickness, 1, 1), inside_out=True),
             scenes.box((0.5 * thickness, -1, -1), (2.0 + 0.5 * thickness, 1, 1), inside_out=True)]  # fmt: skip
    lamp = scenes.light(LightKind.POINT, 1.0, matrix[:3, :3] @ (-0.9, 0.1, 0.2))
    made = scenes.scene(*[(room, scenes.diffuse(0.5), matrix) for room in rooms], lights=[lamp])
    places, normals, leaving = lit_faces(gpu, made, matrix)
    middle = np.array([1.0 + 0.5 * thickness, 0.0, 0.0])
    lit = ((-middle - places) * normals).sum(axis=1) > 0.0
    dark = ((middle - places) * normals).sum(axis=1) > 0.0
    lit, dark = lit & (places[:, 0] < 0.0), dark & (places[:, 0] > 0.0)
    assert leaving[lit].mean() > 0.02
    assert leaving[dark].mean() < 1e-3 * leaving[lit].mean()


@pytest.mark.parametrize("turn", TURNS)
def test_a_lamp_in_a_box_on_a_floor(turn: tuple[tuple[float, float, float], float], gpu: GpuContext) -> None:
    """Light does not leave a closed box of sheets, at its corners neither: the floor goes on below it in one piece."""
    matrix = rotation(*turn)
    floor = (scenes.plane(4.0, -0.5), scenes.diffuse(0.5), matrix)
    box = (scenes.box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)), scenes.diffuse(0.5), matrix @ rotation((0, 0, 1), 28.0))
    lamp = scenes.light(LightKind.POINT, 1.0, matrix[:3, :3] @ (0.1, 0.05, 0.0))
    made = scenes.scene(floor, box, lights=[lamp])
    places, normals, leaving = lit_faces(gpu, made, matrix @ rotation((0, 0, 1), 28.0))
    outside = np.abs(places + 0.01 * normals).max(axis=1) > 0.501
    outside &= (places[:, 2] > -0.4999) | (normals[:, 2] > 0.5)  # not below the floor
    inside = np.abs(places + 0.01 * normals).max(axis=1) < 0.499
    assert leaving[inside].mean() > 0.02
    assert leaving[outside].mean() < 1e-3 * leaving[inside].mean()
