# SPDX-License-Identifier: GPL-3.0-or-later
"""Which faces side by side share light: kept where somebody edits the scene, so that other light traces nothing."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext
from .face_changes import FaceChanges
from .voxelize import Voxels

#: Rays in one dispatch: bounds how long a step takes, so that cancelling is quick.
RAYS_PER_STEP = 1 << 17
#: Faces that each asks for their light, by a short ray.
NEIGHBOURS = 8


class NeighbourPass:
    """Owns eight bits for each face."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.sharing: moderngl.Texture | None = None  # r8ui list

    def run(self, voxels: Voxels, changes: FaceChanges | None = None) -> Iterator[float]:
        """Find neighbours. Yields the share done. ``changes``: what an edit leaves of those known; None: nothing."""
        before = self.sharing if changes else None
        if before is None:
            self.release()
            changes = None
        count = voxels.faces.count
        self.sharing = self.gpu.list_texture("face neighbours", count, 1, "u1")
        try:
            if changes:
                changes.begin()
                yield from self._steps(voxels, count, changes, before)
                count = changes.found()
            yield from self._steps(voxels, count, changes, None)
        finally:
            self.gpu.free(before)
        self.gpu.barrier()  # read as a texture

    def _steps(
        self, voxels: Voxels, count: int, changes: FaceChanges | None, before: moderngl.Texture | None
    ) -> Iterator[float]:
        slot = interface.slot
        assert self.sharing is not None
        defines = {"FINDS_CHANGED": before is not None, "IS_PART": changes is not None}
        kernel = self.gpu.kernel("neighbours", voxels.trace_defines | defines)
        step = max(interface.GROUP_SIZE, RAYS_PER_STEP // NEIGHBOURS) << (3 if before is not None else 0)
        for first in range(0, count, step):
            with self.gpu.timed("neighbours"):
                voxels.bind(kernel)
                voxels.faces.bind()
                if changes and before is not None:
                    changes.bind(kernel, changes.reach)
                    before.use(slot("TEX_NEIGHBOURS"))
                elif changes:
                    changes.bind_list()
                self.sharing.bind_to_image(slot("IMG_0"), read=False, write=True)
                kernel.set(face_first=first, face_count=count)
                kernel.run_list(min(step, count - first))
            yield min(1.0, (first + step) / count)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.sharing)
        self.sharing = None
