# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflections at pixels: one direction of the GGX lobe in each pass."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext
from .emitters import PIXEL_SAMPLES
from .frame import Frame, LitVoxels, run_tiles


class ReflectPass:
    """Owns the reflected radiance at each pixel; what of it comes straight from lights, emitters or the world is
    kept when asked for."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.radiance: moderngl.Texture | None = None
        self.emitted: moderngl.Texture | None = None
        self._key: tuple = ()

    def allocate(self, size: tuple[int, int], *, emitted: bool) -> None:
        """Make the pictures; kept when nothing changed."""
        if self._key == (size, emitted):
            return
        self.release()
        self.radiance = self.gpu.texture("reflections", size, 4, "f4")
        self.emitted = self.gpu.texture("reflections", size, 4, "f4") if emitted else None
        self._key = (size, emitted)

    def run(self, frame: Frame, lit: LitVoxels, *, keeps_emitted: bool) -> Iterator[float]:
        """Yields the share done. ``keeps_emitted``: fill ``emitted`` too."""
        features, settings = frame.features, frame.settings
        self.allocate(frame.size, emitted=keeps_emitted)
        kernel = self.gpu.kernel(
            "reflect",
            lit.voxels.trace_defines
            | lit.lights.defines(settings)
            | lit.world.defines
            | {
                "HAS_LIGHTS": features.has_lights,
                "GATHER_OCCLUSION": features.gather_occlusion,
                "HAS_EMITTERS": features.reflects_emission,
                "KEEPS_EMITTED": keeps_emitted,
            },
        )
        limit = settings.ao_distance if features.gather_occlusion else settings.max_distance

        def bind() -> None:
            lit.bind(kernel)
            frame.bind(kernel)
            if features.has_lights:
                lit.lights.bind(kernel, settings)
            assert self.radiance is not None
            self.radiance.bind_to_image(interface.slot("IMG_0"), read=False, write=True)
            if self.emitted is not None:
                self.emitted.bind_to_image(interface.slot("IMG_1"), read=False, write=True)
            if features.reflects_emission:
                lit.emitters.bind(kernel, PIXEL_SAMPLES if features.draws_emitters_at_pixels else 0)
                kernel.set(emission_amount=settings.direct_amount)
            kernel.set(
                sample_index=frame.index,
                random_seed=settings.seed,
                max_distance=limit / lit.voxels.grid.cell_size if limit > 0.0 else 1e30,
                specular_aperture=settings.specular_aperture,
                clamp_indirect=settings.clamp_indirect,
            )

        yield from run_tiles(self.gpu, "reflect", kernel, frame.size, 1, bind)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.radiance, self.emitted)
        self.radiance = self.emitted = None
        self._key = ()
