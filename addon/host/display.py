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


class Inbox(Protocol):
    """Where finished pictures are put. Called where the film's context is current, maybe on a thread of our own."""

    def begin(self, context: Any) -> None:
        """Pictures come from another ``GpuContext`` from now on."""

    def keep(self, film: Any, name: str) -> None:
        """Take over one of the film's outputs."""

    def end(self) -> None:
        """No more pictures come, and what is in their context is to be freed."""


class Display(Protocol):
    """Draws the last picture that was finished. Belongs to the thread that Blender draws on, where it also ends."""

    @property
    def inbox(self) -> Inbox:
        """Where it finds the picture."""

    def draw(self, box: Box) -> None:
        """Draw it, if there is one, into the region that Blender draws. Called in ``view_draw``."""


class SharedDisplay:
    """Film and region are in one GL context: the picture never leaves the GPU."""

    def __init__(self) -> None:
        self._context: Any = None
        self._present: Any = None

    @property
    def inbox(self) -> Inbox:
        return self

    def begin(self, context: Any) -> None:
        from ..passes.present import PresentPass

        self._context, self._present = context, PresentPass(context)  # what was in the other is freed with it

    def keep(self, film: Any, name: str) -> None:
        self._present.keep(film, name)

    def end(self) -> None:
        if self._present is not None:
            self._present.release()
        self._context = self._present = None

    def draw(self, box: Box) -> None:
        if self._context is None:
            return
        with self._context.guard():  # Blender's framebuffer is bound: the guard of what was rendered has ended
            self._present.draw(box)


class _ReadPixels:
    """Pictures that were read back, on their way to the thread that draws them."""

    def __init__(self) -> None:
        self._pixels: np.ndarray | None = None  # (H, W, 4) float32

    def begin(self, context: Any) -> None:
        pass  # the picture is in no context

    def keep(self, film: Any, name: str) -> None:
        picture = np.nan_to_num(film.read_mean(name), nan=0.0)
        self._pixels = np.clip(picture, -_LARGEST_HALF, _LARGEST_HALF)

    def end(self) -> None:
        self._pixels = None

    def take(self) -> np.ndarray | None:
        """The last picture; None when it was taken before."""
        pixels, self._pixels = self._pixels, None
        return pixels


class UploadedDisplay:
    """Blender draws with something else than GL: pictures are read back and uploaded."""

    def __init__(self) -> None:
        self._pixels = _ReadPixels()
        self._texture: gpu.types.GPUTexture | None = None  # Blender's to free, on the thread that draws

    @property
    def inbox(self) -> Inbox:
        return self._pixels

    def draw(self, box: Box) -> None:
        pixels = self._pixels.take()
        if pixels is not None:
            height, width, _ = pixels.shape
            data = gpu.types.Buffer("FLOAT", pixels.shape, np.ascontiguousarray(pixels))
            self._texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)
        if self._texture is not None:
            gpu.state.blend_set("NONE")
            draw_texture_2d(self._texture, box[:2], box[2], box[3])
