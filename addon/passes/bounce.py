# SPDX-License-Identifier: GPL-3.0-or-later
"""Light passed between voxel faces along their links: bounces trace nothing."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from dataclasses import dataclass

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext
from ..settings import Settings
from .link import LinkPass
from .packed_light import LIGHT_BYTES
from .share_faces import SharePass
from .voxelize import Voxels

#: Bounces end when what further ones would bring changes how bright faces look by less than this share, on average; it
#: is added at once.
CONVERGED = 2e-3
#: The same for a draft, which goes on from the light that was there before an edit. What further bounces would bring is
#: taken to be as much, in terms of the last one, as it was when light had bounced from nothing.
DRAFT_CONVERGED = 1e-2
#: How many faces are asked how much they change, at most; all where none of these has light.
_ASKED = 1 << 16


@dataclass(frozen=True)
class _Sources:
    """What bounces read besides radiance."""

    voxels: Voxels
    irradiance: moderngl.Texture | None  # None: nothing was injected
    links: LinkPass | None  # None: no bounces


class BouncePass:
    """Owns the radiance of all faces; while light bounces, two lists of it that take turns."""

    def __init__(self, gpu: GpuContext, *, keeps_light: bool) -> None:
        """``keeps_light``: for drafts to go on from: what it was before faces shared it, in 8 bytes for each face."""
        self.gpu = gpu
        self.radiance: moderngl.Texture | None = None
        self.bounces = 0
        self._keeps_light = keeps_light
        self._unshared: moderngl.Buffer | None = None
        self._rest = 0.0  # what further bounces than those that led to it would have brought, in terms of the last
        self._lists: list[moderngl.Buffer] = []

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
        ``goes_on``: from the light that is kept, and only until little changes. Radiance and light before stay where
        this is not run to its end. Raises MemoryError where there are more faces than fit into a buffer.
        """
        sources = _Sources(voxels, irradiance, links)
        indirect = radiance = rest = None
        self.bounces = 0
        try:
            if links is None:
                radiance = self._texture(voxels)
                self._pass(sources, radiance, first=True)
            else:
                rest = yield from self._bounce(sources, settings, self._unshared if goes_on else None)
                self.gpu.free(self._lists.pop(0))
                indirect = self._texture(voxels)
                self._pass(sources, indirect, first=self.bounces == 0, last=True)  # the last bounce once more
                if not self._keeps_light or rest is None:
                    self._free_lists()
                radiance = self._texture(voxels)
                share.run(voxels, indirect, irradiance, radiance)
            self.radiance, radiance = radiance, self.radiance
            unshared, self._unshared = self._unshared, self._lists.pop() if self._lists else None
            self._rest = rest or 0.0
            self.gpu.free(unshared)
        finally:
            self._free_lists()
            self.gpu.free(indirect, radiance)

    @property
    def has_light(self) -> bool:
        """Whether a draft has something to go on from: light after so many bounces that more change little."""
        return self._unshared is not None

    def renumber(self, numbers_before: np.ndarray | None) -> None:
        """Faces have other numbers. ``numbers_before``: (faces,) uint32, NONE_INDEX for new ones, which are dark; None:
        nothing is kept."""
        if numbers_before is None or self._unshared is None:
            self.release()
            return
        with self.gpu.timed("bounce"):
            stored = np.frombuffer(self._unshared.read(), np.uint64)
            is_new = numbers_before == interface.NONE_INDEX
            moved = np.where(is_new, np.uint64(0), stored[np.where(is_new, 0, numbers_before)])
            self.release()
            self._unshared = self.gpu.buffer("bouncing light", moved)

    def _texture(self, voxels: Voxels) -> moderngl.Texture:
        return self.gpu.list_texture("face radiance", voxels.faces.count, 2, "u4")

    def _bounce(
        self, sources: _Sources, settings: Settings, before: moderngl.Buffer | None
    ) -> Generator[float, None, float | None]:
        """Leaves the radiance that the last bounce is to be made from in the second of the lists. ``before``: to go on
        from.

        Returns what further bounces would bring, in terms of the last; None: it is not known, or not little.
        """
        gpu, faces = self.gpu, sources.voxels.faces.count
        for _ in range(2):
            self._lists.append(gpu.buffer("bouncing light", size=LIGHT_BYTES * faces))
        if before is None:
            self._pass(sources, first=True)
        else:
            with gpu.timed("bounce"):
                gpu.mgl.copy_buffer(self._lists[0], before)
        first, converged = (2, CONVERGED) if before is None else (1, DRAFT_CONVERGED)  # bounce that is looked at
        change = 0.0  # by the last bounce
        while self.bounces < settings.bounces:
            self._lists.reverse()
            self._pass(sources)
            self.bounces += 1
            if first <= self.bounces < settings.bounces:
                change_before, change = change, self._change(faces)
                if before is not None:
                    rest = self._rest
                else:
                    rest = change / (change_before - change) if change < change_before else math.inf
                if change == 0.0 or change * rest <= converged:
                    if before is None:
                        self._add_rest(faces, rest if change else 0.0)
                    else:
                        self._lists.reverse()
                    return rest if change or before is not None else None
            yield self.bounces / settings.bounces
        return None

    def _change(self, faces: int) -> float:
        """By which share the last bounce has changed how bright faces look, on average."""
        gpu, slot = self.gpu, interface.slot
        stride = -(-faces // _ASKED) | 1  # faces of all facings, which take turns
        count = -(-faces // stride)
        with gpu.timed("bounce"):
            changes = gpu.buffer("bounce changes", size=8 * count)
            try:
                self._bind_both()
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

    def _add_rest(self, faces: int, rest: float) -> None:
        """Make the second of the lists what all further bounces would lead to, which bring ``rest`` times what the last
        one has brought."""
        with self.gpu.timed("bounce"):
            self._bind_both()
            self.gpu.kernel("bounce_rest").set(face_count=faces, rest=rest).run_list(faces)
            self.gpu.barrier()  # the last bounce reads it

    def _bind_both(self) -> None:
        """Radiance after the last bounce, and before it."""
        self._lists[0].bind_to_storage_buffer(interface.slot("BUF_RADIANCE"))
        self._lists[1].bind_to_storage_buffer(interface.slot("BUF_RADIANCE_BEFORE"))

    def _pass(
        self, sources: _Sources, kept: moderngl.Texture | None = None, *, first: bool = False, last: bool = False
    ) -> None:
        """Pass light on from the last of the lists to the first, or to ``kept``."""
        gpu, slot, links = self.gpu, interface.slot, sources.links
        irradiance, straight, faces = sources.irradiance, links.straight if links else None, sources.voxels.faces
        with gpu.timed("bounce"):
            kernel = gpu.kernel(
                "bounce",
                {
                    "FIRST": first,
                    "LAST": last,
                    "KEPT": kept is not None,
                    "HAS_INJECTED": irradiance is not None,
                    "HAS_STRAIGHT": straight is not None,
                },
            )
            faces.bind()
            if irradiance is not None:
                irradiance.use(slot("TEX_FACE_IRRADIANCE"))
            if straight is not None:
                straight.use(slot("TEX_FACE_STRAIGHT"))
            kernel.set(face_count=faces.count)
            if not first:
                assert links is not None and links.links is not None
                self._lists[-1].bind_to_storage_buffer(slot("BUF_RADIANCE"))
                links.links.use(slot("TEX_LINKS"))
                kernel.set(link_count=links.count)
            if kept is not None:
                kept.bind_to_image(slot("IMG_0"), read=False, write=True)
            else:
                self._lists[0].bind_to_storage_buffer(slot("BUF_RESULTS"))
            kernel.run_list(faces.count)
            gpu.barrier()  # the next bounce and the gather read what this one wrote

    def _free_lists(self) -> None:
        self.gpu.free(*self._lists)
        self._lists = []

    def release(self) -> None:
        """Free everything."""
        self._free_lists()
        self.gpu.free(self.radiance, self._unshared)
        self.radiance = self._unshared = None
