# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture that a screen shows while the film begins anew."""

from __future__ import annotations

from typing import Any

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext
from .compose import Film


class PresentPass:
    """Owns a copy of the last picture that was finished, and draws it."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self._picture: moderngl.Texture | None = None
        self._vertices: Any = None

    def keep(self, film: Film, name: str) -> None:
        """Copy one of the film's outputs."""
        if self._picture is None or self._picture.size != film.size:
            self.release()
            self._picture = self.gpu.texture("picture shown", film.size, 4, "f4", linear=True)
        film.copy_mean(name, self._picture)

    def draw(self, box: tuple[int, int, int, int]) -> None:
        """Draw what was kept into ``box`` (left, bottom, width, height in pixels) of the framebuffer that is bound."""
        if self._picture is None:
            return
        gpu = self.gpu
        if self._vertices is None:
            self._vertices = gpu.make(
                "vertex arrays", 0, lambda: gpu.mgl.vertex_array(gpu.program("present"), [])
            )
        size: Any = gpu.program("present")["box_size"]
        size.value = box[2:]
        self._picture.use(interface.slot("TEX_VALUE"))
        gpu.draw_over(box, self._vertices, 3)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self._picture, self._vertices)
        self._picture = self._vertices = None
