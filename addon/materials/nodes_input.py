# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that say where and what the surface is: Texture Coordinate, UV Map, Attribute, Geometry, Object Info, ..."""

from __future__ import annotations

from .expression import (
    Expr,
    absolute,
    average,
    clamp,
    dot,
    layer_leaf,
    leaf,
    less,
    literal,
    maximum,
    operation,
    power,
    select,
    sqrt,
    structural,
)  # fmt: skip
from .graph import Node
from .reader import GraphReader, value_node


def direction_or(reader: GraphReader, name: str) -> Expr:
    """A leaf of a surface; in a world the direction looked at, and for normals its opposite, as in Cycles."""
    if not reader.is_world:
        return leaf(name)
    return -leaf("direction_ws") if "normal" in name else leaf("direction_ws")


def incoming(reader: GraphReader) -> Expr:
    return -leaf("direction_ws") if reader.is_world else leaf("incoming_ws")


def uv(reader: GraphReader, layer: str | None) -> Expr:
    """A UV layer; None: the active one. A world has none: 0."""
    return literal((0.0, 0.0, 0.0)) if reader.is_world else layer_leaf("uv", layer or None)


def unsupported_output(reader: GraphReader, node: Node, output: str) -> Expr:
    reader.warn(node, f"has no output '{output}' yet; a neutral value takes its place")
    return reader.neutral(node, output)


@value_node("ShaderNodeTexCoord")
def texture_coordinate(reader: GraphReader, node: Node, output: str) -> Expr:
    if output == "Object" and node.properties.get("object"):
        reader.warn(node, f"uses the coordinates of object '{node.properties['object']}'; the own object's are used")
    if node.properties.get("from_instancer"):
        reader.warn(node, "asks for the coordinates of the instancer; the own ones are used")
    if output == "Generated":
        return direction_or(reader, "generated")
    if output == "Object":
        return direction_or(reader, "position_os")
    if output == "Normal":
        return direction_or(reader, "normal_os")
    if output == "UV":
        return uv(reader, None)
    if output == "Reflection":
        if reader.is_world:
            return -leaf("direction_ws")
        normal, view = leaf("normal_ws"), leaf("incoming_ws")
        return normal * (2.0 * dot(normal, view)) - view
    return unsupported_output(reader, node, output)


@value_node("ShaderNodeUVMap")
def uv_map(reader: GraphReader, node: Node, output: str) -> Expr:
    return uv(reader, node.properties.get("uv_map"))


def _attribute_output(value: Expr, output: str) -> Expr:
    if output == "Alpha":
        return value.w if value.type == "vec4" else literal(1.0)
    if output == "Fac":
        return average(value.rgb)
    return value.rgb


@value_node("ShaderNodeVertexColor")
def color_attribute(reader: GraphReader, node: Node, output: str) -> Expr:
    if reader.is_world:
        return literal(0.0)
    return _attribute_output(layer_leaf("color", node.properties.get("layer_name") or None), output)


@value_node("ShaderNodeAttribute")
def attribute(reader: GraphReader, node: Node, output: str) -> Expr:
    name = node.properties.get("attribute_name") or ""
    kind = node.properties.get("attribute_type", "GEOMETRY")
    if kind != "GEOMETRY":
        reader.warn(node, f"reads an attribute of the {kind.lower().replace('_', ' ')}; that gives 0 for now")
        return literal(0.0)
    if reader.is_world or not name:
        return literal(0.0)
    if name in reader.known_uv_layers:
        return _attribute_output(layer_leaf("uv", name), output)
    return _attribute_output(layer_leaf("color", name), output)


@value_node("ShaderNodeNewGeometry")
def geometry(reader: GraphReader, node: Node, output: str) -> Expr:
    if output == "Incoming":
        return incoming(reader)
    if output == "Backfacing":
        return literal(0.0) if reader.is_world else leaf("back_facing")
    names = {"Position": "position_ws", "Normal": "normal_ws", "True Normal": "geometric_normal_ws"}
    if output in names:
        return direction_or(reader, names[output])
    if output == "Tangent" and not reader.is_world:
        return layer_leaf("uv_tangent", None)
    return unsupported_output(reader, node, output)


@value_node("ShaderNodeTangent")
def tangent(reader: GraphReader, node: Node, output: str) -> Expr:
    if node.properties.get("direction_type") != "UV_MAP" or reader.is_world:
        reader.warn(node, "gives the tangent of the UV map instead of a radial one")
    if reader.is_world:
        return literal((1.0, 0.0, 0.0))
    return layer_leaf("uv_tangent", node.properties.get("uv_map") or None)


@value_node("ShaderNodeObjectInfo")
def object_info(reader: GraphReader, node: Node, output: str) -> Expr:
    names = {"Location": "object_position_ws", "Object Index": "object_index", "Random": "object_random"}
    if reader.is_world:
        return literal(0.0)
    if output in names:
        return leaf(names[output])
    reader.warn(node, f"has no output '{output}' yet; its default takes its place")
    return literal(0.0) if output == "Material Index" else literal(1.0)


#: What a ray is, where a picture is taken (materials) and where light is gathered (worlds).
_LIGHT_PATH_MATERIAL = {"Is Camera Ray": 1.0}
_LIGHT_PATH_WORLD = {"Is Diffuse Ray": 1.0, "Is Reflection Ray": 1.0, "Ray Depth": 1.0, "Diffuse Depth": 1.0}


@value_node("ShaderNodeLightPath")
def light_path(reader: GraphReader, node: Node, output: str) -> Expr:
    if reader.is_world:
        reader.warn(node, "is read as for light that falls on surfaces; the background shows the same")
        return literal(_LIGHT_PATH_WORLD.get(output, 0.0))
    reader.warn(node, "is read as for rays from the camera, also where light bounces")
    return literal(_LIGHT_PATH_MATERIAL.get(output, 0.0))


# --- Fresnel --------------------


def fresnel_dielectric(cosine: Expr, eta: Expr) -> Expr:
    """Unpolarized reflectance of a smooth dielectric, Fresnel's equations in the form of Cook and Torrance 1982.

    ``eta``: index of refraction behind over in front of the surface; total reflection gives 1.
    """
    c = absolute(cosine)
    g_squared = eta * eta - 1.0 + c * c
    g = sqrt(g_squared)
    a = (g - c) / (g + c)
    b = (c * (g + c) - 1.0) / (c * (g - c) + 1.0)
    return select(less(0.0, g_squared), 0.5 * a * a * (1.0 + b * b), 1.0)


def view_cosine(reader: GraphReader, normal: Expr) -> Expr:
    """Cosine between a normal and the viewer."""
    if reader.is_world:
        return literal(1.0)
    if normal is leaf("normal_ws"):
        return leaf("view_cosine")
    return absolute(dot(normal, leaf("incoming_ws")))


@value_node("ShaderNodeFresnel")
def fresnel(reader: GraphReader, node: Node, output: str) -> Expr:
    eta = maximum(reader.number(node, "IOR", 1.5), 1e-5)
    if not reader.is_world:
        eta = select(leaf("back_facing"), 1.0 / eta, eta)
    return fresnel_dielectric(view_cosine(reader, reader.normal(node)), eta)


@value_node("ShaderNodeLayerWeight")
def layer_weight(reader: GraphReader, node: Node, output: str) -> Expr:
    blend = reader.number(node, "Blend", 0.5)
    cosine = view_cosine(reader, reader.normal(node))
    if output == "Fresnel":
        inverse = maximum(1.0 - blend, 1e-5)
        eta = 1.0 / inverse if reader.is_world else select(leaf("back_facing"), inverse, 1.0 / inverse)
        return fresnel_dielectric(cosine, eta)
    blend = clamp(blend, 0.0, 1.0 - 1e-5)
    exponent = select(less(blend, 0.5), 2.0 * blend, 0.5 / (1.0 - blend))
    return 1.0 - power(cosine, exponent)


# --- normals --------------------


@value_node("ShaderNodeNormalMap")
def normal_map(reader: GraphReader, node: Node, output: str) -> Expr:
    base = reader.default_normal()
    strength = structural(maximum(reader.number(node, "Strength", 1.0), 0.0))
    if reader.is_world or strength.is_literal(0.0):
        return base
    bend = reader.color(node, "Color", (0.5, 0.5, 1.0)) * 2.0 - 1.0
    if node.properties.get("convention") == "DIRECTX":
        bend = bend * literal((1.0, -1.0, 1.0))
    space = node.properties.get("space", "TANGENT")
    if space == "TANGENT":
        layer = node.properties.get("uv_map") or None
        tangent, bitangent = layer_leaf("uv_tangent", layer), layer_leaf("uv_bitangent", layer)
        mapped = operation("tangent_normal", bend, base, tangent, bitangent, leaf("back_facing"))
    else:
        if space.startswith("BLENDER_"):
            bend = bend * literal((1.0, -1.0, -1.0))  # Blender's old bakes have y and z turned round
        if space.endswith("OBJECT"):
            reader.warn(node, "is in object space: rotation of the object is not followed yet")
        mapped = operation("normalize", bend) * (1.0 - 2.0 * leaf("back_facing"))
    if strength.is_literal(1.0):
        return mapped
    return operation("normalize", base + (mapped - base) * strength)


@value_node("ShaderNodeBump")
def bump(reader: GraphReader, node: Node, output: str) -> Expr:
    reader.warn(node, "is not supported yet; its normal passes through")
    return reader.normal(node)
