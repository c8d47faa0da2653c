# SPDX-License-Identifier: GPL-3.0-or-later
"""Neighbouring pixels share the light they gathered, as far as it can be alike."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from .frame import Frame, run_tiles

#: Each level shares light twice as far as the one before: 1, 2, 4, ... pixels.
LEVELS = 5
#: In the first pass: the error that sharing may bring, as a share of the light, and the radius (pixels) in which light
#: is shared even where surfaces are near.
TOLERANCE, LEAST_RADIUS = 0.5, 8.0
#: Both shrink with this power of the number of passes, so that what sharing blurs vanishes as passes accumulate: noise
#: falls as their square root, and needs sharing less and less. The idea is that of Hachisuka et al. 2008, "Progressive
#: Photon Mapping".
SHRINKING = 1.0 / 3.0
#: What a pixel of a level costs, in rays.
COST = 1


class ReconstructPass:
    """Owns the shared light: two pictures that take turns."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self._pictures: list[moderngl.Texture] = []
        self._size = (0, 0)

    @property
    def gathered(self) -> moderngl.Texture | None:
        """As GatherPass.incoming; None: there is nothing to share."""
        return self._pictures[0] if self._pictures else None

    def run(self, frame: Frame, gathered: moderngl.Texture) -> Iterator[float]:
        """Share ``gathered``. Yields the share done."""
        if self._size != frame.size:
            self.release()
            self._pictures = [self.gpu.texture("shared light", frame.size, 4, "f4") for _ in range(2)]
            self._size = frame.size
        kernel = self.gpu.kernel("reconstruct", frame.defines)
        for level in range(LEVELS):
            for share in self._level(kernel, frame, gathered, level):
                yield (level + share) / LEVELS
            self._pictures.reverse()
            gathered = self._pictures[0]

    def _level(self, kernel: Kernel, frame: Frame, gathered: moderngl.Texture, level: int) -> Iterator[float]:
        shrunk = (1.0 + frame.index) ** -SHRINKING

        def bind() -> None:
            frame.bind(kernel)
            gathered.use(interface.slot("TEX_GATHERED"))
            self._pictures[1].bind_to_image(interface.slot("IMG_0"), read=False, write=True)
            kernel.set(stride=1 << level, tolerance=TOLERANCE * shrunk, least_radius=LEAST_RADIUS * shrunk)

        yield from run_tiles(self.gpu, "reconstruct", kernel, frame, COST, bind)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self._pictures)
        self._pictures = []
        self._size = (0, 0)
