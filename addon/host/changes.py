# SPDX-License-Identifier: GPL-3.0-or-later
"""What a depsgraph says has changed, in the renderer's terms."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Any

import bpy


class Change(enum.Flag):
    NONE = 0
    GEOMETRY = enum.auto()  # shape, place, number or visibility of objects, and which material they have
    MATERIAL = enum.auto()
    LIGHT = enum.auto()
    WORLD = enum.auto()
    CAMERA = enum.auto()
    SETTINGS = enum.auto()  # of the render or of this engine
    ALL = GEOMETRY | MATERIAL | LIGHT | WORLD | CAMERA | SETTINGS


@dataclass(frozen=True)
class Changes:
    """``shapes`` and ``images`` are session_uids; None: of all there are."""

    kinds: Change
    shapes: frozenset[int] | None  # objects, and data of objects, whose geometry was evaluated anew
    images: frozenset[int] | None


#: Where nothing is known of what was there before.
EVERYTHING = Changes(Change.ALL, None, None)

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
        case bpy.types.CompositorNodeTree():
            return Change.SETTINGS
        case bpy.types.NodeTree():
            return Change.NONE if data.is_embedded_data else _SHARED_LOOK  # what embeds it is reported too
        case bpy.types.Image() | bpy.types.MovieClip() | bpy.types.Texture():
            return _SHARED_LOOK
        case bpy.types.Scene():
            # The scene says which camera is used, and nothing else tells that a collection is hidden.
            return Change.SETTINGS | Change.CAMERA | Change.GEOMETRY | Change.LIGHT
        case bpy.types.Action() | bpy.types.FreestyleLineStyle() | bpy.types.Sound() | bpy.types.Text():
            return Change.NONE  # what an action moves is reported too
        case bpy.types.Collection() | bpy.types.ParticleSettings():
            return Change.GEOMETRY | Change.LIGHT  # they can hold lights, or instance them
        case _:
            return Change.GEOMETRY  # meshes, curves, shape keys, and whatever else makes objects


def _of_object(thing: Any) -> Change:
    if thing.type == "CAMERA":
        return Change.CAMERA
    if thing.type == "LIGHT":
        return Change.LIGHT
    return Change.GEOMETRY | Change.LIGHT if thing.is_instancer else Change.GEOMETRY


def changes_in(depsgraph: Any) -> Changes:
    """What changed since the depsgraph was evaluated last. Errs on the side of too much.

    A depsgraph does not report pixels, size and alpha mode of images that a script changed, and which frame an image
    sequence shows.
    """
    kinds = Change.NONE
    shapes, images = set(), set()
    for update in depsgraph.updates:
        data = update.id
        kinds |= _of_object(data) if isinstance(data, bpy.types.Object) else _of_data(data)
        if update.is_updated_geometry:
            shapes.add(data.original.session_uid)
        if isinstance(data, bpy.types.Image):
            images.add(data.original.session_uid)
    return Changes(kinds, frozenset(shapes), frozenset(images))
