# SPDX-License-Identifier: GPL-3.0-or-later
"""Neighbouring pixels share the light that arrives at them, as far as it can be alike."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext
from .frame import Frame, run_tiles

#: Each level shares light twice as far as the one before: 1, 2, 4, ... pixels.
LEVELS = 5
#: In the first pass: the error that sharing may bring, as a share of the light, and the radius (pixels) in which light
#: is shared even where surfaces are near.
TOLERANCE, LEAST_RADIUS = 0.5, 8.0
#: In small pictures less far, as a share of their shorter side: light from both sides is shared or none, so pixels near
#: an edge give more than they take, or less, and where light varies much the picture as a whole loses or gains.
LEAST_SHARE = 1.0 / 6.0
#: All shrink with this power of the number of passes, so that what sharing blurs vanishes as passes accumulate: noise
#: falls as their square root, and needs sharing less and less. The idea is that of Hachisuka et al. 2008, "Progressive
#: Photon Mapping".
SHRINKING = 1.0 / 3.0
#: What a pixel of a level costs, in rays.
COST = 1


class ReconstructPass:
    """Owns the shared light of one kind, diffuse or glossy: two pictures that take turns."""

    def __init__(self, gpu: GpuContext, *, glossy: bool) -> None:
        self.gpu = gpu
        self.glossy = glossy
        self._pictures: list[moderngl.Texture] = []
        self._size = (0, 0)

    @property
    def shared(self) -> moderngl.Texture | None:
        """What ``run`` was given last, shared; None: nothing was."""
        return self._pictures[0] if self._pictures else None

    def run(self, frame: Frame, light: moderngl.Texture, index: int) -> Iterator[float]:
        """Share ``light`` (w: mean of 1 / distance to what it comes from, 1/cells), found ``index`` times before.

        Yields the share done."""
        if self._size != frame.size:
            self.release()
            self._pictures = [self.gpu.texture("shared light", frame.size, 4, "f4") for _ in range(2)]
            self._size = frame.size
        steps = [(0, 0), *((1, level) for level in range(LEVELS - 1)), (2, LEVELS - 1)]
        for done, (step, level) in enumerate(steps):
            for share in self._step(frame, light, index, step, level):
                yield (done + share) / len(steps)
            self._pictures.reverse()
            light = self._pictures[0]

    def _step(self, frame: Frame, light: moderngl.Texture, index: int, step: int, level: int) -> Iterator[float]:
        shrunk = (1.0 + index) ** -SHRINKING
        least_radius = min(LEAST_RADIUS, min(frame.size) * LEAST_SHARE)
        kernel = self.gpu.kernel("reconstruct", frame.defines | {"GLOSSY": self.glossy, "STEP": step})

        def bind() -> None:
            frame.bind(kernel)
            self.gpu.use_source(light, "TEX_GATHERED")
            self._pictures[1].bind_to_image(interface.slot("IMG_0"), read=False, write=True)
            kernel.set(stride=1 << level, tolerance=TOLERANCE * shrunk, least_radius=least_radius * shrunk)
            if self.glossy:
                kernel.set(specular_aperture=frame.settings.specular_aperture)

        yield from run_tiles(self.gpu, "reconstruct", kernel, frame, COST, bind)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self._pictures)
        self._pictures = []
        self._size = (0, 0)
