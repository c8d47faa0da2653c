# SPDX-License-Identifier: GPL-3.0-or-later
"""Prefiltered radiance and opacity for cones: coarser and coarser levels of the six faces."""

from __future__ import annotations

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from .voxelize import Voxels

#: Cells along the longest side of the finest level: cones are wide, what is finer they cannot see.
MAX_SIZE = 128
LEVELS = 6


class ConeVolume:
    """Six facings one above the other in z, with levels; (opacity L, opacity), opacity being area.

    Between two facings lies a gap of one cell of the coarsest level, so that linear filtering never mixes them.
    """

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.volume: moderngl.Texture3D | None = None
        self.size = (0, 0, 0)
        self.stride = 0
        self.children = 1

    def run(self, voxels: Voxels, radiance: moderngl.Texture) -> None:
        """Build all levels."""
        self.release()
        gpu, slot = self.gpu, interface.slot
        coarsest = 1 << (LEVELS - 1)
        self.children = max(1, -(-max(voxels.grid.size) // MAX_SIZE))
        self.size = tuple(-(-side // (self.children * coarsest)) * coarsest for side in voxels.grid.size)  # type: ignore[assignment]
        self.stride = self.size[2] + coarsest
        full = (self.size[0], self.size[1], 6 * self.stride)
        with gpu.timed("cones"):
            volume = gpu.texture_3d("cone levels", full, 4, "f2")
            volume.build_mipmaps(0, LEVELS - 1)
            volume.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            self.volume = volume
            for level in range(LEVELS):
                kernel = gpu.kernel("cones", voxels.grid.defines | {"FIRST": level == 0})
                if level == 0:
                    voxels.bind_cells(kernel)
                    radiance.use(slot("TEX_FACE_RADIANCE"))
                    voxels.faces.bind()
                else:
                    volume.use(slot("TEX_CONES"))
                    kernel.set(finer_level=level - 1)
                size = tuple(side >> level for side in self.size)
                kernel.set(
                    level_size=size, level_stride=self.stride >> level, children=self.children if level == 0 else 2
                )
                volume.bind_to_image(slot("IMG_0"), read=False, write=True, level=level)
                kernel.run_groups(*(-(-side // 4) for side in size))
                gpu.barrier()  # the next level reads this one; cones read all

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/cone.glsl reads."""
        assert self.volume is not None
        self.volume.use(interface.slot("TEX_CONES"))
        kernel.set(cone_size=self.size, cone_stride=self.stride, cone_cell=float(self.children), cone_levels=LEVELS)

    def release(self) -> None:
        """Free the volume."""
        self.gpu.free(self.volume)
        self.volume = None
