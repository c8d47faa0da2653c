# SPDX-License-Identifier: GPL-3.0-or-later
"""How a picture gets from the film into a region of Blender's.

Pictures stay scene-linear: Blender applies the view transform to the whole region.
"""

from __future__ import annotations

from typing import Any, Protocol

import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

_LARGEST_HALF = 65504.0

#: Left, bottom, width, height in pixels of the region.
Box = tuple[int, int, int, int]


class Display(Protocol):
    """Keeps the last picture that was finished, and draws it."""

    def keep(self, film: Any, name: str) -> None:
        """Take over one of the film's outputs. Called where the film's context is current."""

    def draw(self, box: Box) -> None:
        """Draw it, if there is one, into the region that Blender draws. Called in ``view_draw``."""

    def release(self) -> None:
        """Free everything. Called where the film's context is current."""


class SharedDisplay:
    """Film and region are in one GL context: the picture never leaves the GPU."""

    def __init__(self, context: Any) -> None:
        from ..passes.present import PresentPass

        self._context = context
        self._present = PresentPass(context)

    def keep(self, film: Any, name: str) -> None:
        self._present.keep(film, name)

    def draw(self, box: Box) -> None:
        with self._context.guard():  # Blender's framebuffer is bound: the guard of what was rendered has ended
            self._present.draw(box)

    def release(self) -> None:
        self._present.release()


class UploadedDisplay:
    """Blender draws with something else than GL: pictures are read back and uploaded."""

    def __init__(self) -> None:
        self._pixels: np.ndarray | None = None  # (H, W, 4) float32, not uploaded yet
        self._texture: gpu.types.GPUTexture | None = None

    def keep(self, film: Any, name: str) -> None:
        picture = np.nan_to_num(film.read_mean(name), nan=0.0)
        self._pixels = np.clip(picture, -_LARGEST_HALF, _LARGEST_HALF)

    def draw(self, box: Box) -> None:
        pixels, self._pixels = self._pixels, None
        if pixels is not None:
            height, width, _ = pixels.shape
            data = gpu.types.Buffer("FLOAT", pixels.shape, np.ascontiguousarray(pixels))
            self._texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)
        if self._texture is not None:
            gpu.state.blend_set("NONE")
            draw_texture_2d(self._texture, box[:2], box[2], box[3])

    def release(self) -> None:
        self._pixels = None  # the texture is Blender's to free, on the thread that draws
