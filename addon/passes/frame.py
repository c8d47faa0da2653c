# SPDX-License-Identifier: GPL-3.0-or-later
"""What the passes over pixels share: the frame they work on, and the light they look up."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import moderngl
import numpy as np

from ..camera import CameraRays
from ..features import Features
from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..settings import Settings
from .cones import ConeVolume
from .emitters import EmitterTable
from .guide import GuidePass
from .inject import LightTable
from .surface import SurfacePictures, View
from .voxelize import Voxels
from .world import WorldLight

#: Rays that one step traces, about: bounds how long it takes, so that cancelling is quick.
RAYS_PER_STEP = 1 << 17


@dataclass(frozen=True)
class ActiveTiles:
    """Tiles of TILE_SIZE x TILE_SIZE pixels whose noise is still too high."""

    texture: moderngl.Texture  # r8ui, one texel a tile: 1 where active
    mask: np.ndarray  # (rows, columns) bool, the same


@dataclass(frozen=True)
class Gather:
    """A pass in which diffuse light is gathered."""

    index: int  # among those of this picture, from 0
    sample: int  # the same, counted through frames that take over light: random sequences go on


@dataclass(frozen=True)
class Frame:
    """One pass over the picture: where it looks from, and what it sees."""

    index: int  # of this pass, from 0
    sample: int  # the same, counted through frames that take over light
    gather: Gather | None  # None: this pass looks up what others have gathered
    camera: CameraRays
    offset: tuple[float, float]  # where in each pixel it samples
    surface: SurfacePictures
    features: Features
    settings: Settings
    active_tiles: ActiveTiles | None = None  # None: all are

    @property
    def view(self) -> View:
        """For pass ``surface``."""
        return View(self.camera, self.offset, self.sample, self.settings.seed, self.settings.samples)

    @property
    def defines(self) -> dict[str, object]:
        """What lib/tiles.glsl and lib/ray.glsl ask for."""
        return self.surface.ray_defines | {"IS_ADAPTIVE": self._asks_tiles}

    @property
    def _asks_tiles(self) -> bool:
        return self.active_tiles is not None and self.surface.rays is None  # what is met by rays follows from them

    @property
    def size(self) -> tuple[int, int]:
        return self.surface.size

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/pixel.glsl and lib/ray.glsl read."""
        self.surface.bind(kernel.gpu)
        self.bind_tiles()
        kernel.set(**self.camera.uniforms(self.offset))

    def bind_tiles(self) -> None:
        """Bind what lib/tiles.glsl reads."""
        if self._asks_tiles:
            assert self.active_tiles is not None
            self.active_tiles.texture.bind_to_image(interface.slot("IMG_TILES"), read=True, write=False)


@dataclass(frozen=True)
class LitVoxels:
    """Where light comes from: voxels and what their faces pass on, lights, emitters, the world."""

    voxels: Voxels
    radiance: moderngl.Texture | None  # of faces; None: nothing looks it up
    lights: LightTable
    emitters: EmitterTable
    world: WorldLight
    cones: ConeVolume
    guides: GuidePass

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/radiance.glsl and lib/world.glsl read."""
        self.voxels.bind(kernel)
        if self.radiance is not None:
            self.radiance.use(interface.slot("TEX_FACE_RADIANCE"))
        self.world.bind(kernel)


def run_tiles(
    gpu: GpuContext, name: str, kernel: Kernel, frame: Frame, rays: int, bind: Callable[[], None]
) -> Iterator[float]:
    """Run ``kernel`` over the picture, part by part; ``rays``: how many it traces for a pixel. Yields the share done.

    Parts without an active tile are left out. The kernel asks ``is_active`` (lib/tiles.glsl) for each pixel.
    """
    tile, size = interface.TILE_SIZE, frame.size
    side = max(tile, int((RAYS_PER_STEP / max(rays, 1)) ** 0.5) // tile * tile)
    parts = [(x, y) for y in range(0, size[1], side) for x in range(0, size[0], side)]
    if frame.active_tiles is not None:
        mask, step = frame.active_tiles.mask, side // tile
        parts = [(x, y) for x, y in parts if mask[y // tile : y // tile + step, x // tile : x // tile + step].any()]
    for index, (x, y) in enumerate(parts):
        with gpu.timed(name):
            bind()
            kernel.set(tile_first=(x, y))
            kernel.run_tiles(min(side, size[0] - x), min(side, size[1] - y))
            if index == len(parts) - 1:
                gpu.barrier()  # what follows reads the pictures as textures
        yield (index + 1) / len(parts)
