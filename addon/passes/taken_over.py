# SPDX-License-Identifier: GPL-3.0-or-later
"""What voxels take over from those before, where the scene has changed in a few bricks only.

Cells are numbered brick by brick, and lists and faces follow the cells: what stays lies in long runs that only move.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ..edit import around_bricks, bricks_beside
from ..gpu import interface
from ..gpu.context import GpuContext
from .voxel_numbers import face_counts, hidden_cells, popcount, runs, with_hidden_cells

if TYPE_CHECKING:
    from .voxelize import Faces, Lists, Voxels


class TakenOver:
    """Voxels before, and which bricks are made again."""

    def __init__(self, voxels: Voxels, changed: np.ndarray) -> None:
        """``changed``: (z, y, x) bool, bricks that are made again."""
        self.voxels = voxels
        self.changed = changed.ravel()
        self._grown = bricks_beside(changed, voxels.grid).ravel()
        self.texture: moderngl.Texture3D | None = None  # r8ui: ``changed``
        self._bricks = np.frombuffer(voxels.bricks.read(), np.uint32).reshape(-1, 4)
        records = np.frombuffer(voxels.cells.read(), np.uint32).reshape(-1, 4)[: voxels.cell_count]
        self.records, self.hidden = with_hidden_cells(records, 0), hidden_cells(records)
        self._masks = np.ascontiguousarray(self._bricks[:, :2]).view(np.uint64).ravel()
        self._stayed = np.repeat(~self.changed, popcount(self._masks))  # of the cells before
        self.stays = np.zeros(0, bool)  # of the cells now
        self.is_beside = np.zeros(0, bool)  # of the cells now: they may see what has changed, or have changed
        #: A box around all that is made again (2, 3), grid space.
        self.box = around_bricks(changed, voxels.grid)

    @property
    def marks(self) -> np.ndarray:
        """(B,) uint64: bits of occupied cells in bricks that stay."""
        return np.where(self.changed, np.uint64(0), self._masks)

    def bind(self) -> None:
        """Bind what lib/changed_bricks.glsl reads."""
        assert self.texture is not None
        self.texture.use(interface.slot("TEX_CHANGED_BRICKS"))

    def leaps(self, occupied: np.ndarray, counts: np.ndarray) -> np.ndarray | None:
        """(B,) uint32: last words of the bricks, if they are what they were; notes which cells stay.

        ``occupied``: (B,) bool, ``counts``: (B,) cells of bricks.
        """
        self.stays = np.repeat(~self.changed, counts)
        self.is_beside = np.repeat(self._grown, counts)
        return self._bricks[:, 3] if np.array_equal(occupied, self._masks != 0) else None

    def completed(self, values: np.ndarray, before: np.ndarray) -> np.ndarray:
        """``values`` of cells, with those of cells that stay, which are as ``before``."""
        result = values.copy()
        result[self.stays] = before[self._stayed]
        return result

    def copy_lists(self, gpu: GpuContext, lists: Lists) -> None:
        """What cells that stay list."""
        old, new = self.records[self._stayed], lists.records[self.stays]
        pairs = [(self.voxels.cell_triangles, lists.triangles)]
        if self.voxels.cell_opacities is not None and lists.opacities is not None:
            pairs.append((self.voxels.cell_opacities, lists.opacities))
        _copy(gpu, runs(old[:, 0], new[:, 0], old[:, 1]), pairs)

    def copy_faces(self, gpu: GpuContext, records: np.ndarray, faces: Faces) -> np.ndarray:
        """Faces of cells that stay. ``records``: (N, 4) uint32, of the cells now.

        Returns (faces,) uint32: the number that each face had before; NONE_INDEX: it is new.
        """
        before = self.voxels.faces
        pairs = [(before.place, faces.place), (before.reflectance, faces.reflectance)]
        if before.shading is not None and faces.shading is not None:
            pairs.append((before.shading, faces.shading))
        old = self.records[self._stayed]
        found = runs(old[:, 2], records[self.stays, 2], face_counts(old[:, 3]))
        _copy(gpu, found, pairs)
        numbers = np.full(faces.count, interface.NONE_INDEX, np.uint32)
        for first, target, length in found:
            numbers[target : target + length] = np.arange(first, first + length, dtype=np.uint32)
        return numbers


def _copy(
    gpu: GpuContext, found: list[tuple[int, int, int]], pairs: list[tuple[moderngl.Texture, moderngl.Texture]]
) -> None:
    for source, target in pairs:
        for first, target_first, count in found:
            gpu.copy_list(source, target, first, count, target_first)
