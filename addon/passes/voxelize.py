# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact, order-independent voxelization into six faces, stored for occupied cells only.

The cells that surfaces enter are marked, one bit each, in bricks of 4x4x4, and numbered; then every pair of a triangle
and a cell it enters is written down; then the pairs are listed cell by cell (rays are exact against the triangles) and
their materials summed face by face, a surface into the face that its normal is nearest to. Everything is allocated from
counts. Overlaps are exact (lib/overlap.glsl), so no cell is missed, and all sums are integers, so the same scene gives
the same bits on every run.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..grid import VoxelGrid
from ..scene import RayVisibility
from .geometry import Geometry
from .materials import MaterialPass, MaterialSet

#: Pairs in one dispatch: bounds how long a step takes, so that cancelling is quick.
PAIRS_PER_STEP = 1 << 18

_POPCOUNT = np.array([bin(value).count("1") for value in range(1 << 16)], np.uint8)


@dataclass
class Faces:
    """Voxel faces, as lib/face.glsl reads them: list textures, one entry a face."""

    count: int
    place: moderngl.Texture  # rgba32ui
    reflectance: moderngl.Texture  # rgba16, unsigned normalized: half floats would lose energy at each bounce
    order: moderngl.Texture  # r32ui: faces, alike ones next to each other

    def bind(self) -> None:
        """Bind for reading."""
        slot = interface.slot
        self.place.use(slot("TEX_FACE_PLACE"))
        self.reflectance.use(slot("TEX_FACE_REFLECTANCE"))


@dataclass
class Voxels:
    """The sparse voxel grid, as lib/grid.glsl and lib/trace.glsl read it."""

    grid: VoxelGrid
    bricks: moderngl.Texture3D
    cells: moderngl.Texture
    cell_triangles: moderngl.Texture
    cell_opacities: moderngl.Texture | None
    faces: Faces
    triangles: moderngl.Texture
    cell_count: int
    pair_count: int  # triangles, counted once for each cell they enter

    @property
    def trace_defines(self) -> dict[str, object]:
        return {"HAS_OPACITY": self.cell_opacities is not None}

    def bind(self, kernel: Kernel) -> None:
        """Bind everything that tracing reads."""
        slot = interface.slot
        self.triangles.use(slot("TEX_TRIANGLES"))
        self.bricks.use(slot("TEX_BRICKS"))
        self.cells.use(slot("TEX_CELLS"))
        self.cell_triangles.use(slot("TEX_CELL_TRIANGLES"))
        if self.cell_opacities is not None:
            self.cell_opacities.use(slot("TEX_CELL_OPACITIES"))
        kernel.set(grid_size=self.grid.size)


def popcount(words: np.ndarray) -> np.ndarray:
    """Bits set in each uint64 of ``words``, same shape, int64."""
    halves = np.ascontiguousarray(words).view(np.uint16).reshape(*words.shape, 4)
    return _POPCOUNT[halves].sum(axis=-1, dtype=np.int64)


def brick_distances(occupied: np.ndarray) -> np.ndarray:
    """Chebyshev distance of each brick to the nearest occupied one, (z, y, x) bool -> uint8 (255: farther or none)."""
    distance = np.where(occupied, 0, 255).astype(np.uint8)
    reached = occupied.copy()
    for step in range(1, 255):
        if reached.all() or not reached.any():
            break
        for axis in range(3):
            grown = reached.copy()
            before = [slice(None)] * 3
            after = [slice(None)] * 3
            before[axis], after[axis] = slice(None, -1), slice(1, None)
            grown[tuple(after)] |= reached[tuple(before)]
            grown[tuple(before)] |= reached[tuple(after)]
            reached = grown
        distance[reached & (distance == 255)] = step
    return distance


def cell_positions(masks: np.ndarray, bricks: tuple[int, int, int]) -> np.ndarray:
    """Positions of occupied cells in the order of their numbers, packed x | y << 11 | z << 22, (N,) uint32.

    ``masks``: (B,) uint64, bricks in the order x fastest.
    """
    filled = np.flatnonzero(masks)
    bits = np.unpackbits(np.ascontiguousarray(masks[filled]).view(np.uint8).reshape(-1, 8), axis=1, bitorder="little")
    row, bit = np.nonzero(bits)
    brick = filled[row]
    x = (brick % bricks[0]) * interface.BRICK + (bit & 3)
    y = (brick // bricks[0] % bricks[1]) * interface.BRICK + (bit >> 2 & 3)
    z = (brick // (bricks[0] * bricks[1])) * interface.BRICK + (bit >> 4)
    return (x | y << 11 | z << 22).astype(np.uint32)


def cell_axes(facings: np.ndarray) -> np.ndarray:
    """Work of pass voxel_resolve: cell | axis << 30 for each axis that a cell has faces on, axis by axis.

    ``facings``: (cells,) uint32, bits 0 to 5.
    """
    parts = [np.flatnonzero(facings >> (2 * axis) & 1).astype(np.uint32) | np.uint32(axis << 30) for axis in range(3)]
    return np.concatenate(parts)


def face_order(records: np.ndarray) -> np.ndarray:
    """(faces,) uint32: all faces, facing by facing: neighbours in the list are alike.

    ``records``: (cells, 4) uint32, as lib/grid.glsl describes them.
    """
    parts = []
    for facing in range(6):
        chosen = records[records[:, 3] >> facing & 1 == 1]
        parts.append(chosen[:, 2] + _POPCOUNT[chosen[:, 3] & ((1 << facing) - 1)])
    return np.concatenate(parts).astype(np.uint32)


class VoxelizePass:
    """Owns the voxels of one scene."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.voxels: Voxels | None = None
        self._owned: list[Any] = []
        self._temporary: list[Any] = []

    def run(self, geometry: Geometry, materials: MaterialSet, material_pass: MaterialPass) -> Iterator[float]:
        """Voxelize. Yields the share done; ``voxels`` is set at the end."""
        self.release()
        try:
            yield from self._steps(geometry, materials, material_pass)
        finally:
            self.gpu.free(*self._temporary)
            self._temporary = []

    def _steps(self, geometry: Geometry, materials: MaterialSet, material_pass: MaterialPass) -> Iterator[float]:
        gpu, slot, grid = self.gpu, interface.slot, geometry.grid
        mask = gpu.texture_3d("voxel marks", (2 * grid.bricks[0], grid.bricks[1], grid.bricks[2]), 1, "u4")
        self._temporary.append(mask)
        with gpu.timed("voxelize"):
            total, work = self._work(geometry)
        yield 0.1

        with gpu.timed("voxelize"):
            counters = gpu.buffer("voxel counters", size=4 * len(materials.batches))
            self._temporary.append(counters)
            kernel = gpu.kernel("voxel_mark").set(grid_size=grid.size, work_count=total)
            geometry.triangles.use(slot("TEX_TRIANGLES"))
            work.bind_to_storage_buffer(slot("BUF_WORK"))
            materials.batch_table.bind_to_storage_buffer(slot("BUF_MATERIALS"))
            counters.bind_to_storage_buffer(slot("BUF_COUNTS"))
            mask.bind_to_image(slot("IMG_0"), read=True, write=True)
            kernel.run_list(total)
            gpu.barrier()  # read back, then as a texture
            bricks, packed = self._number_cells(mask, grid)
            batch_counts = np.frombuffer(counters.read(), np.uint32)[: len(materials.batches)].astype(np.int64)
            starts = np.concatenate([[0], np.cumsum(batch_counts)])
            counters.write(starts[:-1].astype(np.uint32).tobytes())
        cells = len(packed)
        yield 0.25

        with gpu.timed("voxelize"):
            pairs = gpu.list_texture("voxel pairs", int(starts[-1]), 4, "u4")
            counts = gpu.buffer("voxel counts", size=8 * cells)
            self._temporary += [pairs, counts]
            kernel = gpu.kernel("voxel_pairs").set(grid_size=grid.size, work_count=total)
            bricks.use(slot("TEX_BRICKS"))
            counts.bind_to_storage_buffer(slot("BUF_SUMS"))
            pairs.bind_to_image(slot("IMG_0"), read=False, write=True)
            kernel.run_list(total)
            gpu.barrier()  # the counts are read back, the pairs by the next step
            voxels, facings = self._allocate(geometry, materials, bricks, counts, cells)
            positions = gpu.list_texture("voxel cell positions", cells, 1, "u4", packed if cells else None)
            self._temporary.append(positions)
        yield 0.4

        with gpu.timed("voxelize"):
            sums = gpu.buffer("voxel sums", size=4 * interface.FACE_SUM_WORDS * voxels.faces.count)
            self._temporary.append(sums)
        for index, batch in enumerate(materials.batches):
            for first in range(int(starts[index]), int(starts[index + 1]), PAIRS_PER_STEP):
                count = min(PAIRS_PER_STEP, int(starts[index + 1]) - first)
                with gpu.timed("voxelize"):
                    kernel = gpu.kernel(
                        "voxel_accumulate",
                        material_pass.defines(batch) | voxels.trace_defines | {"FLAT_SHADING": True},
                        material_pass.texts(batch),
                    )
                    geometry.bind(kernel)
                    material_pass.bind(batch, kernel)
                    voxels.cells.use(slot("TEX_CELLS"))
                    positions.use(slot("TEX_CELL_POSITIONS"))
                    pairs.use(slot("TEX_PAIRS"))
                    sums.bind_to_storage_buffer(slot("BUF_SUMS"))
                    counts.bind_to_storage_buffer(slot("BUF_COUNTS"))
                    voxels.cell_triangles.bind_to_image(slot("IMG_0"), read=False, write=True)
                    if voxels.cell_opacities is not None:
                        voxels.cell_opacities.bind_to_image(slot("IMG_1"), read=False, write=True)
                    kernel.set(pair_first=first, pair_count=count)
                    kernel.run_list(count)
                    material_pass.unbind(batch)
                yield 0.4 + 0.5 * (first + count) / max(int(starts[-1]), 1)

        with gpu.timed("voxelize"):
            gpu.barrier()  # sums and lists are complete
            self._resolve(voxels, sums, positions, facings)
        self.voxels = voxels
        yield 1.0

    def _resolve(
        self, voxels: Voxels, sums: moderngl.Buffer, positions: moderngl.Texture, facings: np.ndarray
    ) -> None:
        gpu, slot = self.gpu, interface.slot
        axes = cell_axes(facings)
        work = gpu.buffer("voxel work", axes)
        self._temporary.append(work)
        kernel = gpu.kernel("voxel_resolve")
        voxels.bind(kernel)
        kernel.set(work_count=len(axes))
        positions.use(slot("TEX_CELL_POSITIONS"))
        sums.bind_to_storage_buffer(slot("BUF_SUMS"))
        work.bind_to_storage_buffer(slot("BUF_WORK"))
        faces = voxels.faces
        faces.place.bind_to_image(slot("IMG_0"), read=False, write=True)
        faces.reflectance.bind_to_image(slot("IMG_1"), read=False, write=True)
        kernel.run_list(len(axes))
        gpu.barrier()  # injection and links read the faces

    def _work(self, geometry: Geometry) -> tuple[int, moderngl.Buffer]:
        """How many work items there are, and the items."""
        gpu, slot = self.gpu, interface.slot
        counter = gpu.buffer("voxel counters", size=4)
        self._temporary.append(counter)
        mask = int(RayVisibility.ALL)

        def run(count: bool) -> None:
            kernel = gpu.kernel("work", {"COUNT": count})
            kernel.set(grid_size=geometry.grid.size, triangle_count=geometry.triangle_count, ray_mask=mask)
            geometry.triangles.use(slot("TEX_TRIANGLES"))
            counter.bind_to_storage_buffer(slot("BUF_COUNTS"))
            kernel.run_list(geometry.triangle_count)
            gpu.barrier()  # the counter is read back, work by later steps

        run(count=True)
        total = int(np.frombuffer(counter.read(4), np.uint32)[0])
        counter.clear()
        work = gpu.buffer("voxel work", size=8 * total)
        self._temporary.append(work)
        work.bind_to_storage_buffer(slot("BUF_WORK"))
        run(count=False)
        return total, work

    def _number_cells(self, mask: moderngl.Texture3D, grid: VoxelGrid) -> tuple[moderngl.Texture3D, np.ndarray]:
        """The brick texture, and the packed positions of the occupied cells."""
        masks = np.frombuffer(mask.read(), np.uint64)
        counts = popcount(masks)
        shape = grid.bricks[::-1]
        texels = np.empty((len(masks), 4), np.uint32)
        texels[:, :2] = masks.view(np.uint32).reshape(-1, 2)
        texels[:, 2] = np.cumsum(counts) - counts
        texels[:, 3] = brick_distances((masks != 0).reshape(shape)).ravel()
        bricks = self.gpu.texture_3d("bricks", grid.bricks, 4, "u4", texels)
        self._owned.append(bricks)
        return bricks, cell_positions(masks, grid.bricks)

    def _allocate(
        self,
        geometry: Geometry,
        materials: MaterialSet,
        bricks: moderngl.Texture3D,
        counts: moderngl.Buffer,
        cells: int,
    ) -> tuple[Voxels, np.ndarray]:
        """The voxels, still empty, and which ways the surfaces of each cell face."""
        gpu = self.gpu
        table = np.frombuffer(counts.read(), np.uint32)[: 2 * cells].reshape(-1, 2)
        records = np.zeros((max(cells, 1), 4), np.uint32)
        pairs, faces = 0, 0
        if cells:
            ends = np.cumsum(table[:, 0], dtype=np.int64)
            face_counts = _POPCOUNT[table[:, 1]]
            face_ends = np.cumsum(face_counts, dtype=np.int64)
            pairs, faces = int(ends[-1]), int(face_ends[-1])
            records[:, 0] = ends - table[:, 0]
            records[:, 1] = table[:, 0]
            records[:, 2] = face_ends - face_counts
            records[:, 3] = table[:, 1]
            counts.write(np.ascontiguousarray(records[:, 0]).tobytes())  # from here on: next list entry of each cell
        cell_texture = gpu.list_texture("cells", len(records), 4, "u4", records)
        triangles = gpu.list_texture("cell triangles", pairs, 1, "u4")
        opacities = gpu.list_texture("cell opacities", pairs, 1, "f1") if materials.lets_light_through else None
        textures = Faces(
            faces,
            gpu.list_texture("faces", faces, 4, "u4"),
            gpu.list_texture("faces", faces, 4, "nu2"),
            gpu.list_texture("faces", faces, 1, "u4", face_order(records[:cells]) if faces else None),
        )
        self._owned += [
            cell_texture, triangles, opacities, textures.place, textures.reflectance, textures.order,
        ]  # fmt: skip
        voxels = Voxels(
            grid=geometry.grid,
            bricks=bricks,
            cells=cell_texture,
            cell_triangles=triangles,
            cell_opacities=opacities,
            faces=textures,
            triangles=geometry.triangles,
            cell_count=cells,
            pair_count=pairs,
        )
        return voxels, records[:cells, 3].copy()

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self._owned, *self._temporary)
        self._owned, self._temporary = [], []
        self.voxels = None
