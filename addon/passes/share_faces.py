# SPDX-License-Identifier: GPL-3.0-or-later
"""Indirect light of voxel faces, shared between those side by side."""

from __future__ import annotations

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext
from .voxelize import Voxels


class SharePass:
    """Knows with whom each face shares light, if somebody edits the scene: that depends on geometry alone."""

    def __init__(self, gpu: GpuContext, *, keeps_partners: bool) -> None:
        """``keeps_partners``: for the next time, in 4 bytes for each face."""
        self.gpu = gpu
        self._keeps_partners = keeps_partners
        self._partners: moderngl.Texture | None = None
        self._unknown: np.ndarray | None = None  # (N,) uint32: whose partners are still to be found; None: of all

    def renumber(self, numbers_before: np.ndarray | None, is_beside: np.ndarray | None) -> None:
        """Faces have other numbers. ``numbers_before``: (faces,) uint32, NONE_INDEX for new ones; ``is_beside``:
        (faces,) bool, there may be new ones beside, or they are new; None: nothing is kept."""
        if numbers_before is None or is_beside is None or self._partners is None or self._unknown is None:
            self.release()
            return
        with self.gpu.timed("share faces"):
            stored = np.frombuffer(self._partners.read(), np.uint32)
            was_unknown = np.zeros(len(stored), bool)
            was_unknown[self._unknown] = True  # light has not got so far since
            self.gpu.free(self._partners)
            self._partners = None
            before = np.where(is_beside, 0, numbers_before)
            self._partners = self.gpu.list_texture("partners of faces", len(before), 1, "u4", stored[before])
            self._unknown = np.flatnonzero(is_beside | was_unknown[before]).astype(np.uint32)

    def run(
        self,
        voxels: Voxels,
        indirect: moderngl.Texture,
        irradiance: moderngl.Texture | None,
        radiance: moderngl.Texture,
    ) -> None:
        """Fill in the ``radiance`` that faces send, of the ``indirect`` light that they receive, and ``irradiance``
        straight from lights; None: there is none."""
        gpu, slot, count = self.gpu, interface.slot, voxels.faces.count
        with gpu.timed("share faces"):
            partners = self._find_partners(voxels)
            kernel = gpu.kernel("share_faces", voxels.trace_defines | {"HAS_INJECTED": irradiance is not None})
            voxels.bind_cells(kernel)
            voxels.faces.bind()
            if irradiance is not None:
                irradiance.use(slot("TEX_FACE_IRRADIANCE"))
            partners.use(slot("TEX_PARTNERS"))
            indirect.use(slot("TEX_FACE_RADIANCE"))
            radiance.bind_to_image(slot("IMG_0"), read=False, write=True)
            kernel.set(face_count=count)
            kernel.run_list(count)
            gpu.barrier()  # the gather reads it
            if not self._keeps_partners:
                self.release()

    def _find_partners(self, voxels: Voxels) -> moderngl.Texture:
        gpu, slot, unknown = self.gpu, interface.slot, self._unknown
        if self._partners is None:
            self._partners = gpu.list_texture("partners of faces", voxels.faces.count, 1, "u4")
            unknown = self._unknown = None
        count = voxels.faces.count if unknown is None else len(unknown)
        if count:
            asked = gpu.buffer("partners of faces", np.zeros(1, np.uint32) if unknown is None else unknown)
            try:
                kernel = gpu.kernel("partners", voxels.trace_defines)
                voxels.bind(kernel)
                voxels.faces.bind()
                asked.bind_to_storage_buffer(slot("BUF_WORK"))
                self._partners.bind_to_image(slot("IMG_0"), read=False, write=True)
                kernel.set(work_count=count, asks_all=unknown is None)
                kernel.run_list(count)
                gpu.barrier()  # read as a texture
            finally:
                gpu.free(asked)
        self._unknown = np.zeros(0, np.uint32)
        return self._partners

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self._partners)
        self._partners = self._unknown = None
