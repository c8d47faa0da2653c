# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflections: one direction of the GGX lobe at each pixel in each pass, followed from surface to surface.

What a ray meets is looked up in the voxels, unless it stands for an area smaller than they are: sharp reflections show
the scene. There the surface is shaded as one that the camera sees, with a layer of surface pictures of its own: its
material, direct light with shadows, gathered light. Its own reflection is the next layer's, and so on while there are
pixels whose lobe is sharp.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import moderngl
import numpy as np

from ..features import SHARP_REACH, SHARP_WIDTH, SPREAD_OF_ALPHA
from ..gpu import interface
from ..gpu.context import GpuContext
from .direct import DirectPass
from .emitters import PIXEL_SAMPLES
from .frame import Frame, Gather, LitVoxels, run_tiles
from .gather import GatherPass
from .surface import SurfacePass, SurfacePictures, Surfaces
from .world import PIXEL_SAMPLES as WORLD_SAMPLES


class ReflectPass:
    """Owns the reflected radiance at each pixel, and on demand what of it comes straight from lights, emitters or the
    world.

    Where something is sharp, it owns a layer too: what the reflected rays have met last.
    """

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.radiance: moderngl.Texture | None = None
        self.emitted: moderngl.Texture | None = None
        self._layer: SurfacePictures | None = None
        self._throughput: moderngl.Texture | None = None
        self._followed: moderngl.Buffer | None = None
        self._direct = DirectPass(gpu)
        self._gather = GatherPass(gpu)
        self._key: tuple = ()

    def allocate(self, size: tuple[int, int], *, emitted: bool, layers: bool) -> None:
        """Make the pictures; kept when nothing changed."""
        if self._key == (size, emitted, layers):
            return
        self.release()
        gpu = self.gpu
        self.radiance = gpu.texture("reflections", size, 4, "f4")
        self.emitted = gpu.texture("reflections", size, 4, "f4") if emitted else None
        if layers:
            self._layer = SurfacePictures.allocate(gpu, "reflected surfaces", size, rays=True)
            self._throughput = gpu.texture("reflected surfaces", size, 4, "f4")
            self._followed = gpu.buffer("reflected surfaces", size=16)
        self._key = (size, emitted, layers)

    def run(
        self, frame: Frame, lit: LitVoxels, surface_pass: SurfacePass, surfaces: Surfaces, *, fills: bool = False
    ) -> Iterator[float]:
        """Yields the share done. ``fills``: only where w of ``radiance`` is negative. Call ``allocate`` before."""
        features, settings = frame.features, frame.settings
        layers = settings.glossy_layers if features.follows_glossy else 0
        keeps_emitted = self.emitted is not None
        for share in self._reflect(frame, lit, first=True, last=layers == 0, fills=fills):
            yield share / (1 + layers)
        for number in range(1, layers + 1):
            assert self._layer is not None and self._followed is not None
            if not np.frombuffer(self._followed.read(4), np.uint32)[0]:
                return
            layer = _layer_frame(frame, self._layer, number)
            before = number / (1 + layers)
            for _ in self._shade(layer, lit, surface_pass, surfaces, keeps_emitted=keeps_emitted and number == 1):
                yield before
            for _ in self._reflect(layer, lit, first=False, last=number == layers):
                yield before

    def _reflect(
        self, frame: Frame, lit: LitVoxels, *, first: bool, last: bool, fills: bool = False
    ) -> Iterator[float]:
        """One ray from each pixel of a layer, and where it leads."""
        features, settings, slot = frame.features, frame.settings, interface.slot
        keeps_emitted = first and self.emitted is not None
        kernel = self.gpu.kernel(
            "reflect",
            frame.defines
            | lit.voxels.trace_defines
            | lit.lights.defines(settings)
            | lit.world.defines
            | {
                "HAS_LIGHTS": features.has_lights,
                "GATHER_OCCLUSION": features.gather_occlusion,
                "HAS_EMITTERS": features.reflects_emission,
                "WORLD_IS_DRAWN": features.draws_world_at_pixels,
                "KEEPS_EMITTED": keeps_emitted,
                "FIRST_LAYER": first,
                "FILLS": fills,
                "HAS_LAYERS": self._layer is not None,
                "HAS_TRANSMISSION": features.has_transmission,
                "SHARP_WIDTH": SHARP_WIDTH,
                "SHARP_REACH": SHARP_REACH,
                "SPREAD_OF_ALPHA": SPREAD_OF_ALPHA,
            },
        )
        limit = settings.ao_distance if features.gather_occlusion else settings.max_distance
        if self._followed is not None:
            self._followed.clear()

        def bind() -> None:
            lit.bind(kernel)
            frame.bind(kernel)
            if features.has_lights:
                lit.lights.bind(kernel, settings)
                kernel.set(light_points=1.0 if features.has_direct else 0.0)
            assert self.radiance is not None
            self.radiance.bind_to_image(slot("IMG_0"), read=True, write=True)
            if keeps_emitted:
                assert self.emitted is not None
                self.emitted.bind_to_image(slot("IMG_1"), read=False, write=True)
            if self._layer is not None:
                assert self._layer.rays is not None and self._throughput is not None and self._followed is not None
                self._layer.seen.bind_to_image(slot("IMG_2"), read=False, write=True)
                self._layer.position.bind_to_image(slot("IMG_3"), read=False, write=True)
                self._throughput.bind_to_image(slot("IMG_4"), read=True, write=True)
                self._layer.rays.bind_to_image(slot("IMG_5" if first else "IMG_RAYS"), read=True, write=True)
                self._followed.bind_to_storage_buffer(slot("BUF_COUNTS"))
                kernel.set(last_layer=last)
            if features.reflects_emission:
                lit.emitters.bind(kernel, PIXEL_SAMPLES if features.draws_emitters_at_pixels else 0)
                kernel.set(emission_amount=settings.direct_amount)
            if features.draws_world_at_pixels:
                lit.world.bind_drawn(kernel, WORLD_SAMPLES, table=False)
            kernel.set(
                sample_index=frame.sample,
                random_seed=settings.seed,
                max_distance=limit / lit.voxels.grid.cell_size if limit > 0.0 else 1e30,
                specular_aperture=settings.specular_aperture,
                clamp_indirect=settings.clamp_indirect,
                amount=1.0 if first else settings.specular_amount,  # composition has it for the first
            )

        yield from run_tiles(self.gpu, "reflect", kernel, frame, 1, bind)

    def _shade(
        self, frame: Frame, lit: LitVoxels, surface_pass: SurfacePass, surfaces: Surfaces, *, keeps_emitted: bool
    ) -> Iterator[float]:
        """Light that leaves the surfaces that were met, as if the camera saw them; all but what they reflect."""
        features, settings, slot = frame.features, frame.settings, interface.slot
        yield from surface_pass.shade(surfaces, frame.surface, frame.view)
        if features.has_direct:
            yield from self._direct.run(frame, lit)
        else:
            self._direct.release()
        if features.has_diffuse_gather:
            yield from self._gather.run(frame, lit, self._direct.diffuse, keeps_emitted=False)
        else:
            self._gather.release()
        with self.gpu.timed("reflect"):
            kernel = self.gpu.kernel(
                "collect",
                frame.defines
                | lit.world.defines
                | {
                    "HAS_DIRECT": features.has_direct,
                    "WORLD_IS_DRAWN": features.draws_world_at_pixels,
                    "HAS_DIFFUSE_GATHER": features.has_diffuse_gather,
                    "KEEPS_EMITTED": keeps_emitted,
                },
            )
            frame.bind(kernel)
            frame.surface.emission.use(slot("TEX_EMISSION"))
            lit.world.bind(kernel)
            for name, texture in (
                ("TEX_DIRECT_DIFFUSE", self._direct.diffuse),
                ("TEX_DIRECT_GLOSSY", self._direct.glossy),
                ("TEX_GATHERED", self._gather.incoming),
            ):
                if texture is not None:
                    texture.use(slot(name))
            assert self.radiance is not None and self._throughput is not None
            self.radiance.bind_to_image(slot("IMG_0"), read=True, write=True)
            self._throughput.bind_to_image(slot("IMG_4"), read=True, write=False)
            if keeps_emitted:
                assert self.emitted is not None
                self.emitted.bind_to_image(slot("IMG_1"), read=True, write=True)
            kernel.set(
                direct_amount=settings.direct_amount if settings.use_direct else 0.0,
                indirect_amount=settings.indirect_amount if settings.use_indirect else 0.0,
                specular_amount=settings.specular_amount,
                clamp_indirect=settings.clamp_indirect,
            )
            kernel.run_tiles(*frame.size)
            self.gpu.barrier()  # the next layer adds to the same picture

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.radiance, self.emitted, self._throughput, self._followed)
        self.radiance = self.emitted = self._throughput = self._followed = None
        if self._layer is not None:
            self._layer.release(self.gpu)
            self._layer = None
        self._direct.release()
        self._gather.release()
        self._key = ()


def _layer_frame(frame: Frame, layer: SurfacePictures, number: int) -> Frame:
    """The pass over layer ``number``, with random points of its own.

    What rays of two layers bring is a product, so their points must be independent, not shifted copies: each layer
    walks the sequence in strides of its own. (Odd: no point is lost; large: neighbours here are far apart there.)
    """
    stride = (0x9E3779B1 * (2 * number + 1)) & 0xFFFFFFFF
    settings = frame.settings.with_values(rays=1, seed=(frame.settings.seed + 0x632BE5AB * number) & 0x7FFFFFFF)
    features = dataclasses.replace(frame.features, has_reconstruction=False)
    sample = (frame.sample * stride) & 0xFFFFFFFF
    gather = Gather(frame.index, sample)  # in every pass: what is met differs from one to the next
    return dataclasses.replace(frame, surface=layer, settings=settings, features=features, sample=sample, gather=gather)
