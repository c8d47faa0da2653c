# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells beside a cell that a wall hides from it; and points of faces that lie on the surfaces they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.passes import neighbours
from addon.passes.voxel_numbers import face_counts, hidden_cells
from addon.scene import MeshData
from blender_tests.passes import scenes
from blender_tests.passes.run import VoxelData, read_list, unit_grid, voxelized

WHITE = scenes.diffuse(0.9)


def hidden(found: VoxelData) -> np.ndarray:
    """(cells, 2): bits of the cells that are hidden from those sides."""
    bits = hidden_cells(read_list(found.voxels.cells, len(found.cells), np.uint32))
    return np.stack([bits & 63, bits >> 6], axis=1)


def turned(angle: float) -> np.ndarray:
    """About a diagonal through the middle of a grid of 12 cells."""
    axis = np.array([0.36, 0.48, 0.8])
    cross = np.cross(np.eye(3), -axis)
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    matrix[:3, 3] = 6.0 - matrix[:3, :3] @ np.full(3, 6.0)
    return matrix


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("place", [5.0, 5.02, 5.5, 5.97])
def test_a_wall_hides_what_is_behind_it(place: float, axis: int, gpu: GpuContext) -> None:
    """From the floor at a sheet that stands on it, wherever in its cell that is, and from nowhere else."""
    turn = np.eye(4)
    turn[:3, :3] = np.roll(np.eye(3), axis, axis=0)
    floor = (scenes.plane(40.0, 3.3), WHITE, turn)
    wall = (scenes.box((place - 0.005, 0.2, 3.3), (place + 0.005, 11.8, 11.8)), WHITE, turn)
    with voxelized(gpu, scenes.scene(floor, wall), unit_grid(12)) as found:
        across, along, up = axis, (axis + 1) % 3, (axis + 2) % 3
        bits = hidden(found)
        cells = found.cells
        row = (cells[:, up] == 3) & (cells[:, along] > 1) & (cells[:, along] < 10)
        plus, minus = 1 << 2 * across, 2 << 2 * across
        crossings = []
        for other in range(2, 9):
            here, there = (bits[row & (cells[:, across] == at)] for at in (other, other + 1))
            # Between sides of cells: the last of this cell that is there, and the first of the next.
            crossings.append(((here & plus) != 0).any(axis=1).all() or ((there & minus) != 0).any(axis=1).all())
        assert any(crossings[2:4]) and not any(crossings[:2]) and not any(crossings[4:])
        far = row & (np.abs(cells[:, across] + 0.5 - place) > 2.0)
        assert far.any() and not bits[far].any()


def test_nothing_is_hidden_on_open_surfaces(gpu: GpuContext) -> None:
    """A plane at any angle, a room, a ball of three cells' radius: what bulges or is hollow hides nothing."""
    tilted = scenes.soup([[[0.3, 0.2, 1.0], [9.0, 0.5, 5.0], [0.5, 9.0, 7.0]]])
    room = scenes.box((1.3, 1.4, 1.6), (8.7, 8.3, 8.6), inside_out=True)
    for shape in (tilted, room):
        with voxelized(gpu, scenes.scene((shape, WHITE)), unit_grid(12)) as found:
            assert not hidden(found).any()


def test_what_is_not_asked_about_is_not_hidden(monkeypatch: pytest.MonkeyPatch, gpu: GpuContext) -> None:
    """All cells asked, as if something stood on each: the same is hidden. Slivers, which tell nothing, are asked."""
    sliver = scenes.soup([[[2.0, 14.02, 12.3], [22.0, 14.03, 12.3], [2.0, 14.02, 12.30004]]])
    shapes = [(sliver, WHITE, np.eye(4)),
              (scenes.box((1.3, 1.4, 1.6), (22.7, 22.3, 22.6), inside_out=True), WHITE, np.eye(4)),
              (scenes.box((5.2, 5.1, 1.5), (9.3, 9.9, 7.7)), WHITE, np.eye(4)),
              (scenes.sphere(3.0), WHITE, scenes.at(16.2, 15.1, 8.3))]  # fmt: skip
    with voxelized(gpu, scenes.scene(*shapes), unit_grid(24)) as found:
        asked = hidden(found)
        counts = face_counts(read_list(found.voxels.cells, len(found.cells), np.uint32)[:, 3])
        weights = np.minimum.reduceat(found.faces["weight"], np.cumsum(counts, dtype=np.int64) - counts)
        calm: list[np.ndarray] = []
        find = neighbours.calm_cells
        monkeypatch.setattr(neighbours, "calm_cells", lambda *of: calm.append(find(*of)) or np.zeros_like(calm[0]))
        with voxelized(gpu, scenes.scene(*shapes), unit_grid(24)) as all_asked:
            np.testing.assert_array_equal(hidden(all_asked), asked)
    assert 0.2 < calm[0].mean() < 0.8
    told = calm[0] & asked.any(axis=1)
    assert told.any() and (weights[told] < 1e-4).all()


@pytest.mark.parametrize(
    ("shape", "asks"),
    [(scenes.plane(8.0, 3.3), False), (scenes.box((-3.7,) * 3, (3.7,) * 3, inside_out=True), True)],
)
def test_where_nothing_stands_nothing_is_asked(
    shape: MeshData, asks: bool, monkeypatch: pytest.MonkeyPatch, gpu: GpuContext
) -> None:
    """A plane has no use for the pass, and does not compile it; a room has."""
    programs: list[str] = []
    kernel = gpu.kernel
    monkeypatch.setattr(gpu, "kernel", lambda name, *of: programs.append(name) or kernel(name, *of))
    with voxelized(gpu, scenes.scene((shape, WHITE, scenes.at(5.0, 5.0, 5.0))), unit_grid(12)) as found:
        assert found.voxels.faces.count > 0
    assert ("neighbours" in programs) == asks


def test_faces_stand_for_points_of_surfaces(gpu: GpuContext) -> None:
    """Two rooms that share a wall, aslant in the grid: points lie in the planes of walls, with their normals."""
    angle = np.radians(17.0)
    matrix = turned(angle)
    rooms = [scenes.box((2.2, 3.1, 3.2), (6.0, 9.1, 8.8), inside_out=True),
             scenes.box((6.01, 3.1, 3.2), (9.9, 9.1, 8.8), inside_out=True)]  # fmt: skip
    with voxelized(gpu, scenes.scene(*[(room, WHITE, matrix) for room in rooms]), unit_grid(12)) as found:
        faces = found.faces[found.faces["weight"] > 1e-3]
        back = np.linalg.inv(matrix)
        normals = np.abs(faces["normal"] @ back[:3, :3].T)
        places = faces["position"] @ back[:3, :3].T + back[:3, 3]
        assert (normals.max(axis=1) > 1.0 - 1e-4).all()
        across = normals.argmax(axis=1)
        planes = np.array([[2.2, 6.0, 6.01, 9.9], [3.1, 9.1, 3.1, 9.1], [3.2, 8.8, 3.2, 8.8]])[across]
        off = np.abs(planes - places[np.arange(len(places)), across, None]).min(axis=1)
        assert off.max() < 5e-4
