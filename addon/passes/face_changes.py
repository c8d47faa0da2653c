# SPDX-License-Identifier: GPL-3.0-or-later
"""Which faces an edit of the scene leaves as they are, for passes that take over what they know of these."""

from __future__ import annotations

import numpy as np

from ..edit import united
from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..scene import DoubleArray


def shifts_of_runs(numbers: np.ndarray) -> np.ndarray:
    """By how much numbers grow, modulo 2^32, for each run of NUMBER_RUN that all stay and all grow by as much.

    ``numbers``: (N,) uint32, what each number has become, NONE_INDEX where it is gone. Returns (runs,) uint32, NO_SHIFT
    for runs that differ. An edit shifts most numbers as it does their neighbours: so looked up, they stay in caches.
    """
    shifts: np.ndarray = numbers - np.arange(len(numbers), dtype=np.uint32)
    shifts[numbers == interface.NONE_INDEX] = interface.NO_SHIFT
    firsts = shifts[:: interface.NUMBER_RUN]
    is_alike = np.ones(len(firsts) * interface.NUMBER_RUN, bool)
    is_alike[: len(shifts)] = shifts == np.repeat(firsts, interface.NUMBER_RUN)[: len(shifts)]
    return np.where(is_alike.reshape(-1, interface.NUMBER_RUN).all(axis=1), firsts, np.uint32(interface.NO_SHIFT))


class FaceChanges:
    """Numbers of faces before and after an edit, and a list of those that a pass finds to be changed."""

    def __init__(
        self, gpu: GpuContext, numbers_before: np.ndarray, count_before: int, boxes: DoubleArray, reach: DoubleArray
    ) -> None:
        """``numbers_before``: (faces,) uint32, NONE_INDEX for new ones. ``boxes``, ``reach``: (up to CHANGED_BOXES, 2,
        3) cells: rays that cross none of ``boxes`` meet what they met; ends of rays outside ``reach`` find the faces
        that they found."""
        self.gpu = gpu
        self.boxes, self.reach = boxes, reach
        count = len(numbers_before)
        stays = np.flatnonzero(numbers_before != interface.NONE_INDEX)
        now = np.full(count_before, interface.NONE_INDEX, np.uint32)
        now[numbers_before[stays]] = stays
        runs = shifts_of_runs(now)
        self._run_count = len(runs)
        self._before = gpu.list_texture("face changes", count, 1, "u4", numbers_before)
        self._now = gpu.buffer("face changes", np.concatenate([runs, now]))
        self._changed = gpu.list_texture("face changes", count, 1, "u4")
        self._counter = gpu.buffer("face changes", size=4)

    def begin(self) -> None:
        """Begin a new list."""
        self._counter.clear()

    def bind(self, kernel: Kernel, boxes: DoubleArray) -> None:
        """Bind what lib/changed_faces.glsl reads and writes. ``boxes``: whichever decide."""
        slot = interface.slot
        self._before.use(slot("TEX_NUMBERS_BEFORE"))
        self._changed.bind_to_image(slot("IMG_1"), read=False, write=True)
        self._counter.bind_to_storage_buffer(slot("BUF_COUNTS"))
        self.bind_boxes(kernel, boxes)

    def bind_numbers_now(self, kernel: Kernel) -> None:
        """Bind what tells the numbers that faces have become."""
        self._now.bind_to_storage_buffer(interface.slot("BUF_NUMBERS_NOW"))
        kernel.set(run_count=self._run_count)

    def bind_boxes(self, kernel: Kernel, boxes: DoubleArray) -> None:
        """Bind what lib/changed_boxes.glsl reads."""
        padded = np.zeros((interface.CHANGED_BOXES, 2, 3))
        padded[: len(boxes)] = boxes
        hull = united(boxes, 1) if len(boxes) else padded[:1]
        kernel.set(hull_low=hull[0, 0].tolist(), hull_high=hull[0, 1].tolist())
        kernel.set(box_low=padded[:, 0].tolist(), box_high=padded[:, 1].tolist(), box_count=len(boxes))

    def bind_list(self) -> None:
        """Bind the list in place of all faces (lib/site.glsl)."""
        self._changed.use(interface.slot("TEX_FACE_ORDER"))

    def found(self) -> int:
        """How many faces are listed."""
        self.gpu.barrier()  # read back; the list is read as a texture
        return int(np.frombuffer(self._counter.read(4), np.uint32)[0])

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self._before, self._now, self._changed, self._counter)
