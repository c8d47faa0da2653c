# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene as lit voxels: all that does not depend on pixels, each step redone only when what it depends on has changed.

place: materials -> world -> geometry -> emitters
light: voxels -> lights -> injection -> links -> bounces (-> guides, cones)
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from . import checks
from .edit import MAX_INSTANCES, Edit, bricks_beside, edit_between
from .features import Features
from .gpu.context import GpuContext
from .gpu.interface import NONE_INDEX
from .grid import VoxelGrid
from .levels import Plan
from .passes.bounce import BouncePass
from .passes.cones import ConeVolume
from .passes.emitters import EmitterTable
from .passes.face_changes import FaceChanges
from .passes.frame import LitVoxels
from .passes.geometry import GeometryPass
from .passes.guide import GuidePass
from .passes.inject import InjectPass, LightTable
from .passes.link import LinkPass
from .passes.materials import MaterialPass, Repainted, repainted
from .passes.share_faces import SharePass
from .passes.surface import Surfaces
from .passes.voxelize import VoxelizePass
from .passes.world import WorldLight
from .scene import SceneData
from .settings import Settings
from .sharing import shares_triangles
from .steps import Memo, Progress

#: Share of the bricks up to which voxels are taken over from those before.
MOST_CHANGED = 0.5


class VoxelLight:
    """Voxels of one scene and their light."""

    def __init__(self, gpu: GpuContext, *, is_live: bool) -> None:
        """``is_live``: somebody edits the scene. What an edit can take over is kept: 20 bytes for each voxel
        face."""
        self.gpu = gpu
        self._is_live = is_live
        self._memo = Memo()
        self.materials = MaterialPass(gpu)
        self.geometry = GeometryPass(gpu)
        self.emitters = EmitterTable(gpu)
        self.voxelize = VoxelizePass(gpu)
        self.world = WorldLight(gpu)
        self.lights = LightTable(gpu)
        self.inject = InjectPass(gpu)
        self.links = LinkPass(gpu)
        self.bounce = BouncePass(gpu, keeps_light=is_live)
        self.share = SharePass(gpu, keeps_partners=is_live)
        self.cones = ConeVolume(gpu)
        self.guides = GuidePass(gpu)
        self._scene: SceneData | None = None
        self._settings = Settings()
        self._placed: SceneData | None = None  # what the geometry was made of
        self._edited: Edit | None = None  # what differs from the scene that voxels were made of; None: start again
        self._repainted: Repainted | None = None  # what looks different since voxels were made
        self._emitter_version = self._radiance_version = 0
        self._middle: tuple[float, ...] = ()  # of nested levels
        self.plan: Plan | None = None
        self.features: Features | None = None
        self.grid: VoxelGrid | None = None
        self.warnings: list[str] = []
        #: Of the last ``light`` that did any: cells that were voxelized, faces that were linked to others and lit.
        self.redone = {"cells": 0, "linked_faces": 0, "lit_faces": 0}

    @property
    def has_geometry(self) -> bool:
        """Whether the scene's triangles are there."""
        return self._memo.has("geometry")

    @property
    def lit(self) -> LitVoxels | None:
        """What rays meet; None: nothing was made yet."""
        if self.features is None or self.voxelize.voxels is None:
            return None
        radiance = self.bounce.radiance if self.features.needs_radiance else None
        return LitVoxels(
            self.voxelize.voxels, radiance, self.lights, self.emitters, self.world, self.cones, self.guides
        )

    @property
    def surfaces(self) -> Surfaces | None:
        """What pixels show; None: nothing was made yet."""
        geometry, voxels, materials = self.geometry.geometry, self.voxelize.voxels, self.materials.set
        if geometry is None or voxels is None or materials is None:
            return None
        return Surfaces(geometry, voxels, materials, self.materials)

    def place(self, scene: SceneData, settings: Settings) -> Iterator[Progress]:
        """Bring materials, the world, triangles and emitters up to date, and say which ``features`` the scene has.

        Raises what ``Pipeline.prepare`` does.
        """
        memo, warnings = self._memo, list(scene.warnings)
        self._scene, self._settings, self._edited = scene, settings, None

        uv_layers = tuple(sorted({name for mesh in scene.meshes for name in mesh.uv_layers}))
        if memo.stale("materials", scene.materials, uv_layers):
            yield Progress(0.0, "Compiling materials")
            looked = self.materials.set
            with self.gpu.timed("materials"):
                found = repainted(looked, self.materials.run(scene.materials, uv_layers))
            if found is None:
                memo.forget("geometry", "emitters", "voxels")
            else:
                self._repainted = found.and_before(self._repainted)
                if found.glows.any():
                    memo.forget("emitters")
            memo.done("materials", scene.materials, uv_layers)
        materials = self.materials.set
        assert materials is not None
        warnings += materials.compiled.warnings

        if memo.stale("world", scene.world):
            memo.forget("links")
            self.world.run(scene.world)
            memo.done("world", scene.world)
        warnings += self.world.warnings

        shape = (scene.meshes, scene.instances)
        automatic = (settings.memory_budget, settings.bounce_rays) if settings.voxel_auto else ()
        resolution: tuple[Any, ...] = automatic or (settings.voxel_resolution,)
        resolution += settings.voxel_levels, settings.voxel_detail, settings.gather_mode, settings.shadow_mode
        if self.plan is None or memo.stale("plan", *shape, *resolution):
            self.plan = Plan.of(scene, settings)
            memo.done("plan", *shape, *resolution)
        self._middle = self.plan.middle(scene.camera, settings, self._middle if self._is_live else (), self.grid)
        placing = (self.plan, self._middle, resolution if self._middle else ())
        if memo.stale("geometry", *shape, *placing):
            yield Progress(0.02, "Uploading geometry")
            placed_grid = self.plan.grid(scene, settings, self._middle)
            with self.gpu.timed("geometry"):
                self._edited = edit = self._edit(scene, placed_grid)
                self.grid = placed_grid
                if edit is None or edit.has_meshes or not self.geometry.update(scene, edit.instances):
                    self.geometry.run(scene, placed_grid, materials)
                self._placed = scene
            if settings.debug_checks and self.geometry.geometry is not None:
                checks.check_geometry(self.geometry.geometry)
            if edit is None or self.emitters.may_include(scene, edit.instances, materials):
                memo.forget("emitters", "links")
            memo.forget("voxels")
            memo.done("geometry", *shape, *placing)
            yield Progress(0.05, "Voxelizing")
        geometry, grid = self.geometry.geometry, self.grid
        assert geometry is not None and grid is not None

        if memo.stale("emitters"):
            for share in self.emitters.run(scene, geometry, materials, self.materials):
                yield Progress(0.04 + 0.01 * share, "Finding emitters")
            self._emitter_version += 1
            memo.done("emitters")
        self.emitters.compare(scene, geometry)
        features = Features.from_scene(
            scene,
            settings,
            smooth_shading=geometry.has_smooth_shading,
            diffuse=materials.has_diffuse,
            emission=self.emitters.count > 0,
            small_emitters=self.emitters.is_small,
            transparency=materials.has_transparency,
            specular=materials.has_specular,
            least_roughness=materials.least_roughness,
            transmission=materials.has_transmission,
            world=self.world.is_lit,
            concentrated_world=self.world.is_concentrated,
            levels=bool(grid.levels),
        )
        self.features = features
        self.warnings = warnings

    def light(self, *, is_draft: bool = False) -> Iterator[Progress]:
        """Bring voxels and their light up to date for what was placed. Raises what ``Pipeline.prepare`` does.

        ``is_draft``: where an object was moved, light may go on from what it was before for now.
        """
        scene, settings, features, edit = self._scene, self._settings, self.features, self._edited
        geometry, grid, materials, memo = self.geometry.geometry, self.grid, self.materials.set, self._memo
        assert scene is not None and features is not None
        assert geometry is not None and grid is not None and materials is not None
        redone = dict.fromkeys(self.redone, 0)
        before = Memo()  # what was done when the voxels were as they were
        faces_before = self.voxelize.face_count
        looks = self._repainted_bricks(scene, edit)
        is_only_repainted = looks is not None and edit is None and not memo.stale("voxels", features.needs_radiance)
        if looks is not None:
            memo.forget("voxels", "radiance", "draft of radiance")
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
            for share in self.voxelize.run(
                geometry, materials, self.materials, has_faces=features.needs_radiance, changed=changed,
                moved=not is_only_repainted,
            ):  # fmt: skip
                yield Progress(0.05 + 0.25 * share, "Voxelizing")
            if settings.debug_checks and self.voxelize.voxels is not None:
                checks.check_voxels(self.voxelize.voxels, geometry.triangle_count)
            if is_only_repainted and self.voxelize.numbers_before is None:
                memo.forget("links", "irradiance")  # faces have other numbers
                glows = None
            if not is_only_repainted or self.voxelize.numbers_before is None:
                self.bounce.renumber(self.voxelize.numbers_before if is_draft else None)
            self.share.renumber(self.voxelize.numbers_before, self.voxelize.is_beside)
            memo.done("voxels", features.needs_radiance)
            redone["cells"] = self.voxelize.made
            self._repainted = None
        voxels = self.voxelize.voxels
        assert voxels is not None

        if memo.stale("lights", scene.lights, grid):
            memo.forget("irradiance")
            before.forget("irradiance")
            self.lights.run(scene.lights, grid)
            memo.done("lights", scene.lights, grid)

        if features.needs_radiance:
            changes = None
            if glows is not None:  # links to faces that are said to be new are traced again
                numbers = np.arange(faces_before, dtype=np.uint32)
                numbers[self.voxelize.faces_in(glows)] = NONE_INDEX
                changes = FaceChanges(self.gpu, numbers, faces_before, np.zeros((0, 2, 3)), np.zeros((0, 2, 3)))
            elif edit and self.voxelize.numbers_before is not None:
                changes = FaceChanges(
                    self.gpu, self.voxelize.numbers_before, faces_before, edit.ray_boxes, edit.cell_boxes
                )
            try:
                yield from self._light_voxels(before, changes, redone, is_draft=is_draft)
            finally:
                if changes:
                    changes.release()
                self.voxelize.numbers_before = self.voxelize.is_beside = None
        else:
            self._release_light()
        if not features.has_guides:
            self.guides.release()
            memo.forget("guides")
        elif memo.has("draft of radiance") and self.guides.grid == grid:
            pass  # those before will do: they only say where rays go
        elif memo.stale("guides", self._radiance_version):
            assert self.bounce.radiance is not None
            for _ in self.guides.run(voxels, self.bounce.radiance, self.links, self.world):
                yield Progress(1.0, "Guiding rays")
            memo.done("guides", self._radiance_version)
        if not features.needs_cones:
            self.cones.release()
            memo.forget("cones")
        elif memo.stale("cones", self._radiance_version):
            assert self.bounce.radiance is not None
            self.cones.run(voxels, self.bounce.radiance)
            memo.done("cones", self._radiance_version)

        if any(redone.values()):
            self.redone = redone

    def _light_voxels(
        self, before: Memo, changes: FaceChanges | None, redone: dict[str, int], *, is_draft: bool
    ) -> Iterator[Progress]:
        """``before``: what was done for the voxels that ``changes`` are since. Fills in ``redone``."""
        settings, memo, features = self._settings, self._memo, self.features
        voxels = self.voxelize.voxels
        assert voxels is not None and features is not None
        drawn, world_drawn = features.draws_emitters_at_faces, features.draws_world_at_faces
        links = (settings.bounce_rays, settings.seed, drawn, world_drawn)
        if features.needs_links and memo.stale("links", *links):
            memo.forget("radiance", "draft of radiance")
            for share in self.links.run(
                voxels, self.world, self.emitters, drawn=drawn, world_drawn=world_drawn, settings=settings,
                changes=None if before.stale("links", *links) else changes,
            ):  # fmt: skip
                yield Progress(0.3 + 0.5 * share, "Linking voxels")
            if settings.debug_checks:
                checks.check_links(self.links, voxels.faces.count)
            memo.done("links", *links)
            redone["linked_faces"] = self.links.linked
        if not features.needs_links:
            self.links.release()
            memo.forget("links")
        light = (
            settings.seed, settings.use_shadows, settings.light_falloff, settings.bounce_rays,
            self._emitter_version if drawn else 0, self._scene.world if world_drawn and self._scene else None,
        )  # fmt: skip
        if memo.stale("irradiance", *light):
            memo.forget("radiance", "draft of radiance")
        bounces = settings.bounces, features.needs_links
        is_drafted = is_draft and not memo.stale("draft of radiance", *bounces)
        if memo.stale("radiance", *bounces) and not is_drafted:
            kept = None if before.stale("irradiance", *light) else changes
            is_lit = features.has_lights or drawn or world_drawn
            if not memo.has("irradiance") or (is_lit and self.inject.irradiance is None):
                memo.forget("irradiance")
                if is_lit:
                    emitters = self.emitters if drawn else None
                    world = self.world if world_drawn else None
                    for share in self.inject.run(voxels, self.lights, emitters, world, settings, kept):
                        yield Progress(0.8 + 0.1 * share, "Lighting voxels")
                    redone["lit_faces"] = self.inject.lit
                else:
                    self.inject.release()
                memo.done("irradiance", *light)
            passed = self.links if features.needs_links else None
            goes_on = is_draft and bool(kept and passed and self.bounce.has_light)
            for share in self.bounce.run(voxels, self.inject.irradiance, passed, self.share, settings, goes_on=goes_on):
                yield Progress(0.9 + 0.1 * share, "Bouncing light")
            if settings.debug_checks:
                assert self.bounce.radiance is not None
                straight = passed.straight if passed else None
                checks.check_radiance(voxels, self.bounce.radiance, self.inject.irradiance, straight)
            if not self._is_live:
                self.inject.release()  # whatever changes the light injects it anew
            memo.forget("draft of radiance")
            memo.done("draft of radiance" if goes_on else "radiance", *bounces)
            self._radiance_version += 1

    def _edit(self, scene: SceneData, grid: VoxelGrid) -> Edit | None:
        """How ``scene`` differs from the one that voxels were made of; None: start again."""
        if self._placed is None or grid != self.grid or not self._memo.has("voxels"):
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
        if looks is None or not looks.materials.any() or not self.voxelize.face_count:
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
        assert self.grid is not None
        return bricks_beside(self._bricks_of(self._repainted.glows, scene), self.grid)  # faces of cells beside, too

    def _bricks_of(self, materials: np.ndarray, scene: SceneData) -> np.ndarray:
        """(z, y, x) bool: bricks that surfaces of ``materials`` (M,) bool enter."""
        by_slot = [materials[list(instance.materials)] for instance in scene.instances]
        if shares_triangles(scene):
            return self.voxelize.bricks_with(np.array([slots.any() for slots in by_slot]))
        by_triangle = [
            slots[scene.meshes[instance.mesh].triangle_slots]
            for slots, instance in zip(by_slot, scene.instances, strict=True)
        ]
        return self.voxelize.bricks_with(np.concatenate(by_triangle))

    def _release_light(self) -> None:
        """Of voxels."""
        self.links.release()
        self.inject.release()
        self.bounce.release()
        self.share.release()
        self._memo.forget("links", "irradiance", "radiance", "draft of radiance")

    def put_away(self) -> None:
        """Free what is soon made again, so that what is left can be put away as it is. :meth:`put_back` comes next."""
        self.cones.release()
        self._memo.forget("cones")
        self.geometry.put_away()
        self.materials.put_away()

    def put_back(self) -> None:
        """When the rest is there again."""
        self.materials.put_back()

    def release(self) -> None:
        """Free every GL object."""
        parts: tuple[Any, ...] = (
            self.cones,
            self.guides,
            self.share,
            self.bounce,
            self.inject,
            self.links,
            self.lights,
            self.world,
            self.voxelize,
            self.emitters,
            self.geometry,
            self.materials,
        )
        for part in parts:
            part.release()
        self._memo = Memo()
