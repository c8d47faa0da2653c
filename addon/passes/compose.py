# SPDX-License-Identifier: GPL-3.0-or-later
"""The film: sums over passes of the picture and of every render pass that was asked for."""

from __future__ import annotations

from collections.abc import Iterable

import moderngl
import numpy as np

from ..camera import CameraRays
from ..features import Features
from ..gpu import interface
from ..gpu.context import GpuContext
from ..grid import VoxelGrid
from ..scene import FloatArray, SceneData
from ..settings import Settings
from .lighting import LightingPictures
from .surface import SurfacePictures, bind_pixels
from .world import WorldLight

#: Name -> channels, and whether it is an average over passes or the first pass's value.
OUTPUTS: dict[str, tuple[int, bool]] = {
    "combined": (4, True),
    "depth": (1, False),
    "normal": (3, False),
    "position": (3, False),
    "diffuse_direct": (3, True),
    "diffuse_indirect": (3, True),
    "diffuse_color": (3, True),
    "glossy_direct": (3, True),
    "glossy_indirect": (3, True),
    "glossy_color": (3, True),
    "emission": (3, True),
    "environment": (3, True),
}


class Film:
    """Sums in float32, one picture for each output that was asked for."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.samples = 0
        self.size = (0, 0)
        self._sums: dict[str, moderngl.Texture] = {}

    @property
    def names(self) -> list[str]:
        """Outputs that can be read."""
        return list(self._sums)

    def start(self, size: tuple[int, int], names: Iterable[str]) -> None:
        """Begin again at zero, with these outputs."""
        wanted = [name for name in OUTPUTS if name in set(names) | {"combined"}]
        if size != self.size or wanted != list(self._sums):
            self.release()
            self._sums = {name: self.gpu.texture("film", size, 4, "f4") for name in wanted}
        zeros = bytes(16 * size[0] * size[1])
        for texture in self._sums.values():
            texture.write(zeros)
        self.size = size
        self.samples = 0

    def read(self, name: str) -> FloatArray:
        """(H, W, channels) float32, row 0 at the bottom, scene-linear, premultiplied. Raises KeyError."""
        channels, averaged = OUTPUTS[name]
        width, height = self.size
        data = np.frombuffer(self._sums[name].read(), np.float32).reshape(height, width, 4)
        scale = 1.0 / max(self.samples, 1) if averaged else 1.0
        return np.ascontiguousarray(data[..., :channels]) * np.float32(scale)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self._sums.values())
        self._sums = {}
        self.size = (0, 0)

    def add(
        self, scene: SceneData, surface: SurfacePictures, direct: LightingPictures | None,
        indirect: LightingPictures | None, world: WorldLight, camera: CameraRays, offset: tuple[float, float],
        grid: VoxelGrid, features: Features, settings: Settings,
    ) -> None:
        """Add one pass to all sums."""
        slot = interface.slot
        numbers: dict[str, object] = {f"OUTPUT_{name.upper()}": index for index, name in enumerate(OUTPUTS)}
        has = {
            "HAS_DIRECT": direct is not None and direct.diffuse is not None,
            "HAS_DIFFUSE": indirect is not None and indirect.diffuse is not None,
            "HAS_GLOSSY": indirect is not None and indirect.glossy is not None,
            "WORLD_IS_TEXTURE": world.texture is not None,
        }
        with self.gpu.timed("compose"):
            for name, texture in self._sums.items():
                kernel = self.gpu.kernel("compose", numbers | has | {"OUTPUT": f"OUTPUT_{name.upper()}"})
                bind_pixels(kernel, surface, camera, offset)
                surface.emission.use(slot("TEX_EMISSION"))
                world.bind(kernel)
                for pictures, kind in ((direct, "DIRECT"), (indirect, "INDIRECT")):
                    if pictures is not None and pictures.diffuse is not None:
                        pictures.diffuse.use(slot(f"TEX_{kind}_DIFFUSE"))
                    if pictures is not None and pictures.glossy is not None:
                        pictures.glossy.use(slot(f"TEX_{kind}_GLOSSY"))
                texture.bind_to_image(slot("IMG_0"), read=True, write=True)
                kernel.set(
                    direct_amount=settings.direct_amount if settings.use_direct else 0.0,
                    indirect_amount=settings.indirect_amount if settings.use_indirect else 0.0,
                    specular_amount=settings.specular_amount if settings.use_specular else 0.0,
                    exposure=scene.exposure, film_transparent=scene.film_transparent,
                    camera_forward=tuple(camera.forward), camera_position=tuple(camera.position),
                    cell_size=grid.cell_size, grid_origin_ws=grid.origin, first_pass=self.samples == 0,
                )
                kernel.run_tiles(*self.size)
            self.gpu.barrier()  # the next pass adds to these sums; read-back reads them
        self.samples += 1
