# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact, order-independent voxelization into six faces, stored for occupied cells only.

The cells that surfaces enter are marked, one bit each, in bricks of 4x4x4, and numbered; then every pair of a triangle
and a cell it enters is written down; then the pairs are listed cell by cell (rays are exact against the triangles) and
their materials summed face by face, a surface into the face that its normal is nearest to. Everything is allocated from
counts. Overlaps are exact (lib/overlap.glsl), so no cell is missed, and all sums are integers, so the same scene gives
the same bits on every run.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from itertools import accumulate
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
#: Work items likewise: a few pairs each.
ITEMS_PER_STEP = 1 << 17

_POPCOUNT = np.array([bin(value).count("1") for value in range(1 << 16)], np.uint8)
#: Both facings of each axis, for each set of axes.
_FACINGS = np.array([sum(3 << 2 * axis for axis in range(3) if axes >> axis & 1) for axes in range(8)], np.uint32)


@dataclass
class Faces:
    """Voxel faces, as lib/face.glsl reads them: list textures, one entry a face."""

    count: int
    place: moderngl.Texture  # rgba32ui
    reflectance: moderngl.Texture  # rgba16, unsigned normalized: half floats would lose energy at each bounce
    emission: moderngl.Texture | None  # rgba32f
    order: moderngl.Texture  # r32ui: faces, alike ones next to each other

    def bind(self) -> None:
        """Bind for reading."""
        slot = interface.slot
        self.place.use(slot("TEX_FACE_PLACE"))
        self.reflectance.use(slot("TEX_FACE_REFLECTANCE"))
        if self.emission is not None:
            self.emission.use(slot("TEX_FACE_EMISSION"))


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
    z, rest = np.divmod(filled, bricks[0] * bricks[1])
    y, x = np.divmod(rest, bricks[0])
    corners = ((x | y << 11 | z << 22) * interface.BRICK).astype(np.uint32)
    bit = np.arange(64, dtype=np.uint32)
    inside = bit & 3 | (bit >> 2 & 3) << 11 | bit >> 4 << 22
    bits = np.unpackbits(np.ascontiguousarray(masks[filled]).view(np.uint8), bitorder="little")
    index = np.flatnonzero(bits)
    return corners[index >> 6] | inside[index & 63]


def cell_axes(axes: np.ndarray) -> tuple[np.ndarray, tuple[int, ...]]:
    """Work of pass voxel_resolve: cell | axis << 30 for each axis that a cell has faces on, axis by axis, and how many
    there are of each axis.

    ``axes``: (cells,) uint32, bits 0 to 2.
    """
    cells = [np.flatnonzero(axes & (1 << axis)) for axis in range(3)]
    items = np.empty(sum(map(len, cells)), np.uint32)
    first = 0
    for axis, chosen in enumerate(cells):
        part = items[first : first + len(chosen)]
        part[:] = chosen
        part |= axis << 30
        first += len(chosen)
    return items, tuple(map(len, cells))


@dataclass
class _Parts:
    """What triangles bring to the faces of cells, cell by cell (lib/part.glsl): list textures, while faces are made."""

    sums: moderngl.Texture  # rgba32ui
    emission: moderngl.Texture | None  # rgba32f


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
        gpu, grid = self.gpu, geometry.grid
        with gpu.timed("voxelize"):
            marks = gpu.texture_3d("voxel marks", (2 * grid.bricks[0], grid.bricks[1], grid.bricks[2]), 1, "u4")
            self._temporary.append(marks)
            item_starts, estimate, work = self._work(geometry, materials)
        yield 0.05

        capacity, starts = 0, [estimate]
        while starts[-1] > capacity:  # the estimate hardly ever falls short
            capacity = starts[-1]
            with gpu.timed("voxelize"):
                pairs = gpu.list_texture("voxel pairs", capacity, 4, "u4")
                self._temporary.append(pairs)
            starts = yield from self._list_pairs(geometry, item_starts, work, marks, pairs, capacity)
        with gpu.timed("voxelize"):
            bricks, packed = self._number_cells(marks, grid)
            gpu.free(marks, work)
        yield 0.4

        with gpu.timed("voxelize"):
            cursors = gpu.buffer("voxel counts", size=4 * len(packed))
            self._temporary.append(cursors)
            kernel = gpu.kernel("voxel_count").set(grid_size=grid.size, pair_first=0, pair_count=starts[-1])
            bricks.use(interface.slot("TEX_BRICKS"))
            pairs.use(interface.slot("TEX_PAIRS"))
            cursors.bind_to_storage_buffer(interface.slot("BUF_COUNTS"))
            kernel.run_list(starts[-1])
            gpu.barrier()  # read back
            voxels, axes = self._allocate(geometry, materials, bricks, cursors, len(packed))
            parts = _Parts(
                gpu.list_texture("voxel parts", voxels.pair_count, 4, "u4"),
                gpu.list_texture("voxel parts", voxels.pair_count, 4, "f4") if materials.has_emission else None,
            )
            self._temporary += [parts.sums, parts.emission]
        yield 0.5

        for index in range(len(materials.batches)):
            for first in range(starts[index], starts[index + 1], PAIRS_PER_STEP):
                count = min(PAIRS_PER_STEP, starts[index + 1] - first)
                with gpu.timed("voxelize"):
                    self._accumulate(geometry, materials, material_pass, index, voxels, pairs, cursors, parts, first, count)
                yield 0.5 + 0.4 * (first + count) / starts[-1]

        with gpu.timed("voxelize"):
            gpu.barrier()  # lists are complete
            gpu.free(pairs, cursors)
            self._resolve(voxels, materials, parts, packed, axes)
        self.voxels = voxels
        yield 1.0

    def _work(self, geometry: Geometry, materials: MaterialSet) -> tuple[list[int], int, moderngl.Buffer]:
        """Where each batch's work items start (and the last ones end), about how many pairs there are, the items."""
        gpu, slot = self.gpu, interface.slot
        batches = len(materials.batches)
        counters = gpu.buffer("voxel counters", size=4 * (batches + 1))
        self._temporary.append(counters)

        def run(count: bool) -> None:
            kernel = gpu.kernel("work", {"COUNT": count})
            kernel.set(
                grid_size=geometry.grid.size, triangle_count=geometry.triangle_count, ray_mask=int(RayVisibility.ALL),
                batch_count=batches,
            )  # fmt: skip
            geometry.triangles.use(slot("TEX_TRIANGLES"))
            materials.batch_table.bind_to_storage_buffer(slot("BUF_MATERIALS"))
            counters.bind_to_storage_buffer(slot("BUF_COUNTS"))
            kernel.run_list(geometry.triangle_count)
            gpu.barrier()  # counters are read back, work by later steps

        run(count=True)
        counts = np.frombuffer(counters.read(), np.uint32)[: batches + 1].tolist()
        starts = [0, *accumulate(counts[:batches])]
        counters.write(np.array(starts, np.uint32))
        work = gpu.buffer("voxel work", size=8 * starts[-1])
        self._temporary.append(work)
        work.bind_to_storage_buffer(slot("BUF_WORK"))
        run(count=False)
        return starts, counts[-1], work

    def _list_pairs(
        self,
        geometry: Geometry,
        item_starts: list[int],
        work: moderngl.Buffer,
        marks: moderngl.Texture3D,
        pairs: moderngl.Texture,
        capacity: int,
    ) -> Generator[float, None, list[int]]:
        """Mark cells and list pairs; returns where each batch's pairs start, and the end of the last ones."""
        gpu, slot = self.gpu, interface.slot
        batches = len(item_starts) - 1
        counters = gpu.buffer("voxel counters", size=4 * (batches + 1))
        self._temporary.append(counters)
        for batch in range(batches):
            for first in range(item_starts[batch], item_starts[batch + 1], ITEMS_PER_STEP):
                count = min(ITEMS_PER_STEP, item_starts[batch + 1] - first)
                with gpu.timed("voxelize"):
                    kernel = gpu.kernel("voxel_pairs")
                    kernel.set(
                        grid_size=geometry.grid.size, work_first=first, work_count=count, batch=batch,
                        pair_capacity=capacity,
                    )  # fmt: skip
                    geometry.triangles.use(slot("TEX_TRIANGLES"))
                    work.bind_to_storage_buffer(slot("BUF_WORK"))
                    counters.bind_to_storage_buffer(slot("BUF_COUNTS"))
                    marks.bind_to_image(slot("IMG_0"), read=True, write=True)
                    pairs.bind_to_image(slot("IMG_1"), read=False, write=True)
                    kernel.run_list(count)
                yield 0.05 + 0.35 * (first + count) / item_starts[-1]
            gpu.barrier()  # the next batch goes on where this one ends; in the end all is read
            gpu.mgl.copy_buffer(counters, counters, 4, read_offset=4 * batch, write_offset=4 * batch + 4)
        ends = np.frombuffer(counters.read(), np.uint32)[:batches]
        return [0, *ends.tolist()]

    def _accumulate(
        self,
        geometry: Geometry,
        materials: MaterialSet,
        material_pass: MaterialPass,
        batch_index: int,
        voxels: Voxels,
        pairs: moderngl.Texture,
        cursors: moderngl.Buffer,
        parts: _Parts,
        first: int,
        count: int,
    ) -> None:
        """List the triangles of cells, and what they bring to their faces, for some pairs of one batch."""
        gpu, slot = self.gpu, interface.slot
        batch = materials.batches[batch_index]
        emits = materials.compiled.families[batch.family].has_emission
        kernel = gpu.kernel(
            "voxel_accumulate",
            material_pass.defines(batch) | voxels.trace_defines | {"HAS_EMISSION": emits, "FLAT_SHADING": True},
            material_pass.texts(batch),
        )
        geometry.bind(kernel)
        material_pass.bind(batch, kernel)
        voxels.bricks.use(slot("TEX_BRICKS"))
        pairs.use(slot("TEX_PAIRS"))
        cursors.bind_to_storage_buffer(slot("BUF_COUNTS"))
        voxels.cell_triangles.bind_to_image(slot("IMG_0"), read=False, write=True)
        parts.sums.bind_to_image(slot("IMG_1"), read=False, write=True)
        if voxels.cell_opacities is not None:
            voxels.cell_opacities.bind_to_image(slot("IMG_2"), read=False, write=True)
        if parts.emission is not None:
            parts.emission.bind_to_image(slot("IMG_3"), read=False, write=True)
        kernel.set(grid_size=geometry.grid.size, pair_first=first, pair_count=count)
        kernel.run_list(count)
        material_pass.unbind(batch)

    def _resolve(
        self, voxels: Voxels, materials: MaterialSet, parts: _Parts, packed: np.ndarray, axes: np.ndarray
    ) -> None:
        gpu, slot = self.gpu, interface.slot
        items, axis_counts = cell_axes(axes)
        work = gpu.buffer("voxel work", items)
        positions = gpu.list_texture("voxel cell positions", len(packed), 1, "u4", packed)
        self._temporary += [work, positions]
        kernel = gpu.kernel("voxel_resolve", {"HAS_EMISSION": materials.has_emission})
        voxels.bind(kernel)
        kernel.set(work_count=len(items), axis_counts=axis_counts)
        positions.use(slot("TEX_CELL_POSITIONS"))
        parts.sums.use(slot("TEX_PARTS"))
        work.bind_to_storage_buffer(slot("BUF_WORK"))
        faces = voxels.faces
        faces.place.bind_to_image(slot("IMG_0"), read=False, write=True)
        faces.reflectance.bind_to_image(slot("IMG_1"), read=False, write=True)
        faces.order.bind_to_image(slot("IMG_2"), read=False, write=True)
        if faces.emission is not None and parts.emission is not None:
            parts.emission.use(slot("TEX_PART_EMISSION"))
            faces.emission.bind_to_image(slot("IMG_3"), read=False, write=True)
        kernel.run_list(len(items))
        gpu.barrier()  # injection and links read the faces

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
        cursors: moderngl.Buffer,
        cells: int,
    ) -> tuple[Voxels, np.ndarray]:
        """The voxels, still empty, and the axes that the surfaces of each cell face, bits 0 to 2."""
        gpu = self.gpu
        words = np.frombuffer(cursors.read(), np.uint32)[:cells]
        counts = words & ((1 << interface.CELL_COUNT_BITS) - 1)
        axes = words >> interface.CELL_COUNT_BITS
        face_counts = 2 * _POPCOUNT[axes]  # a surface has two sides
        ends, face_ends = np.cumsum(counts, dtype=np.uint32), np.cumsum(face_counts, dtype=np.uint32)
        pairs, faces = (int(ends[-1]), int(face_ends[-1])) if cells else (0, 0)
        records = np.empty((cells, 4), np.uint32)
        np.subtract(ends, counts, out=records[:, 0])
        records[:, 1] = counts
        np.subtract(face_ends, face_counts, out=records[:, 2])
        np.take(_FACINGS, axes, out=records[:, 3])
        if cells:
            cursors.write(np.ascontiguousarray(records[:, 0]))  # from here on: next list entry of each cell
        cell_texture = gpu.list_texture("cells", cells, 4, "u4", records)
        triangles = gpu.list_texture("cell triangles", pairs, 1, "u4")
        opacities = gpu.list_texture("cell opacities", pairs, 1, "f1") if materials.has_transparency else None
        textures = Faces(
            faces,
            gpu.list_texture("faces", faces, 4, "u4"),
            gpu.list_texture("faces", faces, 4, "nu2"),
            gpu.list_texture("face emission", faces, 4, "f4") if materials.has_emission else None,
            gpu.list_texture("faces", faces, 1, "u4"),
        )
        self._owned += [
            cell_texture, triangles, opacities, textures.place, textures.reflectance, textures.emission,
            textures.order,
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
        return voxels, axes

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self._owned, *self._temporary)
        self._owned, self._temporary = [], []
        self.voxels = None
