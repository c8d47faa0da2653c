# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a scene has light, and a neutral world for one that has none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

_EMITTERS = {  # node type -> inputs of its colour and strength
    "ShaderNodeEmission": ("Color", "Strength"),
    "ShaderNodeBackground": ("Color", "Strength"),
    "ShaderNodeBsdfPrincipled": ("Emission Color", "Emission Strength"),
}


def has_light(scene: Any) -> bool:
    """Whether anything in the scene may shine: a light, the world, or a material that emits."""
    if any(thing.type == "LIGHT" and not thing.hide_render for thing in scene.objects):
        return True
    if _emits(scene.world):
        return True
    materials = {slot.material for thing in scene.objects if not thing.hide_render for slot in thing.material_slots}
    if any(_emits(material) for material in materials if material is not None):
        return True
    graph = bpy.context.evaluated_depsgraph_get()
    return any(instance.object.type == "LIGHT" for instance in graph.object_instances if instance.is_instance)


def add_neutral_world(scene: Any) -> None:
    """Gives the scene a white world of strength 1."""
    world = bpy.data.worlds.new("Neutral")
    if bpy.app.version < (5, 0, 0):  # later, a world always has nodes
        world.use_nodes = True
    for node in world.node_tree.nodes:
        if node.bl_idname == "ShaderNodeBackground":
            node.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
            node.inputs["Strength"].default_value = 1.0
    scene.world = world


def _emits(owner: Any) -> bool:
    """Whether a world or material emits light, judged by its nodes."""
    if owner is None:
        return False
    has_nodes = owner.node_tree is not None and (bpy.app.version >= (5, 0, 0) or owner.use_nodes)
    if not has_nodes:
        return isinstance(owner, bpy.types.World) and max(owner.color) > 0.0
    return any(_node_emits(node) for node in _nodes(owner.node_tree, set()))


def _nodes(tree: Any, visited: set[str]) -> Iterator[Any]:
    """Nodes of a tree and of the groups in it."""
    if tree is None or tree.name in visited:
        return
    visited.add(tree.name)
    for node in tree.nodes:
        yield node
        if node.type == "GROUP":
            yield from _nodes(node.node_tree, visited)


def _node_emits(node: Any) -> bool:
    if node.bl_idname not in _EMITTERS or node.mute:
        return False
    color, strength = (node.inputs.get(name) for name in _EMITTERS[node.bl_idname])
    if color is None or strength is None:
        return False
    return (color.is_linked or max(color.default_value[:3]) > 0.0) and (
        strength.is_linked or strength.default_value > 0.0
    )
