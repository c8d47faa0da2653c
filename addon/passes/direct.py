# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that comes to pixels straight from lights, emitters and a concentrated world, with shadows."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext
from .emitters import PIXEL_SAMPLES
from .frame import Frame, LitVoxels, run_tiles
from .world import PIXEL_SAMPLES as WORLD_SAMPLES


class DirectPass:
    """Owns irradiance / pi and reflected radiance at each pixel; the second only where something is glossy."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.diffuse: moderngl.Texture | None = None
        self.glossy: moderngl.Texture | None = None
        self._key: tuple = ()

    def allocate(self, size: tuple[int, int], *, glossy: bool) -> None:
        """Make the pictures; kept when nothing changed."""
        if self._key == (size, glossy):
            return
        self.release()
        self.diffuse = self.gpu.texture("direct light", size, 4, "f4")
        self.glossy = self.gpu.texture("direct light", size, 4, "f4") if glossy else None
        self._key = (size, glossy)

    def run(self, frame: Frame, lit: LitVoxels) -> Iterator[float]:
        """Yields the share done."""
        features, settings, lights = frame.features, frame.settings, lit.lights
        self.allocate(frame.size, glossy=features.has_glossy)
        kernel = self.gpu.kernel(
            "direct",
            frame.defines
            | lit.voxels.trace_defines
            | lights.defines(settings)
            | {
                "HAS_LIGHTS": features.has_lights,
                "HAS_EMITTERS": features.draws_emitters_at_pixels,
                "WORLD_IS_DRAWN": features.draws_world_at_pixels,
                "WORLD_IS_TEXTURE": features.draws_world_at_pixels,
                "HAS_GLOSSY": features.has_glossy,
                "HAS_TRANSMISSION": features.has_transmission,
                "SHADOW_CONES": features.shadow_cones,
            },
        )
        drawn = features.draws_emitters_at_pixels + features.draws_world_at_pixels
        rays = features.has_lights * lights.rays(settings) + drawn
        reach = settings.max_distance / lit.voxels.grid.cell_size

        def bind() -> None:
            lit.bind(kernel)
            frame.bind(kernel)
            if features.has_lights:
                lights.bind(kernel, settings)
            if features.draws_emitters_at_pixels:
                lit.emitters.bind(kernel, PIXEL_SAMPLES)
                kernel.set(
                    gathered_rays=settings.rays if features.gathers_emission and frame.gather else 0,
                    reflected_rays=1 if features.reflects_emission else 0,
                )
            if features.draws_world_at_pixels:
                lit.world.bind_drawn(kernel, WORLD_SAMPLES, table=True)
                # The world's light is indirect light: what multiplies these pictures later is divided out.
                kernel.set(
                    world_rays=settings.rays,  # where this pass gathers none, it looks up what others have gathered
                    world_on_diffuse=features.has_diffuse_gather * settings.indirect_amount / settings.direct_amount,
                    world_on_glossy=1.0 / settings.direct_amount,
                    clamp_indirect=settings.clamp_indirect,
                )
            if drawn:
                kernel.set(max_distance=reach if reach > 0.0 else 1e30, specular_aperture=settings.specular_aperture)
            assert self.diffuse is not None
            self.diffuse.bind_to_image(interface.slot("IMG_0"), read=False, write=True)
            if self.glossy is not None:
                self.glossy.bind_to_image(interface.slot("IMG_1"), read=False, write=True)
            kernel.set(
                sample_index=frame.sample,
                random_seed=settings.seed,
                use_shadows=settings.use_shadows,
                shadow_amount=settings.shadow_amount,
            )
            if features.has_glossy:
                kernel.set(specular_aperture=settings.specular_aperture)
            if features.shadow_cones:
                lit.cones.bind(kernel)
                kernel.set(shadow_cone_angle=settings.shadow_cone_angle)

        yield from run_tiles(self.gpu, "direct", kernel, frame, rays, bind)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.diffuse, self.glossy)
        self.diffuse = self.glossy = None
        self._key = ()
