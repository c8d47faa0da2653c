# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame, top to bottom. One pipeline serves a viewport, an F12 render or a preview; it knows nothing of Blender.

    prepare: materials -> geometry -> emitters -> voxels -> lights -> injection -> links -> bounces (-> guides, cones)
    sample:  surfaces -> direct light -> gather -> reflections -> sharing (-> light of earlier passes) -> film

Each step of ``prepare`` is redone only when something it depends on has changed. Both are generators that yield between
pieces of work of well under half a second, so that a caller can show progress and stop.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import checks
from .camera import CameraRays, pixel_offset
from .edit import MAX_INSTANCES, Edit, edit_between
from .features import Features
from .gpu.context import GpuContext
from .gpu.interface import NONE_INDEX
from .grid import VoxelGrid
from .levels import Plan, coarsened
from .passes.bounce import BouncePass, LinkPass
from .passes.compose import Film, PixelLight
from .passes.cones import ConeVolume
from .passes.direct import DirectPass
from .passes.emitters import EmitterTable
from .passes.face_changes import FaceChanges
from .passes.frame import Frame, Gather, LitVoxels
from .passes.gather import GatherPass
from .passes.geometry import GeometryPass
from .passes.guide import GuidePass
from .passes.history import LightHistory
from .passes.inject import InjectPass, LightTable
from .passes.materials import MaterialPass, Repainted, repainted
from .passes.reconstruct import ReconstructPass
from .passes.reflect import ReflectPass
from .passes.surface import RAY_TEXELS, SurfacePass, Surfaces
from .passes.view import VOXEL_VIEWS, SeenRays, trace_rays
from .passes.voxelize import VoxelizePass
from .passes.world import WorldLight
from .scene import SceneData
from .settings import Settings
from .sharing import shares_triangles

#: Share of the bricks up to which voxels are taken over from those before.
MOST_CHANGED = 0.5
#: First random point of reflections that are found where none of earlier passes could be taken over.
FILLING = 1 << 20


class PipelineError(RuntimeError):
    """Something could not be rendered. The text is a sentence for the user."""


@dataclass(frozen=True)
class Progress:
    """How far a generator is, 0..1, and what it is doing."""

    fraction: float
    text: str


class _Memo:
    """Which steps are still valid: a step is redone when its inputs differ or a step before it was redone."""

    def __init__(self) -> None:
        self._keys: dict[str, tuple] = {}

    def has(self, step: str) -> bool:
        return step in self._keys

    def stale(self, step: str, *inputs: Any) -> bool:
        old = self._keys.get(step)
        same = (
            old is not None and len(old) == len(inputs) and all(_same(a, b) for a, b in zip(old, inputs, strict=True))
        )
        if not same:
            self._keys.pop(step, None)  # it is about to be redone, and may be interrupted
        return not same

    def done(self, step: str, *inputs: Any) -> None:
        self._keys[step] = inputs

    def copy(self) -> _Memo:
        """As it is now."""
        made = _Memo()
        made._keys = dict(self._keys)
        return made

    def forget(self, *steps: str) -> None:
        for step in steps:
            self._keys.pop(step, None)


def _same(a: Any, b: Any) -> bool:
    if a is b:
        return True
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return isinstance(a, (int, float, str, bool, VoxelGrid, Plan)) and type(a) is type(b) and a == b


class Pipeline:
    """Renders one scene into a film. All GL objects live in ``gpu`` and are freed by ``release``."""

    def __init__(self, gpu: GpuContext, *, is_live: bool = False) -> None:
        """``is_live``: somebody edits the scene. What an edit can take over is kept: 8 bytes for each voxel face."""
        self.gpu = gpu
        self._is_live = is_live
        self.film = Film(gpu)
        self._wanted: set[str] = {"combined"}
        self._memo = _Memo()
        self._materials = MaterialPass(gpu)
        self._geometry = GeometryPass(gpu)
        self._emitters = EmitterTable(gpu)
        self._voxelize = VoxelizePass(gpu)
        self._world = WorldLight(gpu)
        self._lights = LightTable(gpu)
        self._inject = InjectPass(gpu)
        self._links = LinkPass(gpu)
        self._bounce = BouncePass(gpu)
        self._cones = ConeVolume(gpu)
        self._guides = GuidePass(gpu)
        self._surface = SurfacePass(gpu)
        self._direct = DirectPass(gpu)
        self._gather = GatherPass(gpu)
        self._sharing = {
            name: ReconstructPass(gpu, glossy=name.startswith("reflected"))
            for name in ("gathered", "gathered_emitted", "reflected", "reflected_emitted")
        }
        self._reflect = ReflectPass(gpu)
        self._history = LightHistory(gpu, glossy=False)
        self._glossy_history = LightHistory(gpu, glossy=True)
        self._scene: SceneData | None = None
        self._placed: SceneData | None = None  # what the geometry was made of
        self._repainted: Repainted | None = None  # what looks different since voxels were made
        self._settings = Settings()
        self._size = (0, 0)
        self._emitter_version = self._radiance_version = 0
        #: Of the last ``prepare`` that did any: cells that were voxelized, faces that were linked to others and lit.
        self.redone = {"cells": 0, "linked_faces": 0, "lit_faces": 0}
        self._failed_with_geometry = False  # the last error came after the geometry was there
        #: Settings of voxels that did not fit, and what to set in place of them.
        self._coarsened: tuple[tuple, dict[str, Any]] | None = None
        self._plan: Plan | None = None
        self._middle: tuple[float, ...] = ()  # of nested levels
        self.features: Features | None = None
        self.grid: VoxelGrid | None = None
        self.warnings: list[str] = []

    def want(self, names: Iterable[str]) -> None:
        """Which outputs the film keeps, by the names of passes/compose.py; call before ``prepare``.

        The picture is always among them, but where nothing is asked for but voxels.
        """
        self._wanted = set(names)
        if not self._wanted or not self._wanted <= set(VOXEL_VIEWS):
            self._wanted.add("combined")

    # Voxels -----------------------------------------------------------------------------------------------------

    def prepare(
        self, scene: SceneData, settings: Settings, size: tuple[int, int], *, follows: bool = False
    ) -> Iterator[Progress]:
        """Bring voxels and light up to date for ``scene`` and start the film at zero, ``size`` pixels.

        ``follows``: it is the next frame of an animation, and may take over light from the last one. Where memory does
        not suffice, voxels become coarser, with a warning.
        Raises PipelineError, MemoryError, ShaderError, GpuUnavailable, and has let go of everything then.
        A generator that is not run to its end leaves no half-done step:
        the next call does that step again.
        """
        wanted = (
            settings.voxel_auto, settings.voxel_resolution, settings.memory_budget, settings.bounce_rays,
            settings.voxel_levels, settings.voxel_detail, size, scene.meshes, scene.instances,
        )  # fmt: skip
        while True:
            coarser = self._coarsened[1] if self._coarsened and _same(self._coarsened[0], wanted) else {}
            fitting = settings.with_values(**coarser)
            try:
                yield from self._letting_go(self._prepare(scene, fitting, size, follows))
                break
            except MemoryError:
                coarser = coarsened(self._plan, self.grid) if self._failed_with_geometry else {}
                if not coarser:
                    self._coarsened = None
                    raise
                self._coarsened = wanted, coarser
        if coarser:
            along = "the sides of levels" if coarser["voxel_levels"] == "ON" else "the longest side"
            self.warnings.append(
                f"There is no memory for finer voxels: {coarser['voxel_resolution']} are used along {along}"
            )

    def _letting_go(self, steps: Generator[Progress, None, None]) -> Iterator[Progress]:
        """``steps``; when one fails, lets go of everything, and of what that step has made so far."""
        before = self.gpu.alive()
        try:
            for progress in steps:
                ours = self.gpu.alive()
                yield progress
                before |= self.gpu.alive() - ours  # made meanwhile by others in this context
        except Exception:
            self._failed_with_geometry = self._memo.has("geometry")
            self.release()
            self.gpu.free_since(before)
            raise
        finally:
            steps.close()

    def _prepare(
        self, scene: SceneData, settings: Settings, size: tuple[int, int], follows: bool
    ) -> Generator[Progress, None, None]:
        limit = int(self.gpu.mgl.info.get("GL_MAX_TEXTURE_SIZE", 16384))
        too_many = f"{size[0]} x {size[1]} pixels cannot be rendered at once: this graphics driver draws"
        if max(size) > limit or min(size) < 1:
            raise PipelineError(
                f"{too_many} 1 to {limit} a side; render a part of the frame (Ctrl-B) or a smaller percentage"
            )
        self._scene, self._settings, self._size = scene, settings, size
        self.gpu.times.clear()  # statistics are those of one picture
        redone = dict.fromkeys(self.redone, 0)
        memo, warnings = self._memo, list(scene.warnings)

        uv_layers = tuple(sorted({name for mesh in scene.meshes for name in mesh.uv_layers}))
        if memo.stale("materials", scene.materials, uv_layers):
            yield Progress(0.0, "Compiling materials")
            looked = self._materials.set
            with self.gpu.timed("materials"):
                found = repainted(looked, self._materials.run(scene.materials, uv_layers))
            if found is None or (self.grid and self.grid.levels):  # levels are made again as a whole
                memo.forget("geometry", "emitters", "voxels")
            else:
                self._repainted = found.and_before(self._repainted)
                if found.glows.any():
                    memo.forget("emitters")
            memo.done("materials", scene.materials, uv_layers)
        materials = self._materials.set
        assert materials is not None
        warnings += materials.compiled.warnings

        if memo.stale("world", scene.world):
            memo.forget("links")
            self._world.run(scene.world)
            memo.done("world", scene.world)
        warnings += self._world.warnings

        shape = (scene.meshes, scene.instances)
        automatic = (settings.memory_budget, settings.bounce_rays) if settings.voxel_auto else ()
        resolution: tuple[Any, ...] = automatic or (settings.voxel_resolution,)
        resolution += settings.voxel_levels, settings.voxel_detail, settings.gather_mode, settings.shadow_mode
        if self._plan is None or memo.stale("plan", *shape, *resolution):
            self._plan = Plan.of(scene, settings)
            memo.done("plan", *shape, *resolution)
        self._middle = self._plan.middle(scene.camera, settings, self._middle if self._is_live else (), self.grid)
        edit: Edit | None = None  # what differs from the scene that voxels were made of; None: start again
        placing = (self._plan, self._middle, resolution if self._middle else ())
        if memo.stale("geometry", *shape, *placing):
            yield Progress(0.02, "Uploading geometry")
            placed_grid = self._plan.grid(scene, settings, self._middle)
            with self.gpu.timed("geometry"):
                edit = self._edit(scene, placed_grid)
                self.grid = placed_grid
                if edit is None or edit.has_meshes or not self._geometry.update(scene, edit.instances):
                    self._geometry.run(scene, placed_grid, materials)
                self._placed = scene
            if settings.debug_checks and self._geometry.geometry is not None:
                checks.check_geometry(self._geometry.geometry)
            if edit is None or self._emitters.may_include(scene, edit.instances, materials):
                memo.forget("emitters", "links")
            memo.forget("voxels")
            memo.done("geometry", *shape, *placing)
            yield Progress(0.05, "Voxelizing")
        geometry, grid = self._geometry.geometry, self.grid
        assert geometry is not None and grid is not None

        if memo.stale("emitters"):
            for share in self._emitters.run(scene, geometry, materials, self._materials):
                yield Progress(0.04 + 0.01 * share, "Finding emitters")
            self._emitter_version += 1
            memo.done("emitters")
        self._emitters.compare(scene, geometry)
        features = Features.from_scene(
            scene,
            settings,
            smooth_shading=geometry.has_smooth_shading,
            diffuse=materials.has_diffuse,
            emission=self._emitters.count > 0,
            small_emitters=self._emitters.is_small,
            transparency=materials.has_transparency,
            specular=materials.has_specular,
            least_roughness=materials.least_roughness,
            transmission=materials.has_transmission,
            world=self._world.is_lit,
            concentrated_world=self._world.is_concentrated,
            levels=bool(grid.levels),
        )
        self.features = features
        if features.follows_glossy and RAY_TEXELS * size[0] > limit:
            raise PipelineError(
                f"{too_many} up to {limit // RAY_TEXELS} from left to right where reflections are sharp; render a part "
                "of the frame (Ctrl-B), or set Glossy Layers to 0"
            )

        before = _Memo()  # what was done when the voxels were as they were
        faces_before = self._voxelize.face_count
        looks = self._repainted_bricks(scene, edit)
        is_only_repainted = looks is not None and edit is None and not memo.stale("voxels", features.needs_radiance)
        if looks is not None:
            memo.forget("voxels", "radiance")
        glows: np.ndarray | None = None  # bricks whose emission may be another, where nothing else has changed
        if memo.stale("voxels", features.needs_radiance):
            before = memo.copy()
            glows = self._glowing_bricks(scene) if is_only_repainted else None
            if not is_only_repainted:
                memo.forget("links", "irradiance")
            elif glows is not None:
                memo.forget("links")
            changed = edit.bricks if edit else None
            if looks is not None and (edit or is_only_repainted):
                changed = looks | edit.bricks if edit else looks
            for share in self._voxelize.run(
                geometry, materials, self._materials, has_faces=features.needs_radiance, changed=changed,
                moved=not is_only_repainted,
            ):  # fmt: skip
                yield Progress(0.05 + 0.25 * share, "Voxelizing")
            if settings.debug_checks and self._voxelize.voxels is not None:
                checks.check_voxels(self._voxelize.voxels, geometry.triangle_count)
            if is_only_repainted and self._voxelize.numbers_before is None:
                memo.forget("links", "irradiance")  # faces have other numbers
                glows = None
            memo.done("voxels", features.needs_radiance)
            redone["cells"] = self._voxelize.made
            self._repainted = None
        voxels = self._voxelize.voxels
        assert voxels is not None

        if memo.stale("lights", scene.lights, grid):
            memo.forget("irradiance")
            before.forget("irradiance")
            self._lights.run(scene.lights, grid)
            memo.done("lights", scene.lights, grid)

        if features.needs_radiance:
            changes = None
            if glows is not None:  # links to faces that are said to be new are traced again
                numbers = np.arange(faces_before, dtype=np.uint32)
                numbers[self._voxelize.faces_in(glows)] = NONE_INDEX
                changes = FaceChanges(self.gpu, numbers, faces_before, np.zeros((0, 2, 3)), np.zeros((0, 2, 3)))
            elif edit and self._voxelize.numbers_before is not None:
                changes = FaceChanges(
                    self.gpu, self._voxelize.numbers_before, faces_before, edit.ray_boxes, edit.cell_boxes
                )
            try:
                yield from self._light_voxels(features, before, changes, redone)
            finally:
                if changes:
                    changes.release()
                self._voxelize.numbers_before = None
        else:
            self._release_light()
        if not features.has_guides:
            self._guides.release()
            memo.forget("guides")
        elif memo.stale("guides", self._radiance_version):
            for _ in self._guides.run(voxels, self._bounce.radiance[0], self._links, self._world, settings):
                yield Progress(1.0, "Guiding rays")
            memo.done("guides", self._radiance_version)
        if not features.needs_cones:
            self._cones.release()
            memo.forget("cones")
        elif memo.stale("cones", self._radiance_version):
            self._cones.run(voxels, self._bounce.radiance[0])
            memo.done("cones", self._radiance_version)

        if any(redone.values()):
            self.redone = redone
        self.warnings = list(dict.fromkeys(warnings))
        self._surface.allocate(size, len(materials.batches))
        if not features.has_direct:
            self._direct.release()
        if not features.has_diffuse_gather:
            self._gather.release()
        if not features.has_glossy:
            self._reflect.release()
        self._camera = CameraRays.of(scene.camera, grid, size)
        self._start_history(scene, settings, size, follows=follows)
        self.film.start(size, self._wanted, adaptive=settings.noise_threshold > 0.0 and "combined" in self._wanted)
        self.gpu.check()
        yield Progress(1.0, "Ready")

    def _edit(self, scene: SceneData, grid: VoxelGrid) -> Edit | None:
        """How ``scene`` differs from the one that voxels were made of; None: start again."""
        if self._placed is None or grid != self.grid or grid.levels or not self._memo.has("voxels"):
            return None
        edit = edit_between(self._placed, scene, grid)
        if edit is None or len(edit.instances) > MAX_INSTANCES or edit.share > MOST_CHANGED:
            return None
        if edit.has_meshes and (shares_triangles(self._placed) or shares_triangles(scene)):
            return None  # lists of cells say where meshes' triangles lie, and that has changed
        return edit

    def _repainted_bricks(self, scene: SceneData, edit: Edit | None) -> np.ndarray | None:
        """(z, y, x) bool: bricks with surfaces that look different from when they were made; None: there are none, or
        all are made again."""
        looks = self._repainted
        if looks is None or not looks.materials.any() or not self._voxelize.face_count:
            return None
        if edit is None and not self._memo.has("voxels"):
            return None
        return self._bricks_of(looks.materials, scene)

    def _glowing_bricks(self, scene: SceneData) -> np.ndarray | None:
        """(z, y, x) bool: bricks in which rays may find faces where they meet what emits now or did; None: none of it
        has changed."""
        assert self._repainted is not None
        if not self._repainted.glows.any():
            return None
        found = np.pad(self._bricks_of(self._repainted.glows, scene), 1)  # faces of the cells beside, too
        for axis in range(3):
            found = found | np.roll(found, 1, axis) | np.roll(found, -1, axis)
        return found[1:-1, 1:-1, 1:-1]

    def _bricks_of(self, materials: np.ndarray, scene: SceneData) -> np.ndarray:
        """(z, y, x) bool: bricks that surfaces of ``materials`` (M,) bool enter."""
        by_slot = [materials[list(instance.materials)] for instance in scene.instances]
        if shares_triangles(scene):
            return self._voxelize.bricks_with(np.array([slots.any() for slots in by_slot]))
        by_triangle = [
            slots[scene.meshes[instance.mesh].triangle_slots]
            for slots, instance in zip(by_slot, scene.instances, strict=True)
        ]
        return self._voxelize.bricks_with(np.concatenate(by_triangle))

    def _release_light(self) -> None:
        """Of voxels."""
        self._links.release()
        self._inject.release()
        self._bounce.release()
        self._memo.forget("links", "irradiance", "radiance")

    def _start_history(self, scene: SceneData, settings: Settings, size: tuple[int, int], *, follows: bool) -> None:
        """Light at pixels stays right while all but the camera stays; outputs say which kinds of it are kept."""
        features = self.features
        kept = []
        for history, keeps in (
            (self._history, features is not None and features.keeps_light),
            (self._glossy_history, features is not None and features.keeps_reflections),
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
            scene.materials, scene.meshes, scene.instances, scene.lights, scene.world, size, self.grid,
            tuple(vars(settings).values()), tuple(sorted(self._wanted)),
        )  # fmt: skip
        continues = not self._memo.stale("history", *inputs) and follows and settings.reuse_frames
        for history in kept:
            history.start(
                self._camera, settings.samples, settings.gather_interval, self.film.samples, continues=continues
            )
        self._memo.done("history", *inputs)

    def _light_voxels(
        self, features: Features, before: _Memo, changes: FaceChanges | None, redone: dict[str, int]
    ) -> Iterator[Progress]:
        """``before``: what was done for the voxels that ``changes`` are since. Fills in ``redone``."""
        settings, memo = self._settings, self._memo
        voxels = self._voxelize.voxels
        assert voxels is not None
        drawn, world_drawn = features.draws_emitters_at_faces, features.draws_world_at_faces
        links = (settings.bounce_rays, settings.seed, drawn, world_drawn)
        if features.needs_links and memo.stale("links", *links):
            memo.forget("radiance")
            for share in self._links.run(
                voxels, self._world, self._emitters, drawn=drawn, world_drawn=world_drawn, settings=settings,
                changes=None if before.stale("links", *links) else changes,
            ):  # fmt: skip
                yield Progress(0.3 + 0.5 * share, "Linking voxels")
            if settings.debug_checks:
                checks.check_links(self._links, voxels.faces.count)
            memo.done("links", *links)
            redone["linked_faces"] = self._links.linked
        if not features.needs_links:
            self._links.release()
            memo.forget("links")
        light = (
            settings.seed, settings.use_shadows, settings.light_falloff, settings.bounce_rays,
            self._emitter_version if drawn else 0, self._scene.world if world_drawn and self._scene else None,
        )  # fmt: skip
        if memo.stale("irradiance", *light):
            memo.forget("radiance")
        bounces = settings.bounces, features.needs_links
        if memo.stale("radiance", *bounces):
            is_lit = features.has_lights or drawn or world_drawn
            if not memo.has("irradiance") or (is_lit and self._inject.irradiance is None):
                memo.forget("irradiance")
                if is_lit:
                    emitters = self._emitters if drawn else None
                    world = self._world if world_drawn else None
                    kept = None if before.stale("irradiance", *light) else changes
                    for share in self._inject.run(voxels, self._lights, emitters, world, settings, kept):
                        yield Progress(0.8 + 0.1 * share, "Lighting voxels")
                    redone["lit_faces"] = self._inject.lit
                else:
                    self._inject.release()
                memo.done("irradiance", *light)
            passed = self._links if features.needs_links else None
            for share in self._bounce.run(voxels, self._inject.irradiance, passed, settings):
                yield Progress(0.9 + 0.1 * share, "Bouncing light")
            if settings.debug_checks:
                straight = passed.straight if passed else None
                checks.check_radiance(voxels, self._bounce.radiance[0], self._inject.irradiance, straight)
            if not self._is_live:
                self._inject.release()  # whatever changes the light injects it anew
            memo.done("radiance", *bounces)
            self._radiance_version += 1

    # Picture ----------------------------------------------------------------------------------------------------

    def sample(self) -> Iterator[Progress]:
        """Add one pass to the film. ``prepare`` must have been run to its end.

        Raises PipelineError, MemoryError, ShaderError, GpuUnavailable; ``prepare`` must be run again then.
        """
        yield from self._letting_go(self._sample())

    def _sample(self) -> Generator[Progress, None, None]:
        scene, settings, features = self._scene, self._settings, self.features
        geometry, voxels, materials = self._geometry.geometry, self._voxelize.voxels, self._materials.set
        if scene is None or features is None or geometry is None or voxels is None or materials is None:
            raise PipelineError("nothing was prepared to render")
        camera, index = self._camera, self.film.samples
        offset = pixel_offset(index, scene.pixel_filter_width)
        sample, gather = self._history.sample(index), self._history.gather(index)
        surface = self._surface.pictures
        assert surface is not None
        frame = Frame(index, sample, gather, camera, offset, surface, features, settings, self.film.active_tiles)
        radiance = self._bounce.radiance[0] if features.needs_radiance else None
        lit = LitVoxels(voxels, radiance, self._lights, self._emitters, self._world, self._cones, self._guides)
        if self._wanted <= set(VOXEL_VIEWS):
            self._add(frame, lit, scene, PixelLight())
            yield Progress(1.0, "Pass done")
            return
        surfaces = Surfaces(geometry, voxels, materials, self._materials)
        for share in self._surface.run(surfaces, frame.view):
            yield Progress(0.2 * share, "Surfaces")
        if features.has_visible_lights:
            self._surface.show_lights(self._lights, frame.view, settings)
        splits = self.film.splits_light
        if features.has_direct:
            for share in self._direct.run(frame, lit):
                yield Progress(0.2 + 0.2 * share, "Direct light")
        if features.has_diffuse_gather and gather is not None:
            for share in self._gather.run(frame, lit, self._direct.diffuse, keeps_emitted=splits):
                yield Progress(0.4 + 0.3 * share, "Indirect light")
        reflects = frame
        if features.has_glossy:
            self._reflect.allocate(self._size, emitted=splits, layers=features.follows_glossy)
            if features.keeps_reflections:
                turn = self._glossy_history.gather(index)
                reflects = dataclasses.replace(
                    frame, gather=turn, sample=turn.sample if turn else FILLING + frame.sample
                )
            if not features.keeps_reflections or reflects.gather is not None:
                for share in self._reflect.run(reflects, lit, self._surface, surfaces):
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
                for share in self._reflect.run(reflects, lit, self._surface, surfaces, fills=True):
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
        if self._settings.debug_checks:
            checks.check_film(self.film)

    def rays_at(self, place: tuple[float, float]) -> SeenRays | None:
        """Rays that gather light at the surface seen at ``place``, 0..1 from the picture's lower left corner.

        None: nothing was prepared yet. To be called between pieces of work, not in one.
        """
        features, voxels, surface = self.features, self._voxelize.voxels, self._surface.pictures
        if features is None or voxels is None or surface is None or not features.has_geometry:
            return None
        radiance = self._bounce.radiance[0] if features.needs_radiance else None
        lit = LitVoxels(voxels, radiance, self._lights, self._emitters, self._world, self._cones, self._guides)
        frame = Frame(0, 0, None, self._camera, (0.5, 0.5), surface, features, self._settings)
        width, height = self._size
        return trace_rays(self.gpu, frame, lit, (int(place[0] * width), int(place[1] * height)))

    # Report -----------------------------------------------------------------------------------------------------

    def statistics(self) -> dict[str, Any]:
        """What was done and what it took; sizes in bytes, times in ms, widths of voxels in metres.

        ``voxels``: along the sides of the grid, or of the finest of its ``levels``.
        """
        voxels = self._voxelize.voxels
        levels = self.grid.levels if self.grid else ()
        finest = levels[0] if levels else self.grid
        return {
            "renderer": self.gpu.renderer,
            "resolution": list(self._size),
            "samples": self.film.samples,
            "mean_samples": round(self.film.mean_samples, 3),
            "voxels": list(finest.size) if finest else [0, 0, 0],
            "levels": [
                {"voxels": list(level.size), "voxel_size": self.grid.cell_size * (1 << k)}
                for k, level in enumerate(levels)
                if self.grid
            ],
            "occupied": voxels.cell_count if voxels else 0,
            "faces": self._voxelize.face_count,
            "redone": dict(self.redone),
            "bounces": self._bounce.bounces if self.features and self.features.bounces else 0,
            "features": self.features.names if self.features else [],
            "passes": [
                {"name": name, "calls": t.calls, "cpu_ms": round(t.cpu_ms, 3), "gpu_ms": round(t.gpu_ms, 3)}
                for name, t in self.gpu.times.items()
            ],
            "memory": dict(sorted(self.gpu.memory.items())),
            "warnings": list(self.warnings),
        }

    def release(self) -> None:
        """Free every GL object."""
        parts: tuple[Any, ...] = (
            self._surface,
            self._direct,
            self._gather,
            *self._sharing.values(),
            self._reflect,
            self._history,
            self._glossy_history,
            self._cones,
            self._guides,
            self._bounce,
            self._inject,
            self._links,
            self._lights,
            self._world,
            self._voxelize,
            self._emitters,
            self._geometry,
            self._materials,
            self.film,
        )
        for part in parts:
            part.release()
        self._memo = _Memo()
