# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a test shader, some passes or a whole pipeline, and read back what they made."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from addon.gpu import interface
from addon.gpu.context import GpuContext, Kernel
from addon.grid import VoxelGrid
from addon.passes.geometry import Geometry, GeometryPass
from addon.passes.materials import MaterialPass
from addon.passes.packed_light import unpack_light
from addon.passes.voxel_numbers import cell_positions, with_hidden_cells
from addon.passes.voxelize import VoxelizePass, Voxels
from addon.pipeline import Pipeline
from addon.scene import SceneData
from addon.settings import Settings


def test_kernel(
    gpu: GpuContext, name: str, defines: Mapping[str, object] | None = None, texts: Mapping[str, str] | None = None
) -> Kernel:
    """The shader ``shaders/tests/<name>.comp.glsl``."""
    return gpu.kernel(f"../tests/{name}", defines, texts)


test_kernel.__test__ = False  # type: ignore[attr-defined]  a helper, whatever its name


def map_list(gpu: GpuContext, kernel: Kernel, inputs: np.ndarray, columns: int, **uniforms: Any) -> np.ndarray:
    """Run a test shader over rows of vec4 (``inputs``: (N, 4 k) float32); (N, columns) float32 of what it wrote.

    The shader reads BUF_WORK and writes BUF_RESULTS, both arrays of vec4, and asks for ``count``.
    """
    inputs = np.ascontiguousarray(inputs, np.float32)
    given = gpu.buffer("test input", inputs)
    made = gpu.buffer("test output", size=4 * columns * len(inputs))
    given.bind_to_storage_buffer(interface.slot("BUF_WORK"))
    made.bind_to_storage_buffer(interface.slot("BUF_RESULTS"))
    kernel.set(count=len(inputs), **uniforms)
    kernel.run_list(len(inputs))
    gpu.barrier()  # read back
    result = np.frombuffer(made.read(), np.float32)[: columns * len(inputs)].reshape(len(inputs), columns).copy()
    gpu.free(given, made)
    return result


@dataclass
class VoxelData:
    """What voxelization made, on the GPU and read back."""

    voxels: Voxels
    geometry: Geometry
    masks: np.ndarray  # (bricks,) uint64
    cells: np.ndarray  # (cells, 3) int
    records: np.ndarray  # (cells, 4): first triangle, count, first face, face mask
    faces: np.ndarray  # (faces,) cell, facing, position, normal, shading normal, reflectance, weight
    triangles: np.ndarray  # (pairs,) cell by cell

    @property
    def pairs(self) -> np.ndarray:
        """(pairs, 4): cell x y z, triangle; sorted."""
        rows = np.concatenate([np.repeat(self.cells, self.records[:, 1], axis=0), self.triangles[:, None]], axis=1)
        return rows[np.lexsort(rows.T[::-1])]

    @property
    def ordered_records(self) -> np.ndarray:
        """``records`` as if cells listed their triangles in order: they name those that cut cells aslant."""
        result = self.records.copy()
        for cell in np.flatnonzero(self.records[:, 3] & interface.CUT_IS_ASLANT):
            first, count, _, word = self.records[cell].tolist()
            listed = self.triangles[first : first + count]
            places = [(14, 2047)] if word >> 12 & 3 == 3 else [(14, 31), (19, 31)]
            for shift, mask in places:
                place = int((listed < listed[word >> shift & mask]).sum())
                word = word & ~(mask << shift) | place << shift
            result[cell, 3] = word
        return result

    @property
    def face_cells(self) -> np.ndarray:
        """(faces, 3): the cell of each face."""
        return self.cells[self.faces["cell"]]


_FACE = np.dtype([
    ("cell", np.int64), ("facing", np.int64), ("position", np.float32, 3), ("normal", np.float64, 3),
    ("shading_normal", np.float64, 3), ("reflectance", np.float32, 3), ("weight", np.float32),
])  # fmt: skip


def _octahedral(words: np.ndarray) -> np.ndarray:
    """(N,) uint32 of two signed 16-bit numbers as (N, 3) unit vectors."""
    e = np.clip(np.ascontiguousarray(words).view(np.int16).reshape(-1, 2) / 32767.0, -1.0, 1.0)
    z = 1.0 - np.abs(e).sum(axis=1)
    folded = (1.0 - np.abs(e[:, ::-1])) * np.where(e >= 0, 1.0, -1.0)
    n = np.concatenate([np.where(z[:, None] < 0, folded, e), z[:, None]], axis=1)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def pack_light(light: np.ndarray) -> np.ndarray:
    """Light of faces as lib/packed_light.glsl stores it, (N, 3) float32 -> (N, 2) uint32."""
    exponent = np.maximum(np.frexp(light.max(axis=1))[1] + 126, 20)
    scaled = np.ldexp(light, 144 - exponent[:, None]) + np.float32(0.5)
    whole = np.minimum(scaled, np.float32(2**18 - 1)).astype(np.uint32)
    high = whole[:, 1] >> 14 | whole[:, 2] << 4 | exponent.astype(np.uint32) << 22
    return np.stack([whole[:, 0] | whole[:, 1] << 18, high], axis=1)


def read_list(texture: Any, count: int, kind: Any) -> np.ndarray:
    """(count, components) of a list texture."""
    return np.frombuffer(texture.read(), kind).reshape(-1, texture.components)[:count]


def read_faces(voxels: Voxels, records: np.ndarray) -> np.ndarray:
    """The faces, with what is known of them from their cells."""
    count = voxels.faces.count
    faces = np.zeros(count, _FACE)
    cell, bit = np.nonzero(records[:, 3:] >> np.arange(12) & 1)
    facing = bit % 6
    assert len(cell) == count and all(records[cell, 2] <= np.arange(count))
    faces["cell"], faces["facing"] = cell, facing
    place = read_list(voxels.faces.place, count, np.uint32)
    faces["position"] = np.ascontiguousarray(place[:, :3]).view(np.float32)
    faces["normal"] = _octahedral(place[:, 3])
    faces["shading_normal"] = faces["normal"]
    if voxels.faces.shading is not None:
        faces["shading_normal"] = _octahedral(read_list(voxels.faces.shading, count, np.uint32)[:, 0])
    reflectance = read_list(voxels.faces.reflectance, count, np.uint16) / np.float32(65535)
    faces["reflectance"], faces["weight"] = reflectance[:, :3], reflectance[:, 3] ** 2 * interface.MAX_FACE_WEIGHT
    return faces


def read_voxels(voxels: Voxels, geometry: Geometry) -> VoxelData:
    words = np.frombuffer(voxels.bricks.read(), np.uint32).reshape(-1, 4)
    masks = np.ascontiguousarray(words[:, :2]).view(np.uint64).ravel()
    packed = cell_positions(masks, voxels.grid.bricks, voxels.grid.position_bits)
    bits, _ = voxels.grid.position_bits
    mask = (1 << bits) - 1
    cells = np.stack([packed & mask, packed >> bits & mask, packed >> 2 * bits], axis=1).astype(np.int64)
    stored = np.frombuffer(voxels.cells.read(), np.uint32).reshape(-1, 4)[: voxels.cell_count]
    records = with_hidden_cells(stored, 0).astype(np.int64)
    triangles = np.frombuffer(voxels.cell_triangles.read(), np.uint32)[: voxels.pair_count].astype(np.int64)
    return VoxelData(voxels, geometry, masks, cells, records, read_faces(voxels, records), triangles)


@contextlib.contextmanager
def voxelized(gpu: GpuContext, scene: SceneData, grid: VoxelGrid) -> Iterator[VoxelData]:
    """The scene's voxels in any grid, also one that it does not fit into."""
    materials, geometry, voxelize = MaterialPass(gpu), GeometryPass(gpu), VoxelizePass(gpu)
    try:
        made = geometry.run(scene, grid, materials.run(scene.materials))
        assert materials.set is not None
        for _ in voxelize.run(made, materials.set, materials, has_faces=True):
            pass
        assert voxelize.voxels is not None
        yield read_voxels(voxelize.voxels, made)
    finally:
        for part in (voxelize, geometry, materials):
            part.release()


@contextlib.contextmanager
def pipeline(
    gpu: GpuContext,
    scene: SceneData,
    settings: Settings,
    size: tuple[int, int] = (8, 8),
    *,
    samples: int | None = None,
    outputs: tuple[str, ...] = (),
    is_live: bool = False,
) -> Iterator[Pipeline]:
    """A pipeline after ``prepare`` and ``samples`` passes (as set)."""
    made = Pipeline(gpu, is_live=is_live)
    try:
        made.want(outputs)
        prepare(made, scene, settings, size)
        sample(made, settings.samples if samples is None else samples)
        yield made
    finally:
        made.release()


def prepare(made: Pipeline, scene: SceneData, settings: Settings, size: tuple[int, int] = (8, 8)) -> None:
    for _ in made.prepare(scene, settings, size):
        pass


def sample(made: Pipeline, count: int) -> None:
    for _ in range(count):
        for _ in made.sample():
            pass


def radiance(made: Pipeline) -> np.ndarray:
    """(faces, 3): what leaves the voxel faces after all bounces."""
    voxels = made.voxel_light.voxelize.voxels
    assert voxels is not None
    return unpack_light(read_list(made.voxel_light.bounce.radiance, voxels.faces.count, np.uint32))


def unit_grid(size: int | tuple[int, int, int]) -> VoxelGrid:
    """World space is grid space. Whole bricks, as all grids are."""
    sides = (size, size, size) if isinstance(size, int) else size
    assert all(side % interface.BRICK == 0 for side in sides)
    return VoxelGrid((0.0, 0.0, 0.0), 1.0, sides)
