# SPDX-License-Identifier: GPL-3.0-or-later
"""The world's radiance: a constant, or its nodes evaluated into an equirectangular picture."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..materials.compile import CompiledWorld, compile_world
from ..materials.graph import ImageData, WorldData
from .materials import upload_image
from .world_table import CONCENTRATED, concentration, direction_table, luminances, surplus

#: Columns and rows of the picture when the nodes say nothing about their detail, and at most.
DEFAULT_SIZE, MAX_SIZE = (512, 256), (4096, 2048)

#: Directions of a concentrated world that are drawn in each pass at each pixel, and at each voxel face.
PIXEL_SAMPLES, FACE_SAMPLES = 1, 2


def picture_size(images: Sequence[ImageData]) -> tuple[int, int]:
    """Columns and rows: odd multiples of the finest image's where that is possible.

    Then each of its texels has its middle in the middle of one of the picture's, and what is read between texels is the
    same.
    """

    def along(axis: int, least: int, most: int) -> int:
        detail = max((image.pixels.shape[axis] for image in images), default=0)
        if not detail:
            return least
        multiple = -(-least // detail) // 2 * 2 + 1
        return min(detail * multiple if detail * multiple <= most else max(detail, least), most)

    return along(1, DEFAULT_SIZE[0], MAX_SIZE[0]), along(0, DEFAULT_SIZE[1], MAX_SIZE[1])


class WorldLight:
    """What rays that leave the scene bring."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.constant = np.zeros(3, np.float32)
        self.texture: moderngl.Texture | None = None
        #: Running sums of chances, where the texture's light is so concentrated that directions are drawn by it.
        self.table: moderngl.Texture | None = None
        self.warnings: list[str] = []

    @property
    def is_lit(self) -> bool:
        return self.texture is not None or bool(self.constant.any())

    @property
    def is_concentrated(self) -> bool:
        """Whether directions drawn by light find more than rays do."""
        return self.table is not None

    @property
    def defines(self) -> dict[str, object]:
        return {"HAS_WORLD": self.is_lit, "WORLD_IS_TEXTURE": self.texture is not None}

    def run(self, world: WorldData | None) -> None:
        """Evaluate the world; None is black."""
        self.release()
        self.constant = np.zeros(3, np.float32)
        self.warnings = []
        if world is None:
            return
        compiled = compile_world(world)
        self.warnings = list(compiled.warnings)
        if compiled.radiance is not None:
            self.constant = np.nan_to_num(np.asarray(compiled.radiance, np.float32), posinf=0.0, neginf=0.0).clip(0.0)
            return
        self.gpu.age_programs()
        with self.gpu.timed("world"):
            self.texture = self._bake(compiled, picture_size(compiled.images))
            self._tabulate(self.texture)

    def _bake(self, compiled: CompiledWorld, size: tuple[int, int]) -> moderngl.Texture:
        gpu, slot = self.gpu, interface.slot
        declared = "".join(
            f"layout(binding = TEX_MATERIAL_{k}) uniform sampler2D world_texture_{k};\n"
            for k in range(len(compiled.textures))
        )
        kernel = gpu.kernel("world", {}, {"world": declared + (compiled.source or "")})
        images = [upload_image(gpu, image) for image in compiled.images]
        values = np.asarray(compiled.parameters, np.float32).reshape(-1, 4)
        parameters = gpu.buffer("world parameters", values if len(values) else np.zeros((1, 4), np.float32))
        texture = gpu.texture("world", size, 4, "f4", linear=True)
        texture.repeat_x = True
        for unit, binding in enumerate(compiled.textures):
            image = images[binding.image]
            image.repeat_x = True
            image.repeat_y = False
            image.use(interface.FIRST_MATERIAL_TEXTURE + unit)
        parameters.bind_to_storage_buffer(slot("BUF_MATERIALS"))
        texture.bind_to_image(slot("IMG_0"), read=False, write=True)
        kernel.set(picture_size=size)
        kernel.run_tiles(*size)
        gpu.barrier()  # read as a texture from here on
        gpu.free(parameters, *images)
        return texture

    def _tabulate(self, texture: moderngl.Texture) -> None:
        """Make the table, and w of the texture, if its light is concentrated."""
        columns, rows = texture.size
        pixels = np.frombuffer(texture.read(), np.float32).reshape(rows, columns, 4)
        luminance = luminances(pixels[..., :3])
        if concentration(luminance) <= CONCENTRATED:
            return
        sums, density = direction_table(surplus(luminance))
        self.table = self.gpu.texture("world", (columns + 1, rows), 1, "f4", sums)
        texture.write(np.concatenate([pixels[..., :3], density[..., None]], axis=2).tobytes())

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/world.glsl reads."""
        if self.texture is not None:
            self.texture.use(interface.slot("TEX_WORLD"))
        elif "world_radiance" in kernel.source.text:
            kernel.set(world_radiance=tuple(float(c) for c in self.constant))

    def bind_drawn(self, kernel: Kernel, samples: int, *, table: bool) -> None:
        """Bind what weighs rays against ``samples`` drawn directions; ``table``: and what draws them."""
        kernel.set(world_samples=samples)
        if table:
            assert self.table is not None
            self.table.use(interface.slot("TEX_WORLD_TABLE"))

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.texture, self.table)
        self.texture = self.table = None
