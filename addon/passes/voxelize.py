# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact, order-independent voxelization into six faces, stored for occupied cells only.

Every pair of a triangle and a cell it enters is written down, and the cell marked, one bit each, in bricks of 4x4x4.
The cells are numbered, their triangles counted, and the pairs listed cell by cell (rays are exact against the
triangles) with what they bring to a face: a surface belongs to the face that its normal is nearest to. Cells in which
surfaces see different parts of space are cut in two, with faces on both sides. In the end each face sums up its parts.
Overlaps are exact (lib/overlap.glsl), so no cell is missed, and all sums are integers, so the same scene gives the same
bits on every run.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..grid import VoxelGrid
from ..scene import RayVisibility
from .geometry import Geometry
from .long_lists import LongLists, are_boxed, box_room
from .materials import Batch, MaterialPass, MaterialSet
from .neighbours import find_hidden
from .taken_over import TakenOver
from .voxel_numbers import (
    alike,
    cell_axes,
    cell_positions,
    cell_records,
    empty_octants,
    face_counts,
    level_octants,
    number_faces,
    popcount,
    with_hidden_cells,
)

#: Work items and pairs in one dispatch: bound how long a step takes, so that cancelling is quick.
ITEMS_PER_STEP = 1 << 17
PAIRS_PER_STEP = 1 << 18
#: One pair in so many more than are expected has room: as triangles lie, they may enter some cells more.
SPARE_PAIRS = 16

#: Faces stand for points spread evenly from block to block of cells. At least so many blocks lie along the longest
#: side; in a block rays start alike, which is quicker.
LINE_BLOCKS = 64


@dataclass
class Faces:
    """Voxel faces, as lib/face.glsl reads them: list textures, one entry a face."""

    count: int
    place: moderngl.Texture  # rgba32ui
    reflectance: moderngl.Texture  # rgba16, unsigned normalized: half floats would lose energy at each bounce
    order: moderngl.Texture  # r32ui: faces, alike ones next to each other, with their facings
    shading: moderngl.Texture | None  # r32ui: shading normals; None: all are the triangles'

    def bind(self) -> None:
        """Bind for reading."""
        slot = interface.slot
        self.place.use(slot("TEX_FACE_PLACE"))
        self.reflectance.use(slot("TEX_FACE_REFLECTANCE"))

    def bind_sites(self) -> None:
        """Bind what lib/site.glsl reads besides."""
        self.order.use(interface.slot("TEX_FACE_ORDER"))
        if self.shading is not None:
            self.shading.use(interface.slot("TEX_FACE_SHADING"))


@dataclass
class Voxels:
    """The sparse voxel grid, as lib/grid.glsl and lib/trace.glsl read it."""

    grid: VoxelGrid
    bricks: moderngl.Texture3D
    cells: moderngl.Texture
    cell_triangles: moderngl.Texture
    cell_opacities: moderngl.Texture | None
    lit_faces: Faces | None  # None: nothing asks for light of surfaces
    triangles: moderngl.Texture
    cell_count: int
    pair_count: int  # triangles, counted once for each cell they enter
    has_boxes: bool  # long lists of triangles do
    has_aslant_cuts: bool  # cells do that are cut by the planes of triangles

    @property
    def faces(self) -> Faces:
        """Of voxels that were made with them."""
        assert self.lit_faces is not None
        return self.lit_faces

    @property
    def trace_defines(self) -> dict[str, object]:
        return {
            **opacity_defines(self.cell_opacities),
            "HAS_INSTANCES": self.cell_triangles.components == 2,
            "HAS_BOXES": self.has_boxes,
            "HAS_ASLANT_CUTS": self.has_aslant_cuts,
            **self.grid.defines,
        }

    @property
    def site_defines(self) -> dict[str, object]:
        """For lib/site.glsl."""
        return self.trace_defines | {"HAS_SHADING_NORMALS": self.faces.shading is not None}

    def bind(self, kernel: Kernel) -> None:
        """Bind everything that tracing reads."""
        self.bind_cells(kernel)
        kernel.gpu.use_source(self.triangles, "TEX_TRIANGLES")
        kernel.gpu.use_source(self.cell_triangles, "TEX_CELL_TRIANGLES")
        if self.cell_opacities is not None:
            self.cell_opacities.use(interface.slot("TEX_CELL_OPACITIES"))
        if self.has_boxes:
            kernel.set(box_first=self.cell_count)

    def bind_cells(self, kernel: Kernel) -> None:
        """Bind what lib/grid.glsl reads, and records of cells."""
        kernel.gpu.use_source(self.bricks, "TEX_BRICKS")
        kernel.gpu.use_source(self.cells, "TEX_CELLS")
        kernel.set(**self.grid.uniforms)


def opacity_defines(opacities: moderngl.Texture | None) -> dict[str, object]:
    """For what reads or writes ``opacities`` of lists of triangles."""
    return {"HAS_OPACITY": opacities is not None, "HAS_OUTLINES": opacities is not None and opacities.components == 2}


@dataclass
class Lists:
    """What is listed cell by cell before there are faces: list textures."""

    records: np.ndarray  # (cells, 4) uint32
    cells: moderngl.Texture  # rgba32ui: records, and after them boxes
    has_boxes: bool  # of long lists
    cursors: moderngl.Buffer  # next list entry of each cell; in the end, last words of their records
    triangles: moderngl.Texture  # r32ui, or rg32ui: lib/triangle.glsl
    opacities: moderngl.Texture | None  # r8, or rg32ui: lib/outline.glsl
    parts: moderngl.Texture | None  # rgba32ui: what triangles bring to faces (lib/part.glsl)
    crowded: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))  # cells of more triangles than CROWD
    crowd_sums: moderngl.Buffer | None = None  # of them: lib/crowd.glsl

    @property
    def opacity_defines(self) -> dict[str, object]:
        """For what writes ``opacities``."""
        return opacity_defines(self.opacities)

    @property
    def has_aslant_cuts(self) -> bool:
        return bool((self.records[:, 3] & interface.CUT_IS_ASLANT).any())


class VoxelizePass:
    """Owns the voxels of one scene."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.voxels: Voxels | None = None
        #: Where a part was made again: (faces,) uint32, the number that each face had before; NONE_INDEX: it is new.
        self.numbers_before: np.ndarray | None = None
        #: And of these, which have new ones beside them, or may: (faces,) bool.
        self.is_beside: np.ndarray | None = None
        self.made = 0  # cells that were made, of the last run
        self._owned: list[Any] = []
        self._temporary: list[Any] = []

    @property
    def face_count(self) -> int:
        """Faces there are."""
        return self.voxels.faces.count if self.voxels is not None and self.voxels.lit_faces is not None else 0

    def run(
        self,
        geometry: Geometry,
        materials: MaterialSet,
        material_pass: MaterialPass,
        *,
        has_faces: bool,
        changed: np.ndarray | None = None,
        moved: bool = True,
    ) -> Iterator[float]:
        """Voxelize. Yields the share done; ``voxels`` is set at the end. ``has_faces``: surfaces get light.

        ``changed``: (z, y, x) bool, the bricks in which surfaces are not those that ``voxels`` were made of: they are
        made again, and the rest is taken over, which gives the same as making all; None: all. ``moved``: they do not
        only look different there.
        """
        self.numbers_before = self.is_beside = None
        if changed is None or not self._can_take_over(geometry, materials, has_faces):
            self.release()
            changed = None
        before = self._owned
        self._owned = []
        try:
            yield from self._steps(geometry, materials, material_pass, has_faces, changed, moved)
            self.gpu.free(*before)
            before = []
        finally:
            self.gpu.free(*self._temporary)
            self._temporary = []
            self._owned += before

    def bricks_with(self, marked: np.ndarray) -> np.ndarray:
        """(z, y, x) bool: bricks that marked triangles enter. ``marked``: bool for each triangle, or for each instance
        where these share triangles."""
        voxels = self.voxels
        assert voxels is not None
        width = voxels.cell_triangles.components
        listed = np.frombuffer(voxels.cell_triangles.read(), np.uint32).reshape(-1, width)[: voxels.pair_count, 0]
        records, brick_of_cell = self._cells()
        found = np.zeros(voxels.grid.bricks[::-1], bool)
        if len(records):
            found.ravel()[brick_of_cell[np.logical_or.reduceat(marked[listed], records[:, 0])]] = True
        return found

    def faces_in(self, bricks: np.ndarray) -> np.ndarray:
        """(faces,) bool: those of cells in ``bricks`` (z, y, x) bool."""
        records, brick_of_cell = self._cells()
        return np.repeat(bricks.ravel()[brick_of_cell], face_counts(records[:, 3]))

    def _cells(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 4) uint32, records of cells, and (N,) the numbers of their bricks."""
        voxels = self.voxels
        assert voxels is not None
        records = np.frombuffer(voxels.cells.read(), np.uint32).reshape(-1, 4)[: voxels.cell_count]
        bricks = np.frombuffer(voxels.bricks.read(), np.uint32).reshape(-1, 4)
        counts = popcount(np.ascontiguousarray(bricks[:, :2]).view(np.uint64).ravel())
        return records, np.repeat(np.arange(len(bricks)), counts)

    def _can_take_over(self, geometry: Geometry, materials: MaterialSet, has_faces: bool) -> bool:
        old = self.voxels
        return (
            old is not None
            and old.grid == geometry.grid
            and (old.cell_opacities is not None) == materials.lets_light_through
            and (old.cell_opacities is None or (old.cell_opacities.components == 2) == materials.has_cutouts)
            and (old.lit_faces is not None) == has_faces
            and (old.lit_faces is None or (old.lit_faces.shading is not None) == geometry.has_smooth_shading)
        )

    def _steps(
        self,
        geometry: Geometry,
        materials: MaterialSet,
        material_pass: MaterialPass,
        has_faces: bool,
        changed: np.ndarray | None,
        moved: bool,
    ) -> Iterator[float]:
        gpu, slot, grid = self.gpu, interface.slot, geometry.grid
        with gpu.timed("voxelize"):
            taken = self._taken_over(changed)
            mask = gpu.texture_3d(
                "voxel marks",
                (2 * grid.bricks[0], grid.bricks[1], grid.bricks[2]),
                1,
                "u4",
                taken.marks if taken else None,
            )
            self._temporary.append(mask)
            item_starts, capacity, work = self._work(geometry, materials, taken)
        yield 0.05

        pairs, starts = yield from self._list_pairs(geometry, item_starts, work, mask, taken, capacity)
        while starts[-1] > capacity:  # the estimate was too low: hardly ever
            capacity = starts[-1]
            gpu.free(pairs)
            pairs, starts = yield from self._list_pairs(geometry, item_starts, work, mask, taken, capacity)

        with gpu.timed("voxelize"):
            bricks, positions = self._number_cells(mask, grid, taken)
            gpu.free(mask, work)
            cursors = gpu.buffer("voxel counts", size=4 * len(positions))
            self._temporary.append(cursors)
            kernel = gpu.kernel("voxel_count", grid.defines).set(**grid.uniforms, pair_count=starts[-1])
            gpu.use_source(bricks, "TEX_BRICKS")
            gpu.use_source(pairs, "TEX_PAIRS")
            cursors.bind_to_storage_buffer(slot("BUF_COUNTS"))
            kernel.run_list(starts[-1])
            gpu.barrier()  # read back
            counts = np.frombuffer(cursors.read(), np.uint32)[: len(positions)]
            if taken:
                counts = taken.completed(counts, taken.records[:, 1])
            lists = self._allocate_lists(geometry, materials, counts, cursors, has_faces)
            if taken:
                taken.copy_lists(gpu, lists)
        yield 0.5

        batches: list[Batch | None] = [*materials.batches]
        if not has_faces and not materials.lets_light_through:
            batches, starts = [None], [0, starts[-1]]  # no material is asked
        for index, batch in enumerate(batches):
            for first in range(starts[index], starts[index + 1], PAIRS_PER_STEP):
                count = min(PAIRS_PER_STEP, starts[index + 1] - first)
                with gpu.timed("voxelize"):
                    kernel = self._accumulate_kernel(geometry, lists, material_pass, batch)
                    gpu.use_source(bricks, "TEX_BRICKS")
                    gpu.use_source(pairs, "TEX_PAIRS")
                    self._bind_lists(lists)
                    kernel.set(**grid.uniforms, pair_first=first, pair_count=count)
                    kernel.run_list(count)
                    if batch is not None:
                        material_pass.unbind(batch)
                yield 0.5 + 0.4 * (first + count) / starts[-1]

        with gpu.timed("voxelize"):
            gpu.barrier()  # the lists are complete
            gpu.free(pairs)
            faces = None
            if has_faces or lists.has_boxes:
                places = gpu.list_texture("voxel cell positions", len(positions), 1, "u4", positions)
                self._temporary.append(places)
        if lists.has_boxes:
            unordered = ~taken.stays if taken and self.voxels is not None and self.voxels.has_boxes else counts > 0
            for share in LongLists(gpu, geometry, lists, places, len(counts)).run(unordered):
                yield 0.9 + 0.05 * share
        with gpu.timed("voxelize"):
            if has_faces:
                self._cut_cells(geometry, lists, places, taken)
                faces = self._resolve(geometry, lists, places, taken)
        voxels = Voxels(
            grid,
            bricks,
            lists.cells,
            lists.triangles,
            lists.opacities,
            faces,
            geometry.triangles,
            cell_count=len(counts),
            pair_count=int(counts.sum()),
            has_boxes=lists.has_boxes,
            has_aslant_cuts=lists.has_aslant_cuts,
        )
        if has_faces:
            yield from self._hide_cells(voxels, lists, places, taken, moved)
        self.voxels = voxels
        self.made = len(counts) if taken is None else int((~taken.stays).sum())
        yield 1.0

    def _taken_over(self, changed: np.ndarray | None) -> TakenOver | None:
        if changed is None or self.voxels is None:
            return None
        taken = TakenOver(self.voxels, changed)
        size = (changed.shape[2], changed.shape[1], changed.shape[0])
        taken.texture = self.gpu.texture_3d("changed bricks", size, 1, "u1", changed.astype(np.uint8))
        self._temporary.append(taken.texture)
        return taken

    def _work(
        self, geometry: Geometry, materials: MaterialSet, taken: TakenOver | None
    ) -> tuple[list[int], int, moderngl.Texture]:
        """Where each batch's work items start (and the last ones end), about how many pairs there are, the items."""
        gpu, slot = self.gpu, interface.slot
        batches = len(materials.batches)
        counters = gpu.buffer("voxel counters", size=4 * (batches + 1))
        self._temporary.append(counters)

        def run(count: bool) -> None:
            kernel = gpu.kernel("work", geometry.defines | {"COUNT": count, "IS_PART": taken is not None})
            kernel.set(
                **geometry.grid.uniforms, triangle_count=geometry.triangle_count, ray_mask=int(RayVisibility.ALL),
                batch_count=batches,
            )  # fmt: skip
            if taken:
                taken.bind()
                kernel.set(part_low=taken.box[0].tolist(), part_high=taken.box[1].tolist())
            gpu.use_source(geometry.triangles, "TEX_TRIANGLES")
            materials.batch_table.bind_to_storage_buffer(slot("BUF_MATERIALS"))
            counters.bind_to_storage_buffer(slot("BUF_COUNTS"))
            kernel.run_list(geometry.triangle_count)
            gpu.barrier()  # counters are read back, work by later steps

        run(count=True)
        counts = np.frombuffer(counters.read(), np.uint32)[: batches + 1].tolist()
        starts = [0, *accumulate(counts[:batches])]
        counters.write(np.array(starts, np.uint32))
        work = gpu.list_texture("voxel work", starts[-1], 2, "u4")
        self._temporary.append(work)
        work.bind_to_image(slot("IMG_0"), read=False, write=True)
        run(count=False)
        return starts, counts[-1] + counts[-1] // SPARE_PAIRS + 64, work

    def _list_pairs(
        self,
        geometry: Geometry,
        item_starts: list[int],
        work: moderngl.Texture,
        mask: moderngl.Texture3D,
        taken: TakenOver | None,
        capacity: int,
    ) -> Generator[float, None, tuple[moderngl.Texture, list[int]]]:
        """Mark cells and list pairs. Returns the list, and where each batch's pairs start and the last ones end.

        The list holds no more than ``capacity``; what is beyond is counted all the same.
        """
        gpu, slot = self.gpu, interface.slot
        batches = len(item_starts) - 1
        with gpu.timed("voxelize"):
            pairs = gpu.list_texture("voxel pairs", capacity, 4, "u4")
            counters = gpu.buffer("voxel counters", size=4 * (batches + 1))
            self._temporary += [pairs, counters]
        for batch in range(batches):
            for first in range(item_starts[batch], item_starts[batch + 1], ITEMS_PER_STEP):
                count = min(ITEMS_PER_STEP, item_starts[batch + 1] - first)
                with gpu.timed("voxelize"):
                    kernel = gpu.kernel("voxel_pairs", geometry.defines | {"IS_PART": taken is not None})
                    kernel.set(**geometry.grid.uniforms, work_first=first, work_count=count)
                    kernel.set(batch=batch, pair_capacity=capacity)
                    if taken:
                        taken.bind()
                    gpu.use_source(geometry.triangles, "TEX_TRIANGLES")
                    gpu.use_source(work, "TEX_WORK")
                    counters.bind_to_storage_buffer(slot("BUF_COUNTS"))
                    mask.bind_to_image(slot("IMG_0"), read=True, write=True)
                    pairs.bind_to_image(slot("IMG_1"), read=False, write=True)
                    kernel.run_list(count)
                yield 0.05 + 0.4 * (first + count) / item_starts[-1]
            gpu.barrier()  # the next batch goes on where this one ends; in the end all is read
            gpu.mgl.copy_buffer(counters, counters, 4, read_offset=4 * batch, write_offset=4 * batch + 4)
        return pairs, [0, *np.frombuffer(counters.read(), np.uint32)[:batches].tolist()]

    def _number_cells(
        self, mask: moderngl.Texture3D, grid: VoxelGrid, taken: TakenOver | None
    ) -> tuple[moderngl.Texture3D, np.ndarray]:
        """The brick texture, and the packed positions of the occupied cells."""
        masks = np.frombuffer(mask.read(), np.uint64)
        counts = popcount(masks)
        shape = grid.bricks[::-1]
        texels = np.empty((len(masks), 4), np.uint32)
        texels[:, :2] = masks.view(np.uint32).reshape(-1, 2)
        texels[:, 2] = np.cumsum(counts) - counts
        leaps = taken.leaps(masks != 0, counts) if taken else None
        if leaps is None:
            occupied = (masks != 0).reshape(shape)
            leaps = (level_octants(occupied, grid.levels) if grid.levels else empty_octants(occupied)).ravel()
        texels[:, 3] = leaps
        bricks = self.gpu.texture_3d("bricks", grid.bricks, 4, "u4", texels)
        self._owned.append(bricks)
        return bricks, cell_positions(masks, grid.bricks, grid.position_bits)

    def _allocate_lists(
        self,
        geometry: Geometry,
        materials: MaterialSet,
        counts: np.ndarray,
        cursors: moderngl.Buffer,
        has_faces: bool,
    ) -> Lists:
        gpu = self.gpu
        records = cell_records(counts)
        pairs = int(counts.sum())
        has_boxes = are_boxed(counts)
        if len(records):
            cursors.write(np.ascontiguousarray(records[:, 0]))
        lists = Lists(
            records,
            gpu.list_texture("cells", len(records) + (box_room(pairs) if has_boxes else 0), 4, "u4", records),
            has_boxes,
            cursors,
            gpu.list_texture("cell triangles", pairs, 2 if geometry.has_instances else 1, "u4"),
            self._allocate_opacities(materials, pairs),
            gpu.list_texture("voxel parts", pairs, 4, "u4") if has_faces else None,
        )
        self._owned += [lists.cells, lists.triangles, lists.opacities]
        self._temporary.append(lists.parts)
        return lists

    def _allocate_opacities(self, materials: MaterialSet, pairs: int) -> moderngl.Texture | None:
        if not materials.lets_light_through:
            return None
        components, dtype = (2, "u4") if materials.has_cutouts else (1, "f1")
        return self.gpu.list_texture("cell opacities", pairs, components, dtype)

    def _accumulate_kernel(
        self, geometry: Geometry, lists: Lists, material_pass: MaterialPass, batch: Batch | None
    ) -> Kernel:
        """The program of a batch, with its materials bound; ``batch`` None: of all pairs, where none is asked."""
        if batch is None:
            geometry.bind_triangles(self.gpu)
            return self.gpu.kernel("voxel_list", geometry.defines)
        defines = geometry.defines | {
            "HAS_FACES": lists.parts is not None,
            **lists.opacity_defines,
            "VARIES": material_pass.family(batch).transparency_varies,
            "FLAT_SHADING": True,
        }
        kernel = self.gpu.kernel("voxel_accumulate", material_pass.defines(batch) | defines, material_pass.texts(batch))
        geometry.bind(kernel)
        material_pass.bind(batch, kernel)
        return kernel

    def _bind_lists(self, lists: Lists) -> None:
        """For writing."""
        slot = interface.slot
        lists.cursors.bind_to_storage_buffer(slot("BUF_COUNTS"))
        written = (lists.triangles, lists.parts, lists.opacities)
        for unit, texture in zip(("IMG_0", "IMG_1", "IMG_2"), written, strict=True):
            if texture is not None:
                texture.bind_to_image(slot(unit), read=False, write=True)

    def _cut_cells(
        self, geometry: Geometry, lists: Lists, positions: moderngl.Texture, taken: TakenOver | None
    ) -> None:
        """Find where cells are cut in two, number their faces, and complete the records."""
        gpu, slot = self.gpu, interface.slot
        count = len(lists.records)
        assert lists.parts is not None
        defines = geometry.defines | {"HAS_BOXES": False}
        geometry.bind_triangles(self.gpu)
        gpu.use_source(lists.cells, "TEX_CELLS")
        gpu.use_source(lists.triangles, "TEX_CELL_TRIANGLES")
        gpu.use_source(lists.parts, "TEX_PARTS")
        gpu.use_source(positions, "TEX_CELL_POSITIONS")
        lists.cursors.bind_to_storage_buffer(slot("BUF_COUNTS"))

        def words_after(kernel: Kernel, cells: np.ndarray) -> np.ndarray:
            """Last words of all records, once the kernel has found those of some cells."""
            cells = cells[alike(lists.records[cells, 1])]
            work = gpu.buffer("voxel work", cells)
            self._temporary.append(work)
            work.bind_to_storage_buffer(slot("BUF_WORK"))
            kernel.set(work_count=len(cells)).run_list(len(cells))
            gpu.barrier()  # read back
            return np.frombuffer(lists.cursors.read(), np.uint32)[:count]

        made = ~taken.stays if taken else np.ones(count, bool)
        is_crowded = lists.records[:, 1] > interface.CROWD
        cells = np.flatnonzero(made & ~is_crowded).astype(np.uint32)
        facings = words_after(gpu.kernel("voxel_walls", defines), cells)
        cells = cells[facings[cells] == interface.NONE_INDEX]
        if len(cells):
            defines |= {"HAS_ASLANT_CUTS": True, "IS_CROWDED": False, "CROWD_STEP": 0}
            facings = words_after(gpu.kernel("voxel_cut", defines).set(**geometry.grid.level_uniforms), cells)
        lists.crowded = np.flatnonzero(made & is_crowded)
        if len(lists.crowded):
            self._cut_crowded_cells(geometry, lists)
            facings = np.frombuffer(lists.cursors.read(), np.uint32)[:count]
        if taken:
            facings = taken.completed(facings, taken.records[:, 3])
        number_faces(lists.records, facings)
        gpu.free(lists.cursors)
        gpu.write_list(lists.cells, lists.records)

    def _cut_crowded_cells(self, geometry: Geometry, lists: Lists) -> None:
        """Those that have too many triangles for one thread. Everything is bound but their sums."""
        gpu = self.gpu
        lists.crowd_sums = gpu.buffer("voxel crowds", size=4 * interface.CROWD_WORDS * len(lists.crowded))
        lists.crowd_sums.bind_to_storage_buffer(interface.slot("BUF_RESULTS"))
        self._temporary.append(lists.crowd_sums)
        for step in range(4):
            defines: dict[str, object] = {"HAS_BOXES": False, "HAS_ASLANT_CUTS": False}
            defines |= {"IS_CROWDED": True, "CROWD_STEP": step}
            kernel = gpu.kernel("voxel_cut", geometry.defines | defines)
            for number, cell in enumerate(lists.crowded.tolist()):
                kernel.set(**geometry.grid.level_uniforms, crowd=number, crowd_cell=cell)
                kernel.run_list(-(-int(lists.records[cell, 1]) // interface.CROWD_RUN))
            gpu.barrier()  # each step reads sums of the one before

    def _resolve(self, geometry: Geometry, lists: Lists, positions: moderngl.Texture, taken: TakenOver | None) -> Faces:
        gpu, slot = self.gpu, interface.slot
        facings = lists.records[:, 3]
        items, axis_counts = cell_axes(facings)
        listed = gpu.buffer("voxel work", items)
        count = 2 * len(items)
        faces = Faces(
            count,
            gpu.list_texture("faces", count, 4, "u4"),
            gpu.list_texture("faces", count, 4, "nu2"),
            gpu.list_texture("faces", count, 1, "u4"),
            gpu.list_texture("faces", count, 1, "u4") if geometry.has_smooth_shading else None,
        )
        self._owned += [faces.place, faces.reflectance, faces.order, faces.shading]
        self._temporary.append(listed)

        kernel = gpu.kernel("face_order", geometry.grid.defines).set(work_count=len(items), axis_counts=axis_counts)
        gpu.use_source(lists.cells, "TEX_CELLS")
        listed.bind_to_storage_buffer(slot("BUF_WORK"))
        faces.order.bind_to_image(slot("IMG_0"), read=False, write=True)
        kernel.run_list(len(items))

        if taken:
            self.numbers_before = taken.copy_faces(gpu, lists.records, faces)
            self.is_beside = np.repeat(taken.is_beside, face_counts(facings))
            items, _ = cell_axes(np.where(taken.stays, np.uint32(0), facings))
        longest = max(max(level.size) for level in geometry.grid.parts)
        block = min(interface.BRICK, max(1, longest // LINE_BLOCKS))
        geometry.bind_triangles(self.gpu)
        gpu.use_source(lists.cells, "TEX_CELLS")
        gpu.use_source(lists.triangles, "TEX_CELL_TRIANGLES")
        assert lists.parts is not None
        gpu.use_source(lists.parts, "TEX_PARTS")
        gpu.use_source(positions, "TEX_CELL_POSITIONS")
        faces.place.bind_to_image(slot("IMG_0"), read=False, write=True)
        faces.reflectance.bind_to_image(slot("IMG_1"), read=False, write=True)
        if faces.shading is not None:
            faces.shading.bind_to_image(slot("IMG_2"), read=False, write=True)
        defines = geometry.defines | {"HAS_SHADING_NORMALS": faces.shading is not None, "HAS_BOXES": lists.has_boxes}
        defines["HAS_ASLANT_CUTS"] = lists.has_aslant_cuts

        plain: dict[str, object] = {"IS_PLAIN": True, "HAS_BOXES": False, "HAS_ASLANT_CUTS": False}

        def run(items: np.ndarray, *, is_plain: bool = False, **crowd: int) -> None:
            if len(items):
                items = items[alike(lists.records[items & 0x1FFFFFFF, 1])]
                work = gpu.buffer("voxel work", items)
                self._temporary.append(work)
                kinds = plain if is_plain else {"IS_PLAIN": False}
                kernel = gpu.kernel("voxel_resolve", defines | {"IS_CROWDED": bool(crowd)} | kinds)
                kernel.set(**geometry.grid.uniforms, work_count=len(items), line_block=block, **crowd)
                if lists.has_boxes:
                    kernel.set(box_first=len(lists.records))
                work.bind_to_storage_buffer(slot("BUF_WORK"))
                kernel.run_list(len(items))

        cells = items & 0x1FFFFFFF
        lengths = lists.records[cells, 1]
        are_plain = (facings[cells] & interface.CUT_BITS == 0) & (lengths <= interface.PLAIN_LIST)
        run(items[are_plain], is_plain=True)
        run(items[~are_plain & ~np.isin(cells, lists.crowded)] if len(lists.crowded) else items[~are_plain])
        if lists.crowd_sums is not None:
            lists.crowd_sums.bind_to_storage_buffer(slot("BUF_RESULTS"))
        for number, cell in enumerate(lists.crowded.tolist()):
            run(items[cells == cell], crowd=number)
        gpu.barrier()  # injection and links read the faces
        return faces

    def _hide_cells(
        self, voxels: Voxels, lists: Lists, positions: moderngl.Texture, taken: TakenOver | None, moved: bool
    ) -> Iterator[float]:
        """Complete the records."""
        if taken and not moved:
            self.gpu.write_list(lists.cells, with_hidden_cells(lists.records, taken.hidden))
            return
        asked = taken.is_beside if taken else None
        hidden = yield from find_hidden(self.gpu, voxels, positions, lists.records[:, 3], asked)
        if taken:
            before = taken.completed(hidden, taken.hidden)
            hidden = np.where(taken.is_beside, hidden, before)
        self.gpu.write_list(lists.cells, with_hidden_cells(lists.records, hidden))

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self._owned, *self._temporary)
        self._owned, self._temporary = [], []
        self.voxels = self.numbers_before = self.is_beside = None
