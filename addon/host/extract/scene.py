# SPDX-License-Identifier: GPL-3.0-or-later
"""From an evaluated depsgraph to :class:`SceneData`: the one place where Blender's data enter the pipeline."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import bpy

from ...materials.graph import MaterialData, WorldData
from ...scene import CameraData, SceneData
from ..changes import EVERYTHING, Change, Changes, changes_in
from .camera import ExtractionError, extract_camera
from .image import ImageReader
from .instances import MaterialTable, MeshTable, extract_instances, extract_lights
from .keep import kept
from .material import extract_material, extract_world

__all__ = ["ExtractionError", "SceneReader"]


class SceneReader:
    """Reads a scene, and when asked again only what may have changed since.

    The result holds nothing of Blender's. What says the same as in the scene before is the same object as there, down
    to each mesh, instance, material and light: the pipeline does again only what follows from the others.
    """

    def __init__(self, *, is_preview: bool = False) -> None:
        """``is_preview``: of a material, world or light. The scene is then Blender's own, and so are its warnings."""
        self._is_preview = is_preview
        self.forget()

    def forget(self) -> None:
        """The next scene is read from scratch."""
        self._scene: SceneData | None = None
        self._source: tuple[Any, ...] = ()
        self._unreported: dict[Change, Any] = {}
        self._images = ImageReader()
        self._materials = MaterialTable(self._convert_material)
        self._meshes = MeshTable()
        self._warnings: dict[Change, list[str]] = {}

    def read_all_again(self) -> None:
        """Of the next scene, whatever is reported as changed: what says the same stays the same object."""
        self._source = ()

    def read(
        self,
        depsgraph: bpy.types.Depsgraph,
        resolution: tuple[int, int],
        check: Callable[[], None] = lambda: None,
        *,
        camera: CameraData | None = None,
        viewport: bpy.types.SpaceView3D | None = None,
    ) -> SceneData:
        """The scene as the depsgraph shows it. To be called each time that the depsgraph has been evaluated.

        ``resolution``: size of the whole frame in pixels (width, height), before any cropping to the render region.
        ``check`` is called now and then, and may raise to end the reading. ``camera`` takes the place of the scene's;
        without it raises ExtractionError when there is no usable one. ``viewport``: what its local view and local
        collections hide is left out.
        """
        try:
            return self._read(depsgraph, resolution, check, camera, viewport)
        except BaseException:
            self.forget()
            raise

    def _read(
        self,
        depsgraph: bpy.types.Depsgraph,
        resolution: tuple[int, int],
        check: Callable[[], None],
        camera: CameraData | None,
        viewport: bpy.types.SpaceView3D | None,
    ) -> SceneData:
        scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
        world = view_layer.world_override or scene.world
        changes = self._changes(depsgraph, world, viewport)
        kinds, old = changes.kinds, self._scene

        if camera is None:
            camera = extract_camera(depsgraph, resolution, self._warnings_of(Change.CAMERA))  # it costs nothing
        if old is None or kinds & (Change.GEOMETRY | Change.MATERIAL):
            self._materials.begin(is_current=not kinds & Change.MATERIAL, check=check)
            self._meshes.begin(changes.shapes)
            warnings = self._warnings_of(Change.GEOMETRY)
            instances = tuple(extract_instances(depsgraph, self._materials, self._meshes, warnings, check, viewport))
            self._meshes.end()
            self._warnings[Change.MATERIAL] = self._materials.warnings
        else:
            instances = old.instances
        if old is None or kinds & Change.LIGHT:
            warnings = self._warnings_of(Change.LIGHT)
            lights = tuple(extract_lights(depsgraph, warnings, viewport)) if _uses_scene("lights", viewport) else ()
        else:
            lights = old.lights
        if old is None or kinds & Change.WORLD:
            world_data = self._convert_world(world, self._warnings_of(Change.WORLD))
            if not _uses_scene("world", viewport):
                self._warnings[Change.WORLD].append("the viewport's studio light: the scene's world is shown instead")
        else:
            world_data = old.world
        found = [text for kind in Change if kind in self._warnings for text in self._warnings[kind]]
        new = SceneData(
            meshes=tuple(self._meshes.meshes),
            instances=instances,
            materials=tuple(self._materials.materials),
            lights=lights,
            world=world_data,
            camera=camera,
            warnings=() if self._is_preview else tuple(dict.fromkeys(found)),
            film_transparent=scene.render.film_transparent,
            # Cycles' Film > Exposure has no counterpart in Blender itself.
            exposure=getattr(getattr(scene, "cycles", None), "film_exposure", 1.0),
            pixel_filter_width=scene.render.filter_size,
        )
        self._scene = _kept_scene(new, old)
        return self._scene

    def _changes(
        self,
        depsgraph: bpy.types.Depsgraph,
        world: bpy.types.World | None,
        viewport: bpy.types.SpaceView3D | None,
    ) -> Changes:
        """What has to be read: what the depsgraph reports, and what it does not although it shows in the scene."""
        view_layer = depsgraph.view_layer
        source = (depsgraph.as_pointer(), depsgraph.mode, depsgraph.scene.session_uid, view_layer.name)
        changes = changes_in(depsgraph) if self._scene is not None and source == self._source else EVERYTHING
        kinds = changes.kinds
        unreported = {
            Change.GEOMETRY: _uid(view_layer.material_override),
            Change.GEOMETRY | Change.LIGHT: _visibility_in(viewport),
            Change.WORLD: (_uid(world), _uses_scene("world", viewport)),
            Change.LIGHT: _uses_scene("lights", viewport),
        }
        for kind, state in unreported.items():
            if self._unreported.get(kind) != state:
                kinds |= kind
        if self._images.refresh(changes.images):
            kinds |= Change.MATERIAL | Change.WORLD
        self._source, self._unreported = source, unreported
        return replace(changes, kinds=kinds)

    def _warnings_of(self, kind: Change) -> list[str]:
        """The list for the warnings about one part of the scene, emptied."""
        self._warnings[kind] = []
        return self._warnings[kind]

    def _convert_material(self, material: bpy.types.Material, warnings: list[str]) -> MaterialData:
        return extract_material(material, self._images, warnings)

    def _convert_world(self, world: bpy.types.World | None, warnings: list[str]) -> WorldData | None:
        return extract_world(world, self._images, warnings)


def _kept_scene(new: SceneData, old: SceneData | None) -> SceneData:
    """``old`` where nothing is different; else ``new`` with all that is the same taken from ``old``."""
    if old is None:
        return new
    parts = {field.name: kept(getattr(new, field.name), getattr(old, field.name)) for field in fields(SceneData)}
    return old if all(part is getattr(old, name) for name, part in parts.items()) else SceneData(**parts)


def _visibility_in(viewport: bpy.types.SpaceView3D | None) -> tuple[bool, bool]:
    """What a viewport may hide on its own."""
    return viewport is not None and viewport.local_view is not None, (
        viewport is not None and viewport.use_local_collections
    )


def _uses_scene(what: str, viewport: bpy.types.SpaceView3D | None) -> bool:
    """Whether a rendered viewport shows the scene's ``lights`` or ``world``; it may show studio light instead."""
    return viewport is None or bool(getattr(viewport.shading, f"use_scene_{what}_render"))


def _uid(data: bpy.types.ID | None) -> int:
    return data.original.session_uid if data is not None else 0
