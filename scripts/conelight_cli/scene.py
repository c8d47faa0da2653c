# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads a scene file into Blender, whichever of the known formats it has."""

from __future__ import annotations

import os
from typing import Any

import bpy

from .errors import CommandError, reason


def load(path: str, *, trusted: bool = False) -> Any:
    """The scene (``bpy.types.Scene``) of a file. Raises CommandError for a file that is missing or cannot be read.

    ``trusted``: scripts and drivers in it run.
    """
    if not os.path.isfile(path):
        raise CommandError(f"scene file '{path}' does not exist")
    if not os.access(path, os.R_OK):
        raise CommandError(f"scene file '{path}' may not be read by this user")
    full = os.path.abspath(path)
    extension = os.path.splitext(path)[1].lower()
    try:
        if extension == ".blend":
            bpy.ops.wm.open_mainfile(filepath=full, load_ui=False, use_scripts=trusted)
        else:
            _import_into_empty_scene(full, extension)
    except RuntimeError as error:
        raise CommandError(f"scene file '{path}' could not be read: {reason(error)}") from error
    scene = bpy.context.scene
    if scene is None:
        raise CommandError(f"scene file '{path}' holds no scene")
    if extension != ".blend" and not scene.objects:
        raise CommandError(f"scene file '{path}' holds no objects, or is damaged")
    return scene


def _import_into_empty_scene(path: str, extension: str) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if extension in (".glb", ".gltf"):
        bpy.ops.import_scene.gltf(filepath=path)
    elif extension == ".obj":
        bpy.ops.wm.obj_import(filepath=path)
    else:
        _add_black_world()  # Blender reads dome lights into the scene's world, and leaves them out where there is none
        bpy.ops.wm.usd_import(filepath=path)


def _add_black_world() -> None:
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):  # later, a world always has nodes
        world.use_nodes = True
    for node in world.node_tree.nodes:
        if node.bl_idname == "ShaderNodeBackground":
            node.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)


def without_other_outputs(path: str) -> list[str]:
    """Mutes the compositor's file outputs, which would write where the file says; returns sentences for the user."""
    trees = {id(tree): tree for tree in bpy.data.node_groups if tree.bl_idname == "CompositorNodeTree"}
    for scene in bpy.data.scenes:
        tree = getattr(scene, "node_tree", None) if bpy.app.version < (5, 0, 0) else None
        if tree is not None:
            trees[id(tree)] = tree
    muted = []
    for tree in trees.values():
        for node in tree.nodes:
            if node.bl_idname == "CompositorNodeOutputFile" and not node.mute:
                node.mute = True
                muted.append(node.name)
    if not muted:
        return []
    names = ", ".join(f"'{name}'" for name in dict.fromkeys(muted))
    return [f"'{path}': file outputs of the compositor are left out: {names}; with --enable-autoexec they write"]
