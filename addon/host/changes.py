# SPDX-License-Identifier: GPL-3.0-or-later
"""What a depsgraph says has changed, in the renderer's terms."""

from __future__ import annotations

import enum
from typing import Any

import bpy


class Change(enum.Flag):
    NONE = 0
    GEOMETRY = enum.auto()  # shape, place, number or visibility of objects
    MATERIAL = enum.auto()
    LIGHT = enum.auto()
    WORLD = enum.auto()
    CAMERA = enum.auto()
    SETTINGS = enum.auto()  # of the render or of this engine
    ALL = GEOMETRY | MATERIAL | LIGHT | WORLD | CAMERA | SETTINGS


#: Data that several things may use: whatever it was, all of them may look different.
_SHARED_LOOK = Change.MATERIAL | Change.WORLD | Change.LIGHT


def _of_data(data: Any) -> Change:
    """The change that an update of a datablock other than an object means."""
    match data:
        case bpy.types.Camera():
            return Change.CAMERA
        case bpy.types.Light():
            return Change.LIGHT
        case bpy.types.World():
            return Change.WORLD
        case bpy.types.Material():
            return Change.MATERIAL
        case bpy.types.GeometryNodeTree():
            return Change.GEOMETRY
        case bpy.types.NodeTree() | bpy.types.Image() | bpy.types.MovieClip() | bpy.types.Texture():
            return _SHARED_LOOK
        case bpy.types.Scene():
            # The scene says which camera is used, and nothing else tells that a collection is hidden.
            return Change.SETTINGS | Change.CAMERA | Change.GEOMETRY
        case _:
            return Change.GEOMETRY  # meshes, curves, collections, shape keys, and whatever else makes objects


def _of_object(update: Any) -> Change:
    if update.id.type == "CAMERA":
        return Change.CAMERA
    if update.id.type == "LIGHT":
        return Change.LIGHT
    # Visibility to kinds of rays counts as geometry here, and Blender reports it as shading.
    return Change.GEOMETRY | Change.MATERIAL if update.is_updated_shading else Change.GEOMETRY


def changes_in(depsgraph: Any) -> Change:
    """What changed since the depsgraph was evaluated last. Errs on the side of too much."""
    change = Change.NONE
    for update in depsgraph.updates:
        change |= _of_object(update) if isinstance(update.id, bpy.types.Object) else _of_data(update.id)
    return change
