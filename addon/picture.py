# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a lit scene: what its pixels show, the light that arrives there, and the film that keeps it.

surfaces -> direct light -> gather -> reflections -> sharing (-> light of earlier passes) -> film
"""

from __future__ import annotations

import dataclasses
from collections.abc import Generator

from . import checks
from .camera import CameraRays, pixel_offset
from .features import Features
from .gpu.context import GpuContext
from .grid import VoxelGrid
from .passes.compose import Film, PixelLight
from .passes.direct import DirectPass
from .passes.frame import Frame, Gather, LitVoxels
from .passes.gather import GatherPass
from .passes.history import LightHistory
from .passes.reconstruct import ReconstructPass
from .passes.reflect import ReflectPass
from .passes.surface import RAY_TEXELS, SurfacePass, Surfaces
from .passes.view import VOXEL_VIEWS, SeenRays, trace_rays
from .scene import SceneData
from .settings import Settings
from .steps import Memo, PipelineError, Progress

#: First random point of reflections that are found where none of earlier passes could be taken over.
FILLING = 1 << 20


class Picture:
    """Passes over the pixels of one view, and what they add up to."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.film = Film(gpu)
        #: Which outputs the film keeps, by the names of passes/compose.py.
        self.wanted: set[str] = {"combined"}
        self.surface = SurfacePass(gpu)
        self._direct = DirectPass(gpu)
        self._gather = GatherPass(gpu)
        self._sharing = {
            name: ReconstructPass(gpu, glossy=name.startswith("reflected"))
            for name in ("gathered", "gathered_emitted", "reflected", "reflected_emitted")
        }
        self._reflect = ReflectPass(gpu)
        self._history = LightHistory(gpu, glossy=False)
        self._glossy_history = LightHistory(gpu, glossy=True)
        self._memo = Memo()
        self._scene: SceneData | None = None
        self.settings = Settings()
        self._features: Features | None = None
        self.size = (0, 0)

    def check_size(self, size: tuple[int, int], features: Features | None = None) -> None:
        """Raises PipelineError where pictures of (width, height) pixels cannot be drawn, with such ``features``."""
        limit = int(self.gpu.mgl.info.get("GL_MAX_TEXTURE_SIZE", 16384))
        too_many = f"{size[0]} x {size[1]} pixels cannot be rendered at once: this graphics driver draws"
        if max(size) > limit or min(size) < 1:
            raise PipelineError(
                f"{too_many} 1 to {limit} a side; render a part of the frame (Ctrl-B) or a smaller percentage"
            )
        if features is not None and features.follows_glossy and RAY_TEXELS * size[0] > limit:
            raise PipelineError(
                f"{too_many} up to {limit // RAY_TEXELS} from left to right where reflections are sharp; render a part "
                "of the frame (Ctrl-B), or set Glossy Layers to 0"
            )

    def start(
        self,
        scene: SceneData,
        settings: Settings,
        size: tuple[int, int],
        features: Features,
        grid: VoxelGrid,
        surfaces: Surfaces,
        *,
        follows: bool,
    ) -> None:
        """Start the film at zero. ``follows``: as of ``Pipeline.prepare``."""
        self._scene, self.settings, self._features, self.size = scene, settings, features, size
        self.surface.allocate(size, len(surfaces.materials.batches))
        if not features.has_direct:
            self._direct.release()
        if not features.has_diffuse_gather:
            self._gather.release()
        if not features.has_glossy:
            self._reflect.release()
        self.camera = CameraRays.of(scene.camera, grid, size)
        self._start_history(scene, grid, features, follows=follows)
        self.film.start(size, self.wanted, adaptive=settings.noise_threshold > 0.0 and "combined" in self.wanted)

    def _start_history(self, scene: SceneData, grid: VoxelGrid, features: Features, *, follows: bool) -> None:
        """Light at pixels stays right while all but the camera stays; outputs say which kinds of it are kept."""
        settings = self.settings
        kept = []
        for history, keeps in (
            (self._history, features.keeps_light),
            (self._glossy_history, features.keeps_reflections),
        ):
            if keeps:
                kept.append(history)
            else:
                history.forget()
                history.release()
        if not kept:
            self._memo.forget("history")
            return
        inputs = (
            grid, scene.materials, scene.meshes, scene.instances, scene.lights, scene.world, self.size,
            tuple(vars(settings).values()), tuple(sorted(self.wanted)),
        )  # fmt: skip
        continues = not self._memo.stale("history", *inputs) and follows and settings.reuse_frames
        for history in kept:
            history.start(
                self.camera, settings.samples, settings.gather_interval, self.film.samples, continues=continues
            )
        self._memo.done("history", *inputs)

    def sample(self, lit: LitVoxels, surfaces: Surfaces) -> Generator[Progress, None, None]:
        """Add one pass to the film, of what ``start`` was told of."""
        scene, settings, features = self._scene, self.settings, self._features
        assert scene is not None and features is not None
        camera, index = self.camera, self.film.samples
        offset = pixel_offset(index, scene.pixel_filter_width)
        sample, gather = self._history.sample(index), self._history.gather(index)
        surface = self.surface.pictures
        assert surface is not None
        frame = Frame(index, sample, gather, camera, offset, surface, features, settings, self.film.active_tiles)
        if self.wanted <= set(VOXEL_VIEWS):
            self._add(frame, lit, scene, PixelLight())
            yield Progress(1.0, "Pass done")
            return
        for share in self.surface.run(surfaces, frame.view):
            yield Progress(0.2 * share, "Surfaces")
        if features.has_visible_lights:
            self.surface.show_lights(lit.lights, frame.view, settings)
        splits = self.film.splits_light
        if features.has_direct:
            for share in self._direct.run(frame, lit):
                yield Progress(0.2 + 0.2 * share, "Direct light")
        if features.has_diffuse_gather and gather is not None:
            for share in self._gather.run(frame, lit, self._direct.diffuse, keeps_emitted=splits):
                yield Progress(0.4 + 0.3 * share, "Indirect light")
        reflects = frame
        if features.has_glossy:
            self._reflect.allocate(self.size, emitted=splits, layers=features.follows_glossy)
            if features.keeps_reflections:
                turn = self._glossy_history.gather(index)
                reflects = dataclasses.replace(
                    frame, gather=turn, sample=turn.sample if turn else FILLING + frame.sample
                )
            if not features.keeps_reflections or reflects.gather is not None:
                for share in self._reflect.run(reflects, lit, self.surface, surfaces):
                    yield Progress(0.7 + 0.2 * share, "Reflections")
        lights = {
            "gathered": self._gather.incoming,
            "gathered_emitted": self._gather.emitted,
            "reflected": self._reflect.radiance,
            "reflected_emitted": self._reflect.emitted,
        }
        for number, (name, sharing) in enumerate(self._sharing.items()):
            light = lights[name]
            is_diffuse = name.startswith("gathered")
            found: Frame | Gather | None = gather
            if not is_diffuse:
                found = reflects.gather if features.keeps_reflections else frame
            if light is None or (is_diffuse and features.gather_cones) or not features.has_reconstruction:
                sharing.release()
                continue
            if found is not None:
                for share in sharing.run(frame, light, found.index):
                    yield Progress(0.9 + 0.05 * (number + share) / len(lights), "Sharing light")
                lights[name] = sharing.shared
            elif is_diffuse:
                lights[name] = sharing.shared
        if features.keeps_light:
            kept = [light for name, light in lights.items() if light is not None and name.startswith("gathered")]
            for share in self._history.run(frame, kept):
                yield Progress(0.95 + 0.02 * share, "Light of earlier passes")
            if gather is None:
                for share in self._gather.fill(frame, lit, kept):
                    yield Progress(0.97 + 0.03 * share, "Indirect light")
        if features.keeps_reflections:
            kept = [light for name, light in lights.items() if light is not None and name.startswith("reflected")]
            for share in self._glossy_history.run(reflects, kept):
                yield Progress(0.97 + 0.01 * share, "Light of earlier passes")
            if reflects.gather is None:
                for share in self._reflect.run(reflects, lit, self.surface, surfaces, fills=True):
                    yield Progress(0.98 + 0.02 * share, "Reflections")
        at_pixels = PixelLight(self._direct.diffuse, self._direct.glossy, **lights)
        if settings.debug_checks:
            checks.check_pixels(frame, at_pixels)
        self._add(frame, lit, scene, at_pixels)
        yield Progress(1.0, "Pass done")

    def _add(self, frame: Frame, lit: LitVoxels, scene: SceneData, light: PixelLight) -> None:
        """To the film."""
        self.film.add(frame, lit, scene, light)
        self.gpu.check()
        if self.settings.debug_checks:
            checks.check_film(self.film)

    def rays_at(self, place: tuple[float, float], lit: LitVoxels) -> SeenRays | None:
        """Rays that gather light at the surface seen at ``place``, as ``Pipeline.rays_at``."""
        surface = self.surface.pictures
        if surface is None or self._features is None or not self._features.has_geometry:
            return None
        frame = Frame(0, 0, None, self.camera, (0.5, 0.5), surface, self._features, self.settings)
        width, height = self.size
        return trace_rays(self.gpu, frame, lit, (int(place[0] * width), int(place[1] * height)))

    def release(self) -> None:
        """Free every GL object."""
        for part in (self.surface, self._direct, self._gather, self._reflect, self._history, self._glossy_history):
            part.release()
        for sharing in self._sharing.values():
            sharing.release()
        self.film.release()
        self._memo = Memo()
