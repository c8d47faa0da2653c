# SPDX-License-Identifier: GPL-3.0-or-later
"""Light passed between voxel faces: links once for a geometry, then bounces that trace nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext
from ..links import link_count
from ..settings import Settings
from .emitters import FACE_SAMPLES, EmitterTable
from .face_changes import FaceChanges
from .share_faces import SharePass
from .voxelize import Voxels
from .world import FACE_SAMPLES as WORLD_SAMPLES
from .world import WorldLight

#: Rays in one dispatch: bounds how long a step takes, so that cancelling is quick.
RAYS_PER_STEP = 1 << 17
#: Links of a face in one dispatch: llvmpipe ends the loops of a work group after so many rounds that rays beyond this,
#: in cells with a thousand triangles, would bring nothing.
LINKS_PER_STEP = 16
#: Bounces end when what further ones would bring changes how bright faces look by less than this share, on average; it
#: is added at once.
CONVERGED = 2e-3
#: The same for a draft, which goes on from the light that was there before an edit.
DRAFT_CONVERGED = 1e-2
#: How many faces are asked how much they change, at most; all where none of these has light.
_ASKED = 1 << 16


def unpack_light(stored: np.ndarray) -> np.ndarray:
    """Light of faces as lib/packed_light.glsl stores it, (N, 2) uint32 -> (N, 3) float32."""
    low, high = stored[:, 0], stored[:, 1]
    whole = np.stack([low & 0x3FFFF, low >> 18 | (high & 15) << 14, high >> 4 & 0x3FFFF], axis=1)
    return np.ldexp(whole.astype(np.float32), (high >> 22).astype(np.int32)[:, None] - 144)


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


class BouncePass:
    """Owns the radiance of all faces: while light bounces, two textures that take turns."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.radiance: list[Any] = []
        self.bounces = 0

    def run(
        self,
        voxels: Voxels,
        irradiance: moderngl.Texture | None,
        links: LinkPass | None,
        share: SharePass,
        settings: Settings,
        *,
        goes_on: bool = False,
    ) -> Iterator[float]:
        """Bounce until the settings' limit or until nothing changes any more. Yields the share of the limit done.

        ``irradiance`` None: nothing was injected. ``links`` None: no bounces, only what was injected leaves the faces.
        ``goes_on``: from the radiance that is there, and only until little changes. Which one stays where this is not
        run to its end.
        """
        before, self.radiance = self.radiance, []
        is_done = False
        try:
            yield from self._steps(voxels, irradiance, links, share, settings, before[0] if goes_on else None)
            is_done = True
        finally:
            made = self.radiance
            self.radiance = made[:1] if is_done else before
            self.gpu.free(*(made[1:] + before if is_done else made))

    def renumber(self, numbers_before: np.ndarray | None) -> None:
        """Faces have other numbers. ``numbers_before``: (faces,) uint32, NONE_INDEX for new ones, which are dark; None:
        nothing is kept."""
        if numbers_before is None or not self.radiance:
            self.release()
            return
        with self.gpu.timed("bounce"):
            (radiance,) = self.radiance
            stored = np.frombuffer(radiance.read(), np.uint32).reshape(-1, 2)
            is_new = numbers_before == interface.NONE_INDEX
            moved = np.where(is_new[:, None], np.uint32(0), stored[np.where(is_new, 0, numbers_before)])
            self.release()
            self.radiance = [self.gpu.list_texture("face radiance", len(moved), 2, "u4", moved)]

    def _steps(
        self,
        voxels: Voxels,
        irradiance: moderngl.Texture | None,
        links: LinkPass | None,
        share: SharePass,
        settings: Settings,
        before: moderngl.Texture | None,
    ) -> Iterator[float]:
        """``before``: radiance to go on from."""
        textures = 2 if links else 1
        self.radiance = [self.gpu.list_texture("face radiance", voxels.faces.count, 2, "u4") for _ in range(textures)]
        self.bounces = 0
        change = 0.0  # by the last bounce
        if before is None:
            self._pass(voxels, irradiance, links, first=True)
        else:
            self.gpu.copy(before, self.radiance[0])
        first, converged = (2, CONVERGED) if before is None else (1, DRAFT_CONVERGED)  # bounce that is looked at
        while links and self.bounces < settings.bounces:
            self.radiance.reverse()
            self._pass(voxels, irradiance, links)
            self.bounces += 1
            if first <= self.bounces < settings.bounces:
                change_before, change = change, self._change(voxels.faces.count)
                rest = change / (change_before - change) if change < change_before else math.inf  # of such bounces
                if change == 0.0 or change * rest <= converged:
                    self._add_rest(voxels, rest if change else 0.0)
                    break
            yield self.bounces / settings.bounces
        if links:
            self._pass(voxels, irradiance, links, first=self.bounces == 0, last=True)  # the last bounce once more
            self.radiance.reverse()
            share.run(voxels, self.radiance[1], irradiance, self.radiance[0])

    def _change(self, faces: int) -> float:
        """By which share the last bounce has changed how bright faces look, on average."""
        gpu, slot = self.gpu, interface.slot
        stride = -(-faces // _ASKED) | 1  # faces of all facings, which take turns
        count = -(-faces // stride)
        with gpu.timed("bounce"):
            changes = gpu.buffer("bounce changes", size=8 * count)
            try:
                self.radiance[0].use(slot("TEX_FACE_RADIANCE"))
                self.radiance[1].use(slot("TEX_RADIANCE_BEFORE"))
                changes.bind_to_storage_buffer(slot("BUF_RESULTS"))
                kernel = gpu.kernel("bounce_change").set(change_count=count, face_count=faces, stride=stride)
                for run in (1, stride):
                    kernel.set(face_run=run).run_list(count)
                    gpu.barrier()  # read back
                    sums = np.frombuffer(changes.read(), np.float32)[: 2 * count].reshape(-1, 2)
                    seen, changed = sums.sum(axis=0, dtype=np.float64).tolist()
                    if seen > 0.0:
                        return float(2.0 * changed / seen)  # of radiance, which changes twice as much
            finally:
                gpu.free(changes)
        return 0.0

    def _add_rest(self, voxels: Voxels, rest: float) -> None:
        """Make the second of ``radiance`` what all further bounces would lead to, which bring ``rest`` times what the
        last one has brought."""
        with self.gpu.timed("bounce"):
            self.radiance[0].use(interface.slot("TEX_FACE_RADIANCE"))
            self.radiance[1].bind_to_image(interface.slot("IMG_0"), read=True, write=True)
            kernel = self.gpu.kernel("bounce_rest").set(face_count=voxels.faces.count, rest=rest)
            kernel.run_list(voxels.faces.count)
            self.gpu.barrier()  # the last bounce reads it

    def _pass(
        self,
        voxels: Voxels,
        irradiance: moderngl.Texture | None,
        links: LinkPass | None,
        *,
        first: bool = False,
        last: bool = False,
    ) -> None:
        """Of ``radiance`` the second passes light on to the first."""
        gpu, slot = self.gpu, interface.slot
        straight = links.straight if links else None
        with gpu.timed("bounce"):
            kernel = gpu.kernel(
                "bounce",
                {
                    "FIRST": first,
                    "LAST": last,
                    "HAS_INJECTED": irradiance is not None,
                    "HAS_STRAIGHT": straight is not None,
                },
            )
            voxels.faces.bind()
            if irradiance is not None:
                irradiance.use(slot("TEX_FACE_IRRADIANCE"))
            if straight is not None:
                straight.use(slot("TEX_FACE_STRAIGHT"))
            kernel.set(face_count=voxels.faces.count)
            if not first:
                assert links is not None and links.links is not None
                self.radiance[1].use(slot("TEX_FACE_RADIANCE"))
                links.links.use(slot("TEX_LINKS"))
                kernel.set(link_count=links.count)
            self.radiance[0].bind_to_image(slot("IMG_0"), read=False, write=True)
            kernel.run_list(voxels.faces.count)
            gpu.barrier()  # the next bounce and the gather read what this one wrote

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self.radiance)
        self.radiance = []
