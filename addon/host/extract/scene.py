# SPDX-License-Identifier: GPL-3.0-or-later
"""From an evaluated depsgraph to :class:`SceneData`: the one place where Blender's data enter the pipeline."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ...materials.graph import MaterialData, WorldData
from ...scene import SceneData
from .camera import ExtractionError, extract_camera
from .instances import MaterialTable, extract_placements

__all__ = ["ExtractionError", "extract_scene"]


def extract_scene(
    depsgraph: bpy.types.Depsgraph, *, resolution: tuple[int, int], is_preview: bool = False
) -> SceneData:
    """Everything that the depsgraph shows, copied: the result holds nothing of Blender's.

    ``resolution`` is the size of the whole frame in pixels (width, height), before any cropping to the render region.
    ``is_preview``: a preview of a material, world or light; the scene is then Blender's own, so its warnings are not
    the user's and are left out. Raises ExtractionError when there is no usable camera.
    """
    warnings: list[str] = []
    scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    camera = extract_camera(depsgraph, resolution, warnings)
    convert_material, convert_world = _converters(warnings)
    materials = MaterialTable(convert_material)
    placements = extract_placements(depsgraph, materials, warnings)
    world = view_layer.world_override or scene.world
    return SceneData(
        meshes=tuple(placements.meshes),
        instances=tuple(placements.instances),
        materials=tuple(materials.materials),
        lights=tuple(placements.lights),
        world=convert_world(world) if world is not None else None,
        camera=camera,
        warnings=() if is_preview else tuple(dict.fromkeys(warnings)),
        film_transparent=scene.render.film_transparent,
        # Cycles' Film > Exposure has no counterpart in Blender itself.
        exposure=getattr(getattr(scene, "cycles", None), "film_exposure", 1.0),
        pixel_filter_width=scene.render.filter_size,
    )


def _converters(
    warnings: list[str],
) -> tuple[Callable[[bpy.types.Material], MaterialData], Callable[[bpy.types.World], WorldData | None]]:
    """What turns materials and worlds into data; both share the images they load."""
    from .image import ImageReader
    from .material import extract_material, extract_world

    images = ImageReader(warnings)
    return (
        lambda material: extract_material(material, images, warnings),
        lambda world: extract_world(world, images, warnings),
    )
