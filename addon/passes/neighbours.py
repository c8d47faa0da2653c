# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cells beside it are hidden from a cell: light of faces does not pass through walls between them."""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext

if TYPE_CHECKING:
    from .voxelize import Voxels

#: Faces in one dispatch: bounds how long a step takes, so that cancelling is quick.
FACES_PER_STEP = 1 << 14


def find_hidden(
    gpu: GpuContext, voxels: Voxels, positions: moderngl.Texture, pairs: np.ndarray
) -> Generator[float, None, np.ndarray]:
    """Yields the share done. Returns (cells,) uint32: what pass neighbours says of each cell.

    ``positions``: of all cells, r32ui list. ``pairs``: (N,) uint32, of faces, as ``cell_axes`` lists them; nothing is
    found out of the others.
    """
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
                positions.use(slot("TEX_CELL_POSITIONS"))
                hidden.bind_to_storage_buffer(slot("BUF_RESULTS"))
                work.bind_to_storage_buffer(slot("BUF_WORK"))
                kernel.set(work_first=first, work_count=count)
                kernel.run_list(min(FACES_PER_STEP, count - first))
            yield min(1.0, (first + FACES_PER_STEP) / count)
        gpu.barrier()  # read back
        return np.frombuffer(hidden.read(), np.uint32)[: voxels.cell_count]
    finally:
        gpu.free(hidden, work)
