# SPDX-License-Identifier: GPL-3.0-or-later
"""Long lists of triangles are ordered along a Morton curve through their cell, and get boxes over runs of them.

Rays then ask few of many triangles (lib/cell_list.glsl), and meet the same ones: what they meet does not depend on the
order of a list. Where few lists are long, none has boxes: asking for them takes longer than they spare.

Morton 1966, "A Computer Oriented Geodetic Data Base"; Karras 2012, "Maximizing Parallelism in the Construction of BVHs,
Octrees, and k-d Trees", differs: boxes are over runs of even length, so that the tree needs no links.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from .geometry import Geometry

if TYPE_CHECKING:
    from .voxelize import Lists

#: Share of all entries that long lists have where boxes are worth their while. As measured, rays take as long with them
#: at a share of 0.3, and half as long at 0.9.
LEAST_SHARE = 0.5
#: Entries of the longest list that rays may ask one by one: a thread that follows sixteen rays through such cells stays
#: below the 65536 rounds after which software rasterizers end its loops.
LONGEST = 256
#: Entries of lists that are worked on in one step, and those of short lists between them, but for a longer list.
ENTRIES_PER_STEP = 1 << 19


def are_boxed(counts: np.ndarray) -> bool:
    """Whether lists of ``counts`` (N,) triangles have boxes."""
    long = counts[counts > interface.LONG_LIST]
    return bool((long > LONGEST).any()) or int(long.sum(dtype=np.int64)) > LEAST_SHARE * int(counts.sum(dtype=np.int64))


def box_room(entries: int) -> int:
    """Boxes that there is room for, in lists of so many entries together."""
    return entries * interface.BOXES_PER_16 // 16


def box_levels(count: int) -> list[int]:
    """Boxes on each level over a list of ``count`` entries, the runs first."""
    levels = [-(-count // interface.BOX_RUN)]
    while levels[-1] > 1:
        levels.append(-(-levels[-1] // interface.BOX_FAN))
    return levels


def ranges(firsts: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """(sum of counts,) int64: the numbers from each of ``firsts`` on, as many as its entry of ``counts`` (N,) says."""
    before = np.cumsum(counts) - counts
    return np.arange(int(counts.sum()), dtype=np.int64) + np.repeat(firsts - before, counts)


def curve_order(keys: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(N,) int64, numbers of entries in their order: cell by cell, in a cell by ``keys`` (N,) uint32 of 30 bits.

    ``cells``: (N,) which cell, ascending. Entries with equal keys stay in their order.
    """
    number = np.cumsum(np.diff(cells, prepend=cells[:1]) != 0).astype(np.uint64)
    place_bits, cell_bits = max(len(keys) - 1, 1).bit_length(), max(int(number[-1]), 1).bit_length()
    key_bits = min(30, 64 - place_bits - cell_bits)
    words = number << np.uint64(64 - cell_bits)
    words |= (keys >> np.uint32(30 - key_bits)).astype(np.uint64) << np.uint64(place_bits)
    words |= np.arange(len(keys), dtype=np.uint64)
    words.sort()  # numbers of entries are in them: quicker than to ask for the order
    return (words & np.uint64((1 << place_bits) - 1)).astype(np.int64)


def _span(records: np.ndarray, cells: np.ndarray) -> tuple[int, int]:
    """First entry of the lists of ``cells`` (ascending), and entries of a texture with room for all from there to the
    last, which lie in its rows as in theirs."""
    if not len(cells):
        return 0, 0
    first, last = int(records[cells[0], 0]), int(records[cells[-1], 0]) + int(records[cells[-1], 1])
    return first, last - first + first % interface.LIST_WIDTH


class LongLists:
    """Orders and boxes the lists of one scene's cells."""

    def __init__(
        self, gpu: GpuContext, geometry: Geometry, lists: Lists, positions: moderngl.Texture, box_first: int
    ) -> None:
        """``positions``: of cells. ``box_first``: entry of the cells' texture where boxes begin."""
        self.gpu, self._geometry, self._lists, self._positions = gpu, geometry, lists, positions
        self._box_first = box_first
        self._copies: list[moderngl.Texture | None] = []

    def run(self, unordered: np.ndarray) -> Iterator[float]:
        """Order the lists of those cells that ``unordered`` (N,) bool names, and make the boxes of all long ones.

        Yields the share done.
        """
        gpu, lists = self.gpu, self._lists
        counts = lists.records[:, 1].astype(np.int64)
        cells = np.flatnonzero(counts > interface.LONG_LIST)
        starts = lists.records[cells, 0].astype(np.int64)
        ends = starts + counts[cells]
        parts, first = [], 0
        while first < len(cells):
            end = max(int(np.searchsorted(ends, starts[first] + ENTRIES_PER_STEP, "right")), first + 1)
            parts.append(cells[first:end])
            first = end
        try:
            with gpu.timed("voxelize"):
                room = max((_span(lists.records, part[unordered[part]])[1] for part in parts), default=0)
                for texture in self._written if room else ():
                    made = texture and gpu.list_texture("voxel work", room, texture.components, texture.dtype)
                    self._copies.append(made)
            for number, part in enumerate(parts):
                with gpu.timed("voxelize"):
                    if unordered[part].any():
                        self._order(part[unordered[part]])
                    self._make_boxes(part)
                yield (number + 1) / len(parts)
        finally:
            gpu.free(*self._copies)
            self._copies = []

    @property
    def _written(self) -> tuple[moderngl.Texture | None, ...]:
        return self._lists.triangles, self._lists.parts, self._lists.opacities

    def _order(self, cells: np.ndarray) -> None:
        gpu, slot, lists = self.gpu, interface.slot, self._lists
        starts, counts = (lists.records[cells, column].astype(np.int64) for column in (0, 1))
        first, room = _span(lists.records, cells)
        keys = gpu.buffer("voxel work", size=4 * room)
        kernel = gpu.kernel("list_keys", self._geometry.defines | {"HAS_BOXES": True}).set(first_entry=first)
        keys.bind_to_storage_buffer(slot("BUF_RESULTS"))
        self._run(kernel, cells, -(-counts // interface.BOX_RUN))
        entries = ranges(starts, counts)
        order = curve_order(np.frombuffer(keys.read(), np.uint32)[entries - first], np.repeat(cells, counts))

        # Copies of the part of the lists that is put in order; they lie in their rows as the lists do.
        offset = first % interface.LIST_WIDTH
        for unit, name, texture, copy in zip(
            ("IMG_0", "IMG_1", "IMG_2"), ("TEX_CELL_TRIANGLES", "TEX_PARTS", "TEX_CELL_OPACITIES"), self._written,
            self._copies, strict=True,
        ):  # fmt: skip
            if texture is not None and copy is not None:
                gpu.copy_list(texture, copy, first, room - offset, offset)
                gpu.use_source(copy, name)
                texture.bind_to_image(slot(unit), read=False, write=True)
        moves = np.stack([entries, entries[order] - (first - offset)], axis=1)
        work = gpu.buffer("voxel work", moves.astype(np.uint32))
        defines = {"HAS_FACES": lists.parts is not None, **lists.opacity_defines}
        kernel = gpu.kernel("list_sort", self._geometry.defines | defines).set(work_count=len(entries))
        work.bind_to_storage_buffer(slot("BUF_WORK"))
        kernel.run_list(len(entries))
        gpu.barrier()  # all that follows reads the lists
        gpu.free(work, keys)

    def _make_boxes(self, cells: np.ndarray) -> None:
        gpu, slot, lists = self.gpu, interface.slot, self._lists
        kernel = gpu.kernel("list_boxes", self._geometry.defines | {"HAS_BOXES": True})
        kernel.set(box_first=self._box_first)
        lists.cells.bind_to_image(slot("IMG_0"), read=True, write=True)
        boxes = -(-lists.records[cells, 1].astype(np.int64) // interface.BOX_RUN)
        level = 0
        while len(cells):
            self._run(kernel.set(level=level), cells, boxes)
            cells, boxes, level = cells[boxes > 1], -(-boxes[boxes > 1] // interface.BOX_FAN), level + 1

    def _run(self, kernel: Kernel, cells: np.ndarray, counts: np.ndarray) -> None:
        """A thread for each of so many runs, or boxes, of the lists of ``cells``; what it writes can be read."""
        gpu, lists = self.gpu, self._lists
        numbers = np.stack([np.repeat(cells, counts), ranges(np.zeros(len(cells), np.int64), counts)], axis=1)
        work = gpu.buffer("voxel work", numbers.astype(np.uint32))
        work.bind_to_storage_buffer(interface.slot("BUF_WORK"))
        gpu.use_source(self._geometry.triangles, "TEX_TRIANGLES")
        gpu.use_source(self._positions, "TEX_CELL_POSITIONS")
        gpu.use_source(lists.triangles, "TEX_CELL_TRIANGLES")
        gpu.use_source(lists.cells, "TEX_CELLS")
        kernel.set(**self._geometry.grid.uniforms, work_count=len(numbers)).run_list(len(numbers))
        gpu.barrier()
        gpu.free(work)
