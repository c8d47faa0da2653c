# SPDX-License-Identifier: GPL-3.0-or-later
"""Guides: from where light comes to the surfaces of each brick, so that rays of pixels look there more often."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext
from ..grid import VoxelGrid
from .link import LinkPass
from .voxel_numbers import guide_entries
from .voxelize import Voxels
from .world import WorldLight

_BINS = interface.GUIDE_SIDE**2

#: Links in one dispatch: bounds how long a step takes, so that cancelling is quick.
LINKS_PER_STEP = 1 << 20
#: Faces of a brick and facing, about.
_FACES = 16


class GuidePass:
    """Owns a guide for each facing that the surfaces of a brick have (lib/guide.glsl)."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self._voxels: Voxels | None = None  # whose bricks are numbered
        self._work = np.zeros(0, np.uint32)
        self._numbers: moderngl.Texture3D | None = None  # r32ui, bricks
        self._guides: moderngl.Texture | None = None  # rgba8 list

    @property
    def grid(self) -> VoxelGrid | None:
        """Whose bricks have guides."""
        return self._voxels.grid if self._voxels else None

    def run(self, voxels: Voxels, radiance: moderngl.Texture, links: LinkPass, world: WorldLight) -> Iterator[float]:
        """Make the guides from what ``links`` bring when faces send ``radiance``. Yields the share done."""
        gpu = self.gpu
        with gpu.timed("guides"):
            if self._voxels is not voxels:
                self._number(voxels)
            listed = gpu.buffer("guide bins", self._work)
        bins = light = None
        try:
            with gpu.timed("guides"):
                light = gpu.list_texture("guide bins", voxels.faces.count, 1, "f4")
                self._find_light(voxels, radiance, light)
            # Only now: software rasterizers let go of what was freed before when something else has been run.
            bins = gpu.list_texture("guide bins", len(self._work) * _BINS // 4, 4, "u4")
            yield from self._steps(voxels, links, world, bins, light, listed)
        finally:
            gpu.free(bins, light, listed)

    def _number(self, voxels: Voxels) -> None:
        """Which guides there are depends on voxels alone."""
        self.release()
        bricks = np.frombuffer(voxels.bricks.read(), np.uint32).reshape(-1, 4)
        cells = np.frombuffer(voxels.cells.read(), np.uint32).reshape(-1, 4)[: voxels.cell_count]
        entries, self._work = guide_entries(bricks, cells)
        self._numbers = self.gpu.texture_3d("guides", voxels.grid.bricks, 1, "u4", entries)
        self._guides = self.gpu.list_texture("guides", len(self._work) * interface.GUIDE_TEXELS, 4, "f1")
        self._voxels = voxels

    def _find_light(self, voxels: Voxels, radiance: moderngl.Texture, light: moderngl.Texture) -> None:
        kernel = self.gpu.kernel("guide_light").set(face_count=voxels.faces.count)
        radiance.use(interface.slot("TEX_FACE_RADIANCE"))
        light.bind_to_image(interface.slot("IMG_0"), read=False, write=True)
        kernel.run_list(voxels.faces.count)
        self.gpu.barrier()  # read as a texture

    def _steps(
        self,
        voxels: Voxels,
        links: LinkPass,
        world: WorldLight,
        bins: moderngl.Texture,
        light: moderngl.Texture,
        listed: moderngl.Buffer,
    ) -> Iterator[float]:
        gpu, slot, count = self.gpu, interface.slot, len(self._work)
        assert links.links is not None and self._numbers is not None and self._guides is not None
        step = max(interface.GROUP_SIZE, LINKS_PER_STEP // (links.count * _FACES))
        for first in range(0, count, step):
            with gpu.timed("guides"):
                kernel = gpu.kernel("guide_collect", world.defines | voxels.grid.defines)
                kernel.set(brick_count=voxels.grid.bricks, guide_first=first, guide_count=count, bin_count=_BINS)
                kernel.set(link_count=links.count, **voxels.grid.uniforms)
                gpu.use_source(voxels.bricks, "TEX_BRICKS")
                gpu.use_source(voxels.cells, "TEX_CELLS")
                light.use(slot("TEX_FACE_RADIANCE"))
                links.links.use(slot("TEX_LINKS"))
                world.bind(kernel)
                listed.bind_to_storage_buffer(slot("BUF_WORK"))
                bins.bind_to_image(slot("IMG_0"), read=False, write=True)
                kernel.run_list(min(step, count - first))
            yield 0.5 * first / count
        gpu.barrier()  # bins are read as a texture
        for first in range(0, count, step):
            with gpu.timed("guides"):
                kernel = gpu.kernel("guide_build")
                kernel.set(brick_count=voxels.grid.bricks, guide_first=first, guide_count=count, bin_count=_BINS)
                bins.use(slot("TEX_GUIDES"))
                self._numbers.use(slot("TEX_GUIDE_NUMBERS"))
                listed.bind_to_storage_buffer(slot("BUF_WORK"))
                self._guides.bind_to_image(slot("IMG_0"), read=False, write=True)
                kernel.run_list(min(step, count - first))
            yield 0.5 + 0.5 * first / count
        gpu.barrier()  # the gather reads guides

    def bind(self) -> None:
        """Bind what lib/guide.glsl reads."""
        assert self._guides is not None and self._numbers is not None
        self._guides.use(interface.slot("TEX_GUIDES"))
        self._numbers.use(interface.slot("TEX_GUIDE_NUMBERS"))

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self._guides, self._numbers)
        self._guides = self._numbers = self._voxels = None
        self._work = np.zeros(0, np.uint32)
