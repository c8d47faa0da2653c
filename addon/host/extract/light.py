# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's lights in radiometric units (see light_units.py)."""

from __future__ import annotations

import math
import warnings as python_warnings
from typing import Any

import bpy
import numpy as np

from ... import light_units
from ...scene import AreaShape, DoubleArray, FloatArray, LightData, LightKind, RayVisibility
from .transforms import rigid


def extract_light(
    obj: bpy.types.Object, world_from_object: DoubleArray, visibility: RayVisibility, warnings: list[str]
) -> LightData | None:
    """One light at one place; None when it gives no light. Appends to ``warnings`` what is not as the user asked."""
    light = obj.data
    kind = LightKind[light.type]
    if kind is LightKind.AREA and getattr(getattr(light, "cycles", None), "is_portal", False):
        return None
    energy = light_units.power(light.energy, getattr(light, "exposure", 0.0))
    color = _color(light) * node_factor(light, obj.name, warnings)
    if not (math.isfinite(energy) and np.isfinite(color).all()):
        _warn_once(warnings, f'light "{obj.name}": its strength or colour is not a number; left out')
        return None
    if energy < 0.0 or (color < 0.0).any():
        _warn_once(warnings, f'light "{obj.name}": negative light is not supported; what is negative counts as 0')
        color = np.maximum(color, 0.0)
    if energy <= 0.0 or not color.any():
        return None
    _warn_unsupported(obj, warnings)

    scale = np.linalg.norm(world_from_object[:3, :3], axis=0)
    common: dict[str, Any] = {
        "name": obj.name,
        "kind": kind,
        "position": world_from_object[:3, 3].copy(),
        "axes": rigid(world_from_object)[:3, :3].T.copy(),
        "casts_shadow": bool(light.use_shadow),
        "visibility": visibility,
    }
    normalize = getattr(light, "normalize", True)
    if kind is LightKind.SUN:
        factor = light_units.sun_irradiance(energy, light.angle, normalize)
        return LightData(intensity=_intensity(color, factor), angle=light.angle, **common)
    if kind is LightKind.AREA:
        shape = AreaShape.ELLIPSE if light.shape in ("DISK", "ELLIPSE") else AreaShape.RECTANGLE
        side_y = light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
        size = (float(light.size * scale[0]), float(side_y * scale[1]))
        area = light_units.area(shape, size)
        if area <= 0.0:
            _warn_once(warnings, f'light "{obj.name}": an area light of size 0 gives no light; give it a size')
            return None
        spread = max(light.spread, light_units.MINIMUM_SPREAD)
        factor = light_units.area_radiance(energy, area, spread, normalize)
        return LightData(intensity=_intensity(color, factor), shape=shape, size=size, spread=spread, **common)
    common["radius"] = light.shadow_soft_size
    common["soft_falloff"] = bool(getattr(light, "use_soft_falloff", True))
    intensity = _intensity(color, light_units.point_intensity(energy, light.shadow_soft_size, normalize))
    if kind is LightKind.SPOT:
        return LightData(
            intensity=intensity,
            spot_angle=light.spot_size,
            spot_blend=light.spot_blend,
            spot_scale=(float(scale[0]), float(scale[1]), float(scale[2])),
            **common,
        )
    return LightData(intensity=intensity, **common)


def _color(light: bpy.types.Light) -> DoubleArray:
    """(3,) the light's colour, times that of its temperature where it has one (Blender converts it to RGB)."""
    color = np.array(light.color, np.float64)
    if getattr(light, "use_temperature", False):
        color *= np.array(light.temperature_color, np.float64)
    return color


def _intensity(color: DoubleArray, factor: float) -> FloatArray:
    return np.minimum(color * factor, np.finfo(np.float32).max).astype(np.float32)


def _warn_unsupported(obj: bpy.types.Object, warnings: list[str]) -> None:
    linking = getattr(obj, "light_linking", None)
    if linking is not None and (linking.receiver_collection or linking.blocker_collection):
        _warn_once(warnings, f'light "{obj.name}": light linking is not supported; it lights everything')


def node_factor(light: bpy.types.Light, name: str, warnings: list[str]) -> DoubleArray:
    """(3,) what the light's nodes multiply its colour by: colour times strength of its Emission; 1 without nodes.

    Understood: an Emission at the output, with values, RGB and Value nodes, and Light Falloff > Quadratic (which is
    the physical one) at its inputs. Anything else keeps the socket's own value, with a warning.
    """
    with python_warnings.catch_warnings():
        # Blender 5.1 and later give every light nodes, and call reading the switch deprecated.
        python_warnings.simplefilter("ignore", DeprecationWarning)
        uses_nodes = light.node_tree is not None and light.use_nodes
    if not uses_nodes:
        return np.ones(3)
    output = light.node_tree.get_output_node("ALL")
    emission = _linked_node(output.inputs["Surface"])[0] if output is not None else None
    if emission is None:
        _warn_once(warnings, f'light "{name}": nothing is connected to its output node; it gives no light')
        return np.zeros(3)
    if emission.bl_idname != "ShaderNodeEmission":
        _warn_once(warnings, f'light "{name}": node "{emission.name}" is not supported in lights; taken as white')
        return np.ones(3)
    color = np.array(_constant(emission.inputs["Color"], name, warnings)[:3], np.float64)
    strength = _constant(emission.inputs["Strength"], name, warnings)
    return color * float(strength)


def _linked_node(socket: bpy.types.NodeSocket) -> tuple[bpy.types.Node | None, str]:
    """The node that feeds a socket, and the identifier of its output; reroutes are followed."""
    while socket.is_linked and socket.links:
        link = socket.links[0]
        if link.is_muted or not link.is_valid:
            break
        if link.from_node.bl_idname != "NodeReroute":
            return link.from_node, link.from_socket.identifier
        socket = link.from_node.inputs[0]
    return None, ""


def _constant(socket: bpy.types.NodeSocket, light_name: str, warnings: list[str]) -> Any:
    """Value of a socket: (4,) floats for a colour, one for a number."""
    node, output = _linked_node(socket)
    if node is None:
        return socket.default_value
    is_color = socket.type == "RGBA"
    if node.bl_idname in ("ShaderNodeRGB", "ShaderNodeValue"):
        value = node.outputs[0].default_value
        if is_color:
            return value if node.bl_idname == "ShaderNodeRGB" else (value, value, value, 1.0)
        if node.bl_idname == "ShaderNodeValue":
            return value
    if node.bl_idname == "ShaderNodeLightFalloff" and output == "Quadratic" and not is_color:
        smooth = node.inputs["Smooth"]
        if not (node.inputs["Strength"].is_linked or smooth.is_linked or smooth.default_value):
            return node.inputs["Strength"].default_value
    what = "textures" if node.bl_idname.startswith("ShaderNodeTex") else "such nodes"
    _warn_once(warnings, f'light "{light_name}": node "{node.name}": {what} are not supported in lights; '
                         f"the value of the socket {socket.name} is used")
    return socket.default_value


def _warn_once(warnings: list[str], text: str) -> None:
    if text not in warnings:
        warnings.append(text)
