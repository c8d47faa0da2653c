# SPDX-License-Identifier: GPL-3.0-or-later
"""Links between voxel faces: which others each sees, found once for a geometry."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext
from ..links import link_count
from ..settings import Settings
from .emitters import FACE_SAMPLES, EmitterTable
from .face_changes import FaceChanges
from .voxelize import Voxels
from .world import FACE_SAMPLES as WORLD_SAMPLES
from .world import WorldLight

#: Rays in one dispatch: bounds how long a step takes, so that cancelling is quick.
RAYS_PER_STEP = 1 << 17
#: Links of a face in one dispatch: llvmpipe ends the loops of a work group after so many rounds that rays beyond this,
#: in cells with a thousand triangles, would bring nothing.
LINKS_PER_STEP = 16


class LinkPass:
    """Which faces each face sees, and the light that comes straight from the world and from emitters along the way."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.links: moderngl.Texture | None = None
        self.straight: moderngl.Texture | None = None
        self.count = 0
        self.linked = 0  # faces whose links were traced, of the last run

    def run(
        self,
        voxels: Voxels,
        world: WorldLight,
        emitters: EmitterTable,
        *,
        drawn: bool,
        world_drawn: bool,
        settings: Settings,
        changes: FaceChanges | None = None,
    ) -> Iterator[float]:
        """Trace the links. Yields the share done. Raises MemoryError when there are too many for a texture.

        ``drawn``, ``world_drawn``: pass inject draws points on emitters and directions of the world too. ``changes``:
        what a scene that is the same but for an edit keeps of the links there are; None: nothing.
        """
        gpu, slot = self.gpu, interface.slot
        if voxels.faces.count >= 1 << interface.LINK_BIN_SHIFT:
            raise MemoryError(
                f"{voxels.faces.count} voxel faces are more than links can tell apart: lower the voxel resolution"
            )
        count = link_count(settings.bounce_rays, voxels.faces.count)
        brings_light = world.is_lit or emitters.count > 0
        if count != self.count or (self.straight is not None) != brings_light:
            changes = None  # links before were others, or brought other things
        before = (self.links, self.straight) if changes else (None, None)
        if not changes:
            self.release()
        self.count = count
        links = gpu.list_texture("links", voxels.faces.count * self.count // 4, 4, "u4")
        self.links = links
        if brings_light:
            self.straight = gpu.list_texture("straight light of faces", voxels.faces.count, 2, "u4")
        count = voxels.faces.count
        try:
            if changes:
                yield from self._keep(voxels, changes, before, settings)
                count = changes.found()
        finally:
            gpu.free(*before)
        self.linked = count
        kernel = gpu.kernel(
            "link",
            voxels.site_defines | world.defines | {"HAS_EMITTERS": emitters.count > 0, "WORLD_IS_DRAWN": world_drawn},
        )
        step = max(interface.GROUP_SIZE, RAYS_PER_STEP // min(self.count, LINKS_PER_STEP))
        steps = [(first, link) for first in range(0, count, step) for link in range(0, self.count, LINKS_PER_STEP)]
        for number, (first, link) in enumerate(steps, 1):
            with gpu.timed("link"):
                voxels.bind(kernel)
                world.bind(kernel)
                if emitters.count:
                    emitters.bind(kernel, FACE_SAMPLES if drawn else 0)
                if world_drawn:
                    world.bind_drawn(kernel, WORLD_SAMPLES, table=False)
                voxels.faces.bind()
                voxels.faces.bind_sites()
                if changes:
                    changes.bind_list()
                links.bind_to_image(slot("IMG_0"), read=False, write=True)
                if self.straight is not None:
                    self.straight.bind_to_image(slot("IMG_1"), read=True, write=True)
                kernel.set(
                    site_first=first, face_count=count, link_count=self.count, link_first=link,
                    link_end=min(link + LINKS_PER_STEP, self.count), random_seed=settings.seed,
                )  # fmt: skip
                if link > 0:
                    gpu.barrier()  # light is added to that of the links before
                kernel.run_list(min(step, count - first))
            yield number / len(steps)
        gpu.barrier()  # bounces read links and light

    def _keep(
        self,
        voxels: Voxels,
        changes: FaceChanges,
        before: tuple[moderngl.Texture | None, moderngl.Texture | None],
        settings: Settings,
    ) -> Iterator[float]:
        """Take over what stays of links and straight light ``before``, and list the other faces."""
        gpu, slot, count = self.gpu, interface.slot, voxels.faces.count
        links, straight = before
        assert links is not None and self.links is not None
        kernel = gpu.kernel("link_keep", voxels.site_defines | {"HAS_STRAIGHT": straight is not None})
        changes.begin()
        step = max(interface.GROUP_SIZE, 4 * RAYS_PER_STEP // self.count)
        for first in range(0, count, step):
            with gpu.timed("link"):
                voxels.bind(kernel)
                voxels.faces.bind()
                voxels.faces.bind_sites()
                changes.bind(kernel, changes.reach)
                changes.bind_numbers_now(kernel)
                links.use(slot("TEX_LINKS"))
                self.links.bind_to_image(slot("IMG_0"), read=False, write=True)
                if straight is not None and self.straight is not None:
                    straight.use(slot("TEX_STRAIGHT_BEFORE"))
                    self.straight.bind_to_image(slot("IMG_2"), read=False, write=True)
                kernel.set(
                    site_first=first, face_count=count, link_count=self.count, random_seed=settings.seed
                )  # fmt: skip
                kernel.run_list(min(step, count - first))
            yield 0.0

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.links, self.straight)
        self.links = self.straight = None
