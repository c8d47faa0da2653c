# SPDX-License-Identifier: GPL-3.0-or-later
"""Diffuse light gathered at pixels: from voxel faces, from the world."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext
from .emitters import PIXEL_SAMPLES
from .frame import Frame, Gather, LitVoxels, run_tiles
from .world import PIXEL_SAMPLES as WORLD_SAMPLES


class GatherPass:
    """Owns the mean incoming radiance at each pixel, and on demand what comes straight from the world or emitters."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.incoming: moderngl.Texture | None = None
        self.emitted: moderngl.Texture | None = None
        self._nearness: moderngl.Texture | None = None
        self._key: tuple = ()

    def allocate(self, size: tuple[int, int], *, emitted: bool, nearness: bool) -> None:
        """Make the pictures; kept when nothing changed."""
        if self._key == (size, emitted, nearness):
            return
        self.release()
        self.incoming = self.gpu.texture("indirect light", size, 4, "f4")
        self.emitted = self.gpu.texture("indirect light", size, 4, "f4") if emitted else None
        self._nearness = self.gpu.texture("indirect light", size, 1, "f4") if nearness else None
        self._key = (size, emitted, nearness)

    def run(
        self, frame: Frame, lit: LitVoxels, direct: moderngl.Texture | None, *, keeps_emitted: bool
    ) -> Iterator[float]:
        """Yields the share done. ``keeps_emitted``: fill ``emitted`` too.

        ``direct``: where points on emitters were drawn, the diffuse picture of pass ``direct``, to which rays add what
        they find of them.
        """
        assert frame.gather is not None
        features = frame.features
        nearness = features.has_reconstruction and not features.gather_cones  # what cones bring is not shared
        self.allocate(frame.size, emitted=keeps_emitted, nearness=nearness)
        assert self.incoming is not None
        yield from self._trace(frame, lit, frame.gather, [self.incoming, self.emitted], direct)

    def fill(self, frame: Frame, lit: LitVoxels, lights: Sequence[moderngl.Texture]) -> Iterator[float]:
        """Gather for the pixels where w of ``lights`` is negative: incoming, perhaps emitted. Yields the share done."""
        incoming, emitted = (*lights, None)[:2]
        assert incoming is not None
        yield from self._trace(frame, lit, None, [incoming, emitted], None)

    def _trace(
        self,
        frame: Frame,
        lit: LitVoxels,
        gather: Gather | None,  # None: it fills
        pictures: Sequence[moderngl.Texture | None],
        direct: moderngl.Texture | None,
    ) -> Iterator[float]:
        features, settings = frame.features, frame.settings
        incoming, emitted = pictures
        assert incoming is not None
        fills = gather is None
        nearness = None if fills else self._nearness
        glow_is_direct = features.gathers_emission and features.draws_emitters_at_pixels
        kernel = self.gpu.kernel(
            "gather",
            frame.defines
            | lit.voxels.trace_defines
            | lit.world.defines
            | {
                "GATHER_CONES": features.gather_cones,
                "GATHER_OCCLUSION": features.gather_occlusion,
                "HAS_EMITTERS": features.gathers_emission,
                "GLOW_IS_DIRECT": glow_is_direct,
                "WORLD_IS_DRAWN": features.draws_world_at_pixels,
                "KEEPS_EMITTED": emitted is not None,
                "KEEPS_NEARNESS": nearness is not None,
                "FILLS": fills,
                "HAS_GUIDES": features.has_guides,
            },
        )
        limit = settings.ao_distance if features.gather_occlusion else settings.max_distance

        def bind() -> None:
            lit.bind(kernel)
            frame.bind(kernel)
            if features.gather_cones:
                lit.cones.bind(kernel)
            if features.has_guides:
                lit.guides.bind()
            incoming.bind_to_image(interface.slot("IMG_0"), read=fills, write=True)
            if emitted is not None:
                emitted.bind_to_image(interface.slot("IMG_1"), read=False, write=True)
            if features.gathers_emission:
                lit.emitters.bind(kernel, PIXEL_SAMPLES if features.draws_emitters_at_pixels else 0)
                # Emission is direct light: what multiplies this picture later is divided out.
                amount = 1.0 if glow_is_direct else settings.direct_amount / settings.indirect_amount
                kernel.set(emission_amount=amount)
            if features.draws_world_at_pixels:
                lit.world.bind_drawn(kernel, WORLD_SAMPLES, table=False)
            if gather is not None:
                if nearness is not None:
                    nearness.bind_to_image(interface.slot("IMG_2"), read=True, write=True)
                    kernel.set(pass_index=gather.index)
                if glow_is_direct:
                    assert direct is not None
                    direct.bind_to_image(interface.slot("IMG_3"), read=True, write=True)
            kernel.set(
                sample_index=frame.sample if gather is None else gather.sample,
                ray_count=settings.rays,
                random_seed=settings.seed,
                max_distance=limit / lit.voxels.grid.cell_size if limit > 0.0 else 1e30,
                clamp_indirect=settings.clamp_indirect,
            )

        yield from run_tiles(self.gpu, "gather", kernel, frame, settings.rays, bind)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.incoming, self.emitted, self._nearness)
        self.incoming = self.emitted = self._nearness = None
        self._key = ()
