# SPDX-License-Identifier: GPL-3.0-or-later
"""What the passes over pixels share: the frame they work on, and the light they look up."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import moderngl

from ..camera import CameraRays
from ..features import Features
from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..settings import Settings
from .cones import ConeVolume
from .emitters import EmitterTable
from .inject import LightTable
from .surface import SurfacePictures
from .voxelize import Voxels
from .world import WorldLight

#: Rays that one step traces, about: bounds how long it takes, so that cancelling is quick.
RAYS_PER_STEP = 1 << 17


@dataclass(frozen=True)
class Frame:
    """One pass over the picture: where it looks from, and what it sees."""

    index: int  # of this pass, from 0
    camera: CameraRays
    offset: tuple[float, float]  # where in each pixel it samples
    surface: SurfacePictures
    features: Features
    settings: Settings

    @property
    def size(self) -> tuple[int, int]:
        return self.surface.size

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/pixel.glsl and lib/camera.glsl read."""
        self.surface.bind()
        kernel.set(**self.camera.uniforms(self.offset))


@dataclass(frozen=True)
class LitVoxels:
    """Where light comes from: voxels and what their faces pass on, lights, emitters, the world."""

    voxels: Voxels
    radiance: moderngl.Texture | None  # of faces; None: nothing looks it up
    lights: LightTable
    emitters: EmitterTable
    world: WorldLight
    cones: ConeVolume

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/radiance.glsl and lib/world.glsl read."""
        self.voxels.bind(kernel)
        if self.radiance is not None:
            self.radiance.use(interface.slot("TEX_FACE_RADIANCE"))
        self.world.bind(kernel)


def run_tiles(
    gpu: GpuContext, name: str, kernel: Kernel, size: tuple[int, int], rays: int, bind: Callable[[], None]
) -> Iterator[float]:
    """Run ``kernel`` tile by tile; ``rays``: how many it traces for a pixel. Yields the share done."""
    side = max(
        interface.TILE_SIZE, int((RAYS_PER_STEP / max(rays, 1)) ** 0.5) // interface.TILE_SIZE * interface.TILE_SIZE
    )
    tiles = [(x, y) for y in range(0, size[1], side) for x in range(0, size[0], side)]
    for index, (x, y) in enumerate(tiles):
        with gpu.timed(name):
            bind()
            kernel.set(tile_first=(x, y))
            kernel.run_tiles(min(side, size[0] - x), min(side, size[1] - y))
            if index == len(tiles) - 1:
                gpu.barrier()  # what follows reads the pictures as textures
        yield (index + 1) / len(tiles)
