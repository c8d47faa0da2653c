# SPDX-License-Identifier: GPL-3.0-or-later
"""The world's radiance: a constant, or its nodes evaluated into an equirectangular picture."""

from __future__ import annotations

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..materials.compile import CompiledWorld, compile_world
from ..materials.graph import WorldData
from .materials import upload_image

#: Rows of the picture when the nodes say nothing about their detail, and at most.
DEFAULT_ROWS, MAX_ROWS = 256, 2048


class WorldLight:
    """What rays that leave the scene bring."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.constant = np.zeros(3, np.float32)
        self.texture: moderngl.Texture | None = None
        self.warnings: list[str] = []

    @property
    def is_lit(self) -> bool:
        return self.texture is not None or bool(self.constant.any())

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
        rows = max([DEFAULT_ROWS, *(image.pixels.shape[0] for image in compiled.images)])
        rows = min(rows, MAX_ROWS)
        with self.gpu.timed("world"):
            self._bake(compiled, rows)

    def _bake(self, compiled: CompiledWorld, rows: int) -> None:
        gpu, slot = self.gpu, interface.slot
        declared = "".join(
            f"layout(binding = TEX_MATERIAL_{k}) uniform sampler2D world_texture_{k};\n"
            for k in range(len(compiled.textures))
        )
        kernel = gpu.kernel("world", {}, {"world": declared + (compiled.source or "")})
        images = [upload_image(gpu, image) for image in compiled.images]
        values = np.asarray(compiled.parameters, np.float32).reshape(-1, 4)
        parameters = gpu.buffer("world parameters", values if len(values) else np.zeros((1, 4), np.float32))
        self.texture = gpu.texture("world", (2 * rows, rows), 4, "f4", linear=True)
        self.texture.repeat_x = True
        for unit, binding in enumerate(compiled.textures):
            image = images[binding.image]
            image.repeat_x = True
            image.repeat_y = False
            image.use(interface.FIRST_MATERIAL_TEXTURE + unit)
        parameters.bind_to_storage_buffer(slot("BUF_MATERIALS"))
        self.texture.bind_to_image(slot("IMG_0"), read=False, write=True)
        kernel.set(picture_size=(2 * rows, rows))
        kernel.run_tiles(2 * rows, rows)
        gpu.barrier()  # read as a texture from here on
        gpu.free(parameters, *images)

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/world.glsl reads."""
        if self.texture is not None:
            self.texture.use(interface.slot("TEX_WORLD"))
        elif "world_radiance" in kernel.source.text:
            kernel.set(world_radiance=tuple(float(c) for c in self.constant))

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.texture)
        self.texture = None
