# SPDX-License-Identifier: GPL-3.0-or-later
"""Guides: from where light comes to the surfaces of each brick, so that rays of pixels look there more often."""

from __future__ import annotations

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext
from ..settings import Settings
from .bounce import LinkPass
from .voxel_numbers import guide_entries
from .voxelize import Voxels
from .world import WorldLight

_BINS = interface.GUIDE_SIDE**2


class GuidePass:
    """Owns a guide for each facing that the surfaces of a brick have (lib/guide.glsl)."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self._guides: moderngl.Texture | None = None  # rgba8 list
        self._numbers: moderngl.Texture3D | None = None  # r32ui, bricks

    def run(
        self, voxels: Voxels, radiance: moderngl.Texture, links: LinkPass, world: WorldLight, settings: Settings
    ) -> None:
        """Make the guides from what ``links`` bring when faces send ``radiance``."""
        self.release()
        gpu, slot, grid = self.gpu, interface.slot, voxels.grid
        assert links.links is not None
        with gpu.timed("guides"):
            bricks = np.frombuffer(voxels.bricks.read(), np.uint32).reshape(-1, 4)
            cells = np.frombuffer(voxels.cells.read(), np.uint32).reshape(-1, 4)[: voxels.cell_count]
            entries, work = guide_entries(bricks, cells)
            self._numbers = gpu.texture_3d("guides", grid.bricks, 1, "u4", entries)
            self._guides = gpu.list_texture("guides", len(work) * interface.GUIDE_TEXELS, 4, "f1")
            bins = gpu.list_texture("guide bins", len(work) * _BINS // 2, 4, "f4")
            listed = gpu.buffer("guide bins", work)
            listed.bind_to_storage_buffer(slot("BUF_WORK"))

            kernel = gpu.kernel("guide_collect", world.defines)
            kernel.set(brick_count=grid.bricks, guide_count=len(work))
            kernel.set(link_count=links.count, random_seed=settings.seed)
            voxels.bricks.use(slot("TEX_BRICKS"))
            voxels.cells.use(slot("TEX_CELLS"))
            voxels.faces.bind()
            radiance.use(slot("TEX_FACE_RADIANCE"))
            links.links.use(slot("TEX_LINKS"))
            world.bind(kernel)
            bins.bind_to_image(slot("IMG_0"), read=False, write=True)
            kernel.run_list(len(work))
            gpu.barrier()  # bins are read as a texture

            kernel = gpu.kernel("guide_build")
            kernel.set(brick_count=grid.bricks, guide_count=len(work))
            bins.use(slot("TEX_GUIDES"))
            self._numbers.use(slot("TEX_GUIDE_NUMBERS"))
            self._guides.bind_to_image(slot("IMG_0"), read=False, write=True)
            kernel.run_list(len(work))
            gpu.barrier()  # the gather reads guides
            gpu.free(bins, listed)

    def bind(self) -> None:
        """Bind what lib/guide.glsl reads."""
        assert self._guides is not None and self._numbers is not None
        self._guides.use(interface.slot("TEX_GUIDES"))
        self._numbers.use(interface.slot("TEX_GUIDE_NUMBERS"))

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self._guides, self._numbers)
        self._guides = self._numbers = None
