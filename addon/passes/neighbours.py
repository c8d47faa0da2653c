# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cells beside it are hidden from a cell: light of faces does not pass through walls between them."""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext
from .voxel_numbers import cell_axes, face_counts

if TYPE_CHECKING:
    from .voxelize import Voxels

#: Faces in one dispatch: bounds how long a step takes, so that cancelling is quick.
FACES_PER_STEP = 1 << 14

#: As alpha of a face's reflectance LEAST_WEIGHT is stored as less.
LEAST_ALPHA = int((interface.LEAST_WEIGHT / interface.MAX_FACE_WEIGHT) ** 0.5 * 65535) + 2


def calm_cells(bricks: np.ndarray, facings: np.ndarray) -> np.ndarray:
    """Cells on which nothing stands, nor on any of those around them: (N,) bool. From their faces no cell beside is
    hidden, unless one has less weight than LEAST_WEIGHT.

    ``bricks``: (z, y, x, 4) uint32, as lib/grid.glsl describes them; ``facings``: (N,) uint32, last words of the
    records of all cells.
    """
    masks = np.ascontiguousarray(bricks[..., :2]).view(np.uint64)[..., 0]
    filled = np.flatnonzero(masks)
    places = np.flatnonzero(np.unpackbits(masks.ravel()[filled].view(np.uint8), bitorder="little"))
    bits = np.uint64(1) << (places & 63).astype(np.uint64)
    axes = (facings | facings >> 6) & 63  # as is_plain() of pass neighbours does
    axes = (axes | axes >> 1) & 21
    is_plain = (axes & (axes - 1) == 0) & (facings & interface.CUT_BITS == 0)
    standing = np.where(is_plain, np.uint64(0), bits)
    around = np.zeros_like(masks)
    around.ravel()[filled] = np.bitwise_or.reduceat(standing, bricks.reshape(-1, 4)[filled, 2])
    for axis, step in enumerate((16, 4, 1)):
        around = _spread(around, axis, step)
    return around.ravel()[filled][places >> 6] & bits == 0


def _spread(masks: np.ndarray, axis: int, step: int) -> np.ndarray:
    """Cells marked in ``masks`` (z, y, x) uint64, and those beside them along an axis; ``step``: bits between these."""
    first = np.uint64(sum(1 << bit for bit in range(64) if bit // step % interface.BRICK == 0))
    last, one, three = first << np.uint64(3 * step), np.uint64(step), np.uint64(3 * step)
    result = masks | (masks & ~last) << one | (masks & ~first) >> one
    source, target = np.moveaxis(masks, axis, 0), np.moveaxis(result, axis, 0)
    target[1:] |= (source[:-1] & last) >> three  # of the bricks beside
    target[:-1] |= (source[1:] & first) << three
    return result


def _not_calm(voxels: Voxels, facings: np.ndarray) -> np.ndarray:
    """Cells from whose faces others may be hidden: (N,) bool."""
    bricks = np.frombuffer(voxels.bricks.read(), np.uint32).reshape(*voxels.grid.bricks[::-1], 4)
    weights = np.frombuffer(voxels.faces.reflectance.read(), np.uint16).reshape(-1, 4)[: voxels.faces.count, 3]
    found = ~calm_cells(bricks, facings)
    if len(weights):
        counts = face_counts(facings)
        firsts = (np.cumsum(counts, dtype=np.int64) - counts)[counts > 0]
        found[counts > 0] |= np.logical_or.reduceat(weights < LEAST_ALPHA, firsts)
    return found


def find_hidden(
    gpu: GpuContext, voxels: Voxels, positions: moderngl.Texture, facings: np.ndarray, asked: np.ndarray | None
) -> Generator[float, None, np.ndarray]:
    """Yields the share done. Returns (cells,) uint32: what pass neighbours says of each cell.

    ``positions``: of all cells, r32ui list; ``facings``: (cells,) uint32, last words of their records; ``asked``:
    (cells,) bool, those of which something is to be found out; None: of all.
    """
    with gpu.timed("neighbours"):
        if asked is None:
            asked = _not_calm(voxels, facings)
        pairs, _ = cell_axes(np.where(asked, facings, np.uint32(0)))
    if not len(pairs):
        return np.zeros(voxels.cell_count, np.uint32)
    slot = interface.slot
    count = 2 * len(pairs)
    hidden = gpu.buffer("hidden cells", size=4 * max(voxels.cell_count, 1))
    work = gpu.buffer("hidden cells", pairs)
    try:
        hidden.clear()
        kernel = gpu.kernel("neighbours", voxels.trace_defines)
        for first in range(0, count, FACES_PER_STEP):
            with gpu.timed("neighbours"):
                voxels.bind(kernel)
                voxels.faces.bind()
                gpu.use_source(positions, "TEX_CELL_POSITIONS")
                hidden.bind_to_storage_buffer(slot("BUF_RESULTS"))
                work.bind_to_storage_buffer(slot("BUF_WORK"))
                kernel.set(work_first=first, work_count=count)
                kernel.run_list(min(FACES_PER_STEP, count - first))
            yield min(1.0, (first + FACES_PER_STEP) / count)
        gpu.barrier()  # read back
        return np.frombuffer(hidden.read(), np.uint32)[: voxels.cell_count]
    finally:
        gpu.free(hidden, work)
