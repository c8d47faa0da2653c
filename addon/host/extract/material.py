# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's materials and worlds -> :class:`MaterialData` and :class:`WorldData`.

Only what the output needs is read: nodes that nothing uses do not count. Groups, reroutes and muted nodes are
resolved on the way, the same in all versions of Blender.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...materials.graph import MaterialData, Node, NodeGraph, Socket, Value, WorldData
from .image import ImageReader

#: Samples of a curve or of a colour ramp whose shape is not a line.
TABLE_SIZE = 256

#: Properties of nodes that say nothing of the picture.
_IGNORED = frozenset(p.identifier for p in bpy.types.ShaderNode.bl_rna.properties)

RampTable = tuple[tuple[float, tuple[float, float, float, float]], ...]

_PLAIN_KINDS = ("VALUE", "INT", "BOOLEAN", "VECTOR", "RGBA", "ROTATION")


def extract_material(material: bpy.types.Material | None, images: ImageReader, warnings: list[str]) -> MaterialData:
    """One material; None (an empty slot) gives Blender's default. Never raises: problems go to ``warnings``."""
    if material is None:
        return MaterialData("(empty slot)", None)
    name = material.name
    try:
        return _material(material, images, warnings)
    except Exception as error:
        warnings.append(f"material '{name}' could not be read and is grey ({type(error).__name__}: {error})")
        return MaterialData(name, None, uid=material.session_uid)


def extract_world(world: bpy.types.World | None, images: ImageReader, warnings: list[str]) -> WorldData | None:
    """The world; None when the scene has none. Never raises: problems go to ``warnings``."""
    if world is None:
        return None
    try:
        color = _rgb(world.color)
        tree = _tree(world)
        return WorldData(world.name, None if tree is None else _graph(tree, images, warnings), color)
    except Exception as error:
        warnings.append(f"world '{world.name}' could not be read and is black ({type(error).__name__}: {error})")
        return WorldData(world.name, None)


def _material(material: bpy.types.Material, images: ImageReader, warnings: list[str]) -> MaterialData:
    tree = _tree(material)
    graph = None
    if material.grease_pencil is None and tree is not None:
        try:
            graph = _graph(tree, images, warnings)
        except Exception as error:
            problem = f"its nodes could not be read and its viewport colour is used ({type(error).__name__}: {error})"
            warnings.append(f"material '{material.name}': {problem}")
    return MaterialData(
        name=material.name,
        graph=graph,
        color=_rgb(material.diffuse_color),
        metallic=float(material.metallic),
        roughness=float(material.roughness),
        use_backface_culling=bool(material.use_backface_culling),
        uid=int(material.session_uid),
    )


def _tree(owner: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree | None:
    """The node tree in use. ``use_nodes`` means something before Blender 5.0 only."""
    if bpy.app.version < (5, 0, 0) and not owner.use_nodes:
        return None
    return owner.node_tree


def _rgb(color: Iterable[float]) -> tuple[float, float, float]:
    r, g, b = list(color)[:3]
    return float(r), float(g), float(b)


def _rgba(color: Iterable[float]) -> tuple[float, float, float, float]:
    r, g, b, a = color
    return float(r), float(g), float(b), float(a)


# --- following links --------------------


@dataclass(frozen=True, eq=False)
class _Place:
    """A node tree and the group nodes that lead to it: the last is the group node that contains it."""

    tree: bpy.types.NodeTree
    parents: tuple[tuple[_Place, bpy.types.Node], ...] = ()

    def path(self, node: bpy.types.Node) -> tuple[str, ...]:
        return (*(group.name for _, group in self.parents), node.name)


@dataclass(frozen=True, eq=False)
class _Source:
    """Where an input comes from: an output of a node, or else a value."""

    place: _Place | None = None
    node: bpy.types.Node | None = None
    output: str = ""
    value: Value = None
    kind: str = "VALUE"


#: Nodes of one material, those of groups counted wherever they are used: groups within groups can double and double.
MOST_NODES = 10_000


class _Flattener:
    """Reads the nodes of one tree that its output needs. Raises ValueError where they are too many."""

    def __init__(self, images: ImageReader, warnings: list[str]) -> None:
        self.images = images
        self.warnings = warnings
        self.nodes: dict[str, Node] = {}
        self._names: dict[tuple[str, ...], str] = {}
        self._taken: set[str] = set()
        self._links: dict[int, dict[tuple[str, str], bpy.types.NodeLink]] = {}

    def name_of(self, path: tuple[str, ...]) -> str:
        """A name for messages, unique in the flat graph: "Group/Node"."""
        if path not in self._names:
            name = "/".join(path)
            while name in self._taken:
                name += "'"
            self._names[path] = name
            self._taken.add(name)
        return self._names[path]

    def read_all(self, place: _Place, output: bpy.types.Node) -> str:
        """Reads the output and everything before it. Returns its name."""
        pending = [(place, output)]
        while pending:
            place_of_node, node = pending.pop()
            name = self.name_of(place_of_node.path(node))
            if name in self.nodes:
                continue
            if len(self.nodes) >= MOST_NODES:
                raise ValueError(f"with those in groups there are more than {MOST_NODES} of them")
            inputs = {}
            for socket in node.inputs:
                if socket.type == "CUSTOM":
                    continue
                source = self.source_of(place_of_node, node, socket)
                link = None
                if source.node is not None and source.place is not None:
                    link = (self.name_of(source.place.path(source.node)), source.output)
                    pending.append((source.place, source.node))
                inputs[socket.identifier] = Socket(socket.identifier, source.kind, source.value, link)
            self.nodes[name] = self._node(name, node, inputs)
        return self.name_of(place.path(output))

    def _link_to(self, place: _Place, node: bpy.types.Node, socket: bpy.types.NodeSocket) -> bpy.types.NodeLink | None:
        key = place.tree.as_pointer()
        if key not in self._links:
            self._links[key] = {
                (link.to_node.name, link.to_socket.identifier): link
                for link in place.tree.links
                if link.is_valid and not link.is_muted
            }
        return self._links[key].get((node.name, socket.identifier))

    def source_of(self, place: _Place, node: bpy.types.Node, socket: bpy.types.NodeSocket) -> _Source:
        """Follows links through reroutes, muted nodes and groups."""
        for _ in range(100_000):  # a circle of reroutes has no end
            link = self._link_to(place, node, socket)
            if link is None:
                return _Source(value=_value(socket), kind=socket.type)
            node, from_socket = link.from_node, link.from_socket
            if node.bl_idname == "NodeReroute":
                socket = node.inputs[0]
            elif node.mute:
                inner = next((i for i in node.internal_links if i.to_socket == from_socket), None)
                if inner is None:
                    return _Source(value=None, kind=from_socket.type)
                socket = inner.from_socket
            elif node.bl_idname == "NodeGroupInput":
                if not place.parents:
                    return _Source(value=None, kind=from_socket.type)
                place, node = place.parents[-1]
                found = _by_identifier(node.inputs, from_socket.identifier)
                if found is None:
                    return _Source(value=None, kind=from_socket.type)
                socket = found
            elif hasattr(node, "node_tree"):
                inside = _group_output(node)
                found = _by_identifier(inside.inputs, from_socket.identifier) if inside is not None else None
                if inside is None or found is None:
                    return _Source(value=None, kind=from_socket.type)
                place = _Place(node.node_tree, (*place.parents, (place, node)))
                node, socket = inside, found
            else:
                return _Source(place, node, from_socket.identifier, None, from_socket.type)
        return _Source(value=None, kind=socket.type)

    def _node(self, name: str, node: bpy.types.Node, inputs: dict[str, Socket]) -> Node:
        properties = _properties(node)
        ramp: tuple[Any, ...] = ()
        if node.bl_idname == "ShaderNodeValToRGB":
            ramp = _ramp(node.color_ramp)
            properties["ramp_interpolation"] = "CONSTANT" if node.color_ramp.interpolation == "CONSTANT" else "LINEAR"
        elif node.bl_idname == "ShaderNodeRGBCurve":
            ramp = _curves(node.mapping)
        image = getattr(node, "image", None)
        return Node(
            name=name,
            idname=node.bl_idname,
            inputs=inputs,
            properties=properties,
            image=self.images.read(image, self.warnings) if isinstance(image, bpy.types.Image) else None,
            ramp=ramp,
            output_values={
                socket.identifier: _value(socket)
                for socket in node.outputs
                if node.bl_idname in ("ShaderNodeRGB", "ShaderNodeValue", "ShaderNodeNormal")
            },
        )


def _graph(tree: bpy.types.NodeTree, images: ImageReader, warnings: list[str]) -> NodeGraph:
    output = _active_output(tree)
    if output is None:
        return NodeGraph({}, None)
    flattener = _Flattener(images, warnings)
    name = flattener.read_all(_Place(tree), output)
    return NodeGraph(flattener.nodes, name)


def _active_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """The output that Cycles would use, or the one for all engines, or any."""
    for target in ("CYCLES", "ALL", "EEVEE"):
        node = tree.get_output_node(target)
        if node is not None:
            return node
    return None


def _group_output(group: bpy.types.Node) -> bpy.types.Node | None:
    if group.node_tree is None:
        return None
    outputs = [node for node in group.node_tree.nodes if node.bl_idname == "NodeGroupOutput"]
    return next((node for node in outputs if node.is_active_output), outputs[0] if outputs else None)


def _by_identifier(sockets: Iterable[bpy.types.NodeSocket], identifier: str) -> bpy.types.NodeSocket | None:
    return next((socket for socket in sockets if socket.identifier == identifier), None)


# --- values --------------------


def _value(socket: bpy.types.NodeSocket) -> Value:
    """The value of a socket as a number or a tuple of numbers; None if it has none (a shader)."""
    if socket.type not in _PLAIN_KINDS:
        return None
    value = getattr(socket, "default_value", None)
    if value is None or isinstance(value, bool | int | float):
        return value
    return tuple(float(v) for v in value)


def _properties(node: bpy.types.Node) -> dict[str, Any]:
    """Enumerations, switches, numbers and texts of a node, and the names of the datablocks it points at."""
    values: dict[str, Any] = {}
    for prop in node.bl_rna.properties:
        name = prop.identifier
        if name in _IGNORED:
            continue
        value = getattr(node, name, None)
        if prop.type == "POINTER":
            if isinstance(value, bpy.types.ID) and name != "image":
                values[name] = value.name
        elif prop.type in ("FLOAT", "INT", "BOOLEAN") and getattr(prop, "is_array", False):
            values[name] = tuple(value or ())
        elif prop.type in ("ENUM", "BOOLEAN", "INT", "FLOAT", "STRING") and isinstance(value, bool | int | float | str):
            values[name] = value
    return values


def _ramp(ramp: bpy.types.ColorRamp) -> RampTable:
    """The stops of a ramp of lines or steps; of any other a table."""
    if ramp.color_mode == "RGB" and ramp.interpolation in ("LINEAR", "CONSTANT"):
        return tuple((float(stop.position), _rgba(stop.color)) for stop in ramp.elements)
    positions = np.linspace(0.0, 1.0, TABLE_SIZE)
    return tuple((float(p), _rgba(ramp.evaluate(float(p)))) for p in positions)


def _curves(mapping: bpy.types.CurveMapping) -> RampTable:
    """What RGB curves make of 0..1 in each channel: the combined curve first, then the channel's own."""
    mapping.initialize()
    red, green, blue, combined = mapping.curves
    table = []
    for position in np.linspace(0.0, 1.0, TABLE_SIZE):
        value = mapping.evaluate(combined, float(position))
        channels = [mapping.evaluate(curve, value) for curve in (red, green, blue)]
        table.append((float(position), _rgba([*channels, 1.0])))
    return tuple(table)
