# SPDX-License-Identifier: GPL-3.0-or-later
"""Light at pixels: straight from lights, and gathered from voxel faces."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import moderngl

from ..camera import CameraRays
from ..features import Features
from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..settings import Settings
from .cones import ConeVolume
from .inject import LightTable
from .surface import SurfacePictures, bind_pixels
from .voxelize import Voxels
from .world import WorldLight

#: Rays that one step traces, about: bounds how long it takes, so that cancelling is quick.
RAYS_PER_STEP = 1 << 17


class LightingPictures:
    """Diffuse and glossy light at each pixel; each exists only when something needs it."""

    def __init__(self, gpu: GpuContext, name: str) -> None:
        self.gpu = gpu
        self.name = name
        self.diffuse: moderngl.Texture | None = None
        self.glossy: moderngl.Texture | None = None
        self._key: tuple = ()

    def allocate(self, size: tuple[int, int], *, diffuse: bool, glossy: bool) -> None:
        """Make the pictures; kept when nothing changed."""
        key = (size, diffuse, glossy)
        if key == self._key:
            return
        self.release()
        self.diffuse = self.gpu.texture(self.name, size, 4, "f4") if diffuse else None
        self.glossy = self.gpu.texture(self.name, size, 4, "f4") if glossy else None
        self._key = key

    def bind_images(self) -> None:
        """Bind for writing."""
        if self.diffuse is not None:
            self.diffuse.bind_to_image(interface.slot("IMG_0"), read=False, write=True)
        if self.glossy is not None:
            self.glossy.bind_to_image(interface.slot("IMG_1"), read=False, write=True)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.diffuse, self.glossy)
        self.diffuse = self.glossy = None
        self._key = ()


def _run_tiles(
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
                gpu.barrier()  # composition reads the pictures as textures
        yield (index + 1) / len(tiles)


class DirectPass:
    """Light straight from lights, with shadows."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.pictures = LightingPictures(gpu, "direct light")

    def run(
        self,
        surface: SurfacePictures,
        voxels: Voxels,
        lights: LightTable,
        cones: ConeVolume,
        camera: CameraRays,
        offset: tuple[float, float],
        sample: int,
        features: Features,
        settings: Settings,
    ) -> Iterator[float]:
        """Yields the share done."""
        self.pictures.allocate(surface.size, diffuse=True, glossy=features.has_glossy)
        shadow_cones = features.shadow_cones
        kernel = self.gpu.kernel(
            "direct",
            voxels.trace_defines
            | lights.defines(settings)
            | {"HAS_GLOSSY": features.has_glossy, "SHADOW_CONES": shadow_cones},
        )

        def bind() -> None:
            voxels.bind(kernel)
            bind_pixels(kernel, surface, camera, offset)
            lights.bind(kernel, settings)
            if shadow_cones:
                cones.bind(kernel)
            self.pictures.bind_images()
            kernel.set(
                sample_index=sample,
                random_seed=settings.seed,
                use_shadows=settings.use_shadows,
                shadow_amount=settings.shadow_amount,
            )
            if shadow_cones:
                kernel.set(shadow_cone_angle=settings.shadow_cone_angle)

        yield from _run_tiles(self.gpu, "direct", kernel, surface.size, lights.count, bind)

    def release(self) -> None:
        """Free everything."""
        self.pictures.release()


class GatherPass:
    """Indirect diffuse and glossy light."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.pictures = LightingPictures(gpu, "indirect light")

    def run(
        self,
        surface: SurfacePictures,
        voxels: Voxels,
        radiance: moderngl.Texture | None,
        lights: LightTable,
        world: WorldLight,
        cones: ConeVolume,
        camera: CameraRays,
        offset: tuple[float, float],
        sample: int,
        features: Features,
        settings: Settings,
    ) -> Iterator[float]:
        """Yields the share done."""
        self.pictures.allocate(surface.size, diffuse=features.has_diffuse_gather, glossy=features.has_glossy)
        gather_cones = features.gather_cones
        sees_lights = features.has_glossy and features.has_lights  # glossy rays alone meet lights
        kernel = self.gpu.kernel(
            "gather",
            voxels.trace_defines
            | lights.defines(settings)
            | world.defines
            | {
                "HAS_DIFFUSE": features.has_diffuse_gather,
                "HAS_GLOSSY": features.has_glossy,
                "HAS_LIGHTS": sees_lights,
                "GATHER_CONES": gather_cones,
                "GATHER_OCCLUSION": features.gather_occlusion,
            },
        )
        limit = settings.ao_distance if features.gather_occlusion else settings.max_distance
        cell_size = voxels.grid.cell_size

        def bind() -> None:
            voxels.bind(kernel)
            if radiance is not None:
                radiance.use(interface.slot("TEX_FACE_RADIANCE"))
            world.bind(kernel)
            bind_pixels(kernel, surface, camera, offset)
            if sees_lights:
                lights.bind(kernel, settings)
            if gather_cones:
                cones.bind(kernel)
            self.pictures.bind_images()
            kernel.set(
                sample_index=sample,
                ray_count=settings.rays,
                random_seed=settings.seed,
                max_distance=limit / cell_size if limit > 0.0 else 1e30,
                specular_aperture=settings.specular_aperture,
                clamp_indirect=settings.clamp_indirect,
            )

        yield from _run_tiles(self.gpu, "gather", kernel, surface.size, settings.rays + 1, bind)

    def release(self) -> None:
        """Free everything."""
        self.pictures.release()
