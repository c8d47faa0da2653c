# SPDX-License-Identifier: GPL-3.0-or-later
"""Light passed between voxel faces: links once for a geometry, then bounces that trace nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext
from ..settings import Settings
from .voxelize import Voxels
from .world import WorldLight

FACES_PER_STEP = 1 << 14
#: Bounces between two looks at how much has changed, and the change at which they stop.
CHECK_EVERY = 4
CONVERGED = 1e-3


class LinkPass:
    """Which faces each face sees."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.links: moderngl.Texture | None = None
        self.sky: moderngl.Texture | None = None
        self.count = 0

    def run(self, voxels: Voxels, world: WorldLight, settings: Settings) -> Iterator[float]:
        """Trace the links. Yields the share done. Raises MemoryError when there are too many for a texture."""
        self.release()
        gpu, slot = self.gpu, interface.slot
        self.count = -(-settings.bounce_rays // 4) * 4  # four to a texel
        links = gpu.list_texture("links", voxels.faces.count * self.count // 4, 4, "u4")
        self.links = links
        if world.is_lit:
            self.sky = gpu.list_texture("sky light of faces", voxels.faces.count, 4, "f4")
        kernel = gpu.kernel("link", voxels.trace_defines | world.defines)
        for first in range(0, voxels.faces.count, FACES_PER_STEP):
            with gpu.timed("link"):
                voxels.bind(kernel)
                world.bind(kernel)
                voxels.faces.bind()
                links.bind_to_image(slot("IMG_0"), read=False, write=True)
                if self.sky is not None:
                    self.sky.bind_to_image(slot("IMG_1"), read=False, write=True)
                kernel.set(
                    face_first=first, face_count=voxels.faces.count, link_count=self.count, random_seed=settings.seed
                )
                kernel.run_list(min(FACES_PER_STEP, voxels.faces.count - first))
            yield min(1.0, (first + FACES_PER_STEP) / voxels.faces.count)
        gpu.barrier()  # bounces read links and sky

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.links, self.sky)
        self.links = self.sky = None


class BouncePass:
    """Owns the radiance of all faces: two textures that take turns."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.radiance: list[Any] = []
        self.direct: Any = None
        self.bounces = 0

    def allocate(self, voxels: Voxels) -> None:
        """Make room for the radiance of all faces."""
        self.release()
        self.radiance = [self.gpu.list_texture("face radiance", voxels.faces.count, 4, "f4") for _ in range(2)]
        self.direct = self.gpu.list_texture("face direct light", voxels.faces.count, 4, "f4")

    def run(self, voxels: Voxels, links: LinkPass, settings: Settings) -> Iterator[float]:
        """Bounce until the settings' limit or until nothing changes any more. Yields the share of the limit done."""
        gpu, slot = self.gpu, interface.slot
        assert links.links is not None
        kernel = gpu.kernel("bounce", {"HAS_WORLD": links.sky is not None})
        self.bounces = 0
        before = None
        while self.bounces < settings.bounces:
            with gpu.timed("bounce"):
                source, target = self.radiance
                source.use(slot("TEX_FACE_RADIANCE"))
                voxels.faces.bind()
                self.direct.use(slot("TEX_FACE_DIRECT"))
                links.links.use(slot("TEX_LINKS"))
                target.bind_to_image(slot("IMG_0"), read=False, write=True)
                if links.sky is not None:
                    links.sky.use(slot("TEX_WORLD"))
                kernel.set(face_count=voxels.faces.count, link_count=links.count)
                kernel.run_list(voxels.faces.count)
                gpu.barrier()  # the next bounce reads what this one wrote
                self.radiance.reverse()
                self.bounces += 1
                if self.bounces % CHECK_EVERY == 0 and self.bounces < settings.bounces:
                    values = np.frombuffer(self.radiance[0].read(), np.float32)[: 4 * voxels.faces.count]
                    after = float(values.sum(dtype=np.float64))  # what follows in the texture's last row is undefined
                    if before is not None and abs(after - before) <= CONVERGED * abs(after):
                        return
                    before = after
            yield self.bounces / settings.bounces

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self.radiance, self.direct)
        self.radiance, self.direct = [], None
