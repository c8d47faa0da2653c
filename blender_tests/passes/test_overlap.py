# SPDX-License-Identifier: GPL-3.0-or-later
"""Area and centre of the part of a triangle inside a cell, against clipping in float64."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from blender_tests.passes import reference
from blender_tests.passes.run import map_list, test_kernel


def triangles_near_cube(kind: str, count: int = 300) -> np.ndarray:
    """(N, 3, 3) float32 with their dominant axis along z, as the voxelization turns them."""
    rng = np.random.default_rng(7)
    centre = rng.uniform(-0.2, 1.2, (count, 1, 3))
    size = {"ordinary": 1.0, "tiny": 0.02, "huge": 40.0, "sliver": 4.0, "on planes": 1.0, "level": 1.5}[kind]
    made = centre + rng.normal(size=(count, 3, 3)) * size
    if kind == "sliver":
        made[:, 2] = (
            made[:, 0] + (made[:, 1] - made[:, 0]) * rng.random((count, 1)) + rng.normal(size=(count, 3)) * 1e-3
        )
    if kind == "on planes":
        made = np.round(made * 2) / 2
    if kind == "level":
        made[:, :, 2] = np.round(centre[:, :, 2])
    normal = np.cross(made[:, 1] - made[:, 0], made[:, 2] - made[:, 0])
    axis = np.abs(normal).argmax(axis=1)
    order = (np.arange(3)[None] + axis[:, None] + 1) % 3
    made = np.take_along_axis(made, np.broadcast_to(order[:, None, :], made.shape), axis=2)
    normal = np.take_along_axis(normal, order, axis=1)
    return made[np.linalg.norm(normal, axis=1) > 1e-7].astype(np.float32)


@pytest.mark.parametrize("kind", ["ordinary", "tiny", "huge", "sliver", "on planes", "level"])
def test_area_and_centre(kind: str, gpu: GpuContext) -> None:
    triangles = triangles_near_cube(kind)
    inputs = np.zeros((len(triangles), 12), np.float32)
    inputs.reshape(-1, 3, 4)[:, :, :3] = triangles
    measured = map_list(gpu, test_kernel(gpu, "overlap", {"HAS_INSTANCES": False, "LEVELS": 0}), inputs, 4)[:, :3]
    expected = np.array([reference.projected_moments(reference.clip_to_cube(t)) for t in triangles])
    if kind in ("on planes", "level"):
        # What lies in a plane between two cells belongs to the upper one, in float64 to both.
        z = triangles[:, :, 2]
        expected[(z == z[:, :1]).all(axis=1) & (z[:, 0] == 1.0)] = 0.0
    scale = 4e-7 * np.abs(triangles).max(axis=(1, 2), keepdims=False) * 8 + 1e-6
    assert (np.abs(measured - expected) <= scale[:, None]).all(), np.abs(measured - expected).max()
    assert np.abs(expected[:, 0]).max() > (1e-4 if kind in ("tiny", "sliver") else 0.2)  # there is something to see


@pytest.mark.parametrize("kind", ["ordinary", "tiny", "on planes"])
def test_part_above_two_planes(kind: str, gpu: GpuContext) -> None:
    """Planes through the cell in all directions: some cut triangles, some leave all or nothing of them. *on planes*:
    they go through corners and along edges."""
    triangles = triangles_near_cube(kind)
    rng = np.random.default_rng(11)
    normals = rng.normal(size=(2, len(triangles), 3))
    places = rng.uniform(0.2, 0.8, (2, len(triangles), 1, 3))
    if kind == "on planes":
        normals, places = np.eye(3)[rng.integers(0, 3, normals.shape[:2])], np.round(places * 2) / 2
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    heights = np.einsum("pnki,pni->pnk", triangles[None] - places, normals)
    # On which side what lies in a plane is, between cells too, does not matter here.
    lies_in_one = (heights == 0.0).all(axis=2).any(axis=0) | (triangles[:, :, 2] == 1.0).all(axis=1)
    triangles, normals, places, heights = (
        triangles[~lies_in_one], normals[:, ~lies_in_one], places[:, ~lies_in_one], heights[:, ~lies_in_one]
    )  # fmt: skip
    inputs = np.zeros((len(triangles), 4, 4), np.float32)
    inputs[:, :3, :3], inputs[:, :3, 3], inputs[:, 3, :3] = triangles, heights[0], heights[1]
    measured = map_list(gpu, test_kernel(gpu, "overlap_above"), inputs.reshape(-1, 16), 4)[:, :3]
    expected = np.zeros((len(triangles), 3))
    for index, triangle in enumerate(triangles):
        polygon = reference.clip_to_cube(triangle)
        for plane in range(2):
            polygon = reference.clip_by_distance(
                polygon, (polygon - places[plane, index]) @ normals[plane, index]
            )  # fmt: skip
        expected[index] = reference.projected_moments(polygon)
    assert np.abs(measured - expected).max() < 2e-5
    assert (np.abs(expected[:, 0]) > 0.0).mean() > 0.05


def test_cells_share_a_triangle_completely(gpu: GpuContext) -> None:
    """The parts in 8 x 8 x 8 cells add up to the whole triangle, whose corners lie anywhere, also on planes."""
    rng = np.random.default_rng(3)
    whole = rng.uniform(1.0, 7.0, (6, 3, 3))
    whole[3:] = np.round(whole[3:])
    cells = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    for triangle in whole:
        inputs = np.zeros((len(cells), 12), np.float32)
        inputs.reshape(-1, 3, 4)[:, :, :3] = triangle[None] - cells
        parts = map_list(gpu, test_kernel(gpu, "overlap", {"HAS_INSTANCES": False, "LEVELS": 0}), inputs, 4)[:, 0]
        area = reference.projected_moments(triangle)[0]
        assert parts.sum() == pytest.approx(area, abs=2e-5)
        assert (parts * np.sign(area) > -2e-6).all()
