# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that work on colours: Mix, ColorRamp, Separate/Combine Color, Hue/Saturation, Invert, Gamma, ..."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .blackbody import blackbody_table
from .expression import (
    Expr,
    absolute,
    clamp,
    constant,
    fract,
    less,
    literal,
    luminance,
    maximum,
    minimum,
    mix,
    operation,
    power,
    ramp,
    select,
    structural,
    vec3,
)  # fmt: skip
from .graph import Node
from .reader import GraphReader, value_node

# --- colour spaces --------------------


def rgb_to_hsv(color: Expr) -> Expr:
    """Hue, saturation, value; hue in [0, 1)."""
    r, g, b = color.x, color.y, color.z
    high = maximum(maximum(r, g), b)
    return vec3(_hue(color, high), (high - minimum(minimum(r, g), b)) / high, high)


def _hue(color: Expr, high: Expr) -> Expr:
    r, g, b = color.x, color.y, color.z
    span = high - minimum(minimum(r, g), b)
    sixth = select(
        operation("equal", r, high), (g - b) / span,
        select(operation("equal", g, high), 2.0 + (b - r) / span, 4.0 + (r - g) / span),
    )  # fmt: skip
    return select(operation("equal", span, literal(0.0)), 0.0, fract(sixth * literal(1 / 6)))


def _pure_hue(hue: Expr) -> Expr:
    """The brightest colour of a hue."""
    offsets = literal((1.0, 2 / 3, 1 / 3))
    return clamp(absolute(fract(hue.rgb + offsets) * 6.0 - 3.0) - 1.0)


def hsv_to_rgb(hsv: Expr) -> Expr:
    return ((_pure_hue(hsv.x) - 1.0) * hsv.y + 1.0) * hsv.z


def rgb_to_hsl(color: Expr) -> Expr:
    high = maximum(maximum(color.x, color.y), color.z)
    low = minimum(minimum(color.x, color.y), color.z)
    lightness = minimum((high + low) * 0.5, 1.0)
    saturation = (high - low) / select(less(0.5, lightness), 2.0 - high - low, high + low)
    return vec3(_hue(color, high), saturation, lightness)


def hsl_to_rgb(hsl: Expr) -> Expr:
    chroma = (1.0 - absolute(hsl.z * 2.0 - 1.0)) * hsl.y
    return (_pure_hue(hsl.x) - 0.5) * chroma + hsl.z


_TO_RGB = {"HSV": hsv_to_rgb, "HSL": hsl_to_rgb}
_FROM_RGB = {"HSV": rgb_to_hsv, "HSL": rgb_to_hsl}


def _component(color: Expr, output: str, names: str) -> Expr:
    return (color.x, color.y, color.z)[names.index(output[:1])]


@value_node("ShaderNodeSeparateColor")
def separate_color(reader: GraphReader, node: Node, output: str) -> Expr:
    color = reader.color(node, "Color")
    mode = node.properties.get("mode", "RGB")
    return _component(_FROM_RGB[mode](color) if mode in _FROM_RGB else color, output, "RGB")


@value_node("ShaderNodeCombineColor")
def combine_color(reader: GraphReader, node: Node, output: str) -> Expr:
    color = vec3(*(reader.number(node, name) for name in ("Red", "Green", "Blue")))
    mode = node.properties.get("mode", "RGB")
    return _TO_RGB[mode](color) if mode in _TO_RGB else color


@value_node("ShaderNodeSeparateRGB")
def separate_rgb(reader: GraphReader, node: Node, output: str) -> Expr:
    return _component(reader.color(node, "Image"), output, "RGB")


@value_node("ShaderNodeCombineRGB")
def combine_rgb(reader: GraphReader, node: Node, output: str) -> Expr:
    return vec3(*(reader.number(node, name) for name in "RGB"))


@value_node("ShaderNodeSeparateHSV")
def separate_hsv(reader: GraphReader, node: Node, output: str) -> Expr:
    return _component(rgb_to_hsv(reader.color(node, "Color")), output, "HSV")


@value_node("ShaderNodeCombineHSV")
def combine_hsv(reader: GraphReader, node: Node, output: str) -> Expr:
    return hsv_to_rgb(vec3(*(reader.number(node, name) for name in "HSV")))


# --- blending --------------------


def _is_zero(expr: Expr) -> Expr:
    return operation("equal", expr, literal(0.0))


def _screen(a: Expr, b: Expr, t: Expr) -> Expr:
    return 1.0 - (1.0 - t + t * (1.0 - b)) * (1.0 - a)


def _overlay(a: Expr, b: Expr, t: Expr) -> Expr:
    dark = a * (1.0 - t + 2.0 * t * b)
    light = 1.0 - (1.0 - t + 2.0 * t * (1.0 - b)) * (1.0 - a)
    return select(less(a, 0.5), dark, light)


def _divide(a: Expr, b: Expr, t: Expr) -> Expr:
    return select(_is_zero(b), a, mix(a, a / b, t))


def _dodge(a: Expr, b: Expr, t: Expr) -> Expr:
    rest = 1.0 - t * b
    return select(_is_zero(a), 0.0, select(less(0.0, rest), minimum(a / rest, 1.0), 1.0))


def _burn(a: Expr, b: Expr, t: Expr) -> Expr:
    rest = 1.0 - t + t * b
    return select(less(0.0, rest), clamp(1.0 - (1.0 - a) / rest), 0.0)


def _soft_light(a: Expr, b: Expr, t: Expr) -> Expr:
    return mix(a, (1.0 - a) * b * a + a * (1.0 - (1.0 - b) * (1.0 - a)), t)


def _hue_blend(a: Expr, b: Expr, t: Expr) -> Expr:
    hsv_a, hsv_b = rgb_to_hsv(a), rgb_to_hsv(b)
    return select(_is_zero(hsv_b.y).rgb, a, mix(a, hsv_to_rgb(vec3(hsv_b.x, hsv_a.y, hsv_a.z)), t))


def _saturation_blend(a: Expr, b: Expr, t: Expr) -> Expr:
    hsv_a, hsv_b = rgb_to_hsv(a), rgb_to_hsv(b)
    return select(_is_zero(hsv_a.y).rgb, a, hsv_to_rgb(vec3(hsv_a.x, mix(hsv_a.y, hsv_b.y, t.x), hsv_a.z)))


def _value_blend(a: Expr, b: Expr, t: Expr) -> Expr:
    hsv_a, hsv_b = rgb_to_hsv(a), rgb_to_hsv(b)
    return hsv_to_rgb(vec3(hsv_a.x, hsv_a.y, mix(hsv_a.z, hsv_b.z, t.x)))


def _color_blend(a: Expr, b: Expr, t: Expr) -> Expr:
    hsv_a, hsv_b = rgb_to_hsv(a), rgb_to_hsv(b)
    return select(_is_zero(hsv_b.y).rgb, a, mix(a, hsv_to_rgb(vec3(hsv_b.x, hsv_b.y, hsv_a.z)), t))


#: Blend types of Mix: (lower a, upper b, factor t) -> colour.
BLEND: dict[str, Callable[[Expr, Expr, Expr], Expr]] = {
    "MIX": mix,
    "DARKEN": lambda a, b, t: mix(a, minimum(a, b), t),
    "MULTIPLY": lambda a, b, t: mix(a, a * b, t),
    "BURN": _burn,
    "LIGHTEN": lambda a, b, t: mix(a, maximum(a, b), t),
    "SCREEN": _screen,
    "DODGE": _dodge,
    "ADD": lambda a, b, t: mix(a, a + b, t),
    "OVERLAY": _overlay,
    "SOFT_LIGHT": _soft_light,
    "LINEAR_LIGHT": lambda a, b, t: a + t * (2.0 * b - 1.0),
    "DIFFERENCE": lambda a, b, t: mix(a, absolute(a - b), t),
    "EXCLUSION": lambda a, b, t: maximum(mix(a, a + b - 2.0 * a * b, t), 0.0),
    "SUBTRACT": lambda a, b, t: mix(a, a - b, t),
    "DIVIDE": _divide,
    "HUE": _hue_blend,
    "SATURATION": _saturation_blend,
    "COLOR": _color_blend,
    "VALUE": _value_blend,
}


def blended(reader: GraphReader, node: Node, a: Expr, b: Expr, factor: Expr) -> Expr:
    kind = node.properties.get("blend_type", "MIX")
    if kind not in BLEND:
        reader.warn(node, f"does not know the blend type {kind}; it mixes")
        kind = "MIX"
    if factor.is_literal(0.0):
        return a
    return BLEND[kind](a, b, factor)


@value_node("ShaderNodeMixRGB")
def mix_rgb(reader: GraphReader, node: Node, output: str) -> Expr:
    factor = structural(clamp(reader.number(node, "Fac", 0.5)))
    answer = blended(reader, node, reader.color(node, "Color1"), reader.color(node, "Color2"), factor)
    return clamp(answer) if node.properties.get("use_clamp") else answer


@value_node("ShaderNodeMix")
def mix_node(reader: GraphReader, node: Node, output: str) -> Expr:
    kind = node.properties.get("data_type", "FLOAT")
    uniform = kind != "VECTOR" or node.properties.get("factor_mode", "UNIFORM") == "UNIFORM"
    factor = reader.number(node, "Factor_Float", 0.5) if uniform else reader.vector(node, "Factor_Vector", 0.5)
    factor = structural(clamp(factor) if node.properties.get("clamp_factor", True) else factor)
    if kind == "FLOAT":
        return mix(reader.number(node, "A_Float"), reader.number(node, "B_Float"), factor)
    if kind == "VECTOR":
        return mix(reader.vector(node, "A_Vector"), reader.vector(node, "B_Vector"), factor)
    if kind == "ROTATION":
        reader.warn(node, "mixes rotations as if they were vectors")
        return mix(reader.vector(node, "A_Rotation"), reader.vector(node, "B_Rotation"), factor)
    answer = blended(reader, node, reader.color(node, "A_Color"), reader.color(node, "B_Color"), factor)
    return clamp(answer) if node.properties.get("clamp_result") else answer


# --- one colour to another --------------------


@value_node("ShaderNodeInvert")
def invert(reader: GraphReader, node: Node, output: str) -> Expr:
    color = reader.color(node, "Color")
    return mix(color, 1.0 - color, reader.weight(node, "Fac", 1.0))


@value_node("ShaderNodeGamma")
def gamma(reader: GraphReader, node: Node, output: str) -> Expr:
    color, exponent = reader.color(node, "Color"), reader.number(node, "Gamma", 1.0)
    raised = select(less(0.0, color), power(maximum(color, 0.0), exponent), color)
    return select(operation("equal", exponent, literal(0.0)), 1.0, raised)


@value_node("ShaderNodeBrightContrast")
def bright_contrast(reader: GraphReader, node: Node, output: str) -> Expr:
    contrast = reader.number(node, "Contrast")
    offset = reader.number(node, "Bright") - contrast * 0.5
    return maximum(reader.color(node, "Color") * (1.0 + contrast) + offset, 0.0)


@value_node("ShaderNodeHueSaturation")
def hue_saturation(reader: GraphReader, node: Node, output: str) -> Expr:
    color = reader.color(node, "Color")
    hsv = rgb_to_hsv(color)
    changed = hsv_to_rgb(
        vec3(
            fract(hsv.x + reader.number(node, "Hue", 0.5) + 0.5),
            clamp(hsv.y * reader.number(node, "Saturation", 1.0)),
            hsv.z * reader.number(node, "Value", 1.0),
        )
    )
    return maximum(mix(color, changed, reader.weight(node, "Fac", 1.0)), 0.0)


@value_node("ShaderNodeRGBToBW")
def rgb_to_bw(reader: GraphReader, node: Node, output: str) -> Expr:
    return luminance(reader.color(node, "Color"))


@value_node("ShaderNodeValToRGB")
def color_ramp(reader: GraphReader, node: Node, output: str) -> Expr:
    if not node.ramp:
        return literal(1.0) if output == "Alpha" else literal(0.5)
    table = np.array([(position, *color) for position, color in node.ramp])
    is_constant = node.properties.get("ramp_interpolation") == "CONSTANT"
    color = ramp(table, reader.number(node, "Fac", 0.5), is_constant)
    return color.w if output == "Alpha" else color.rgb


@value_node("ShaderNodeRGBCurve")
def rgb_curves(reader: GraphReader, node: Node, output: str) -> Expr:
    """The curves come as a table over 0..1 of what each channel becomes; outside they end."""
    color = reader.color(node, "Color")
    if not node.ramp:
        reader.warn(node, "has no curves that could be read; its colour passes through")
        return color
    table = np.array([(position, *value) for position, value in node.ramp])
    curved = vec3(ramp(table, color.x).x, ramp(table, color.y).y, ramp(table, color.z).z)
    return mix(color, curved, reader.weight(node, "Fac", 1.0))


@value_node("ShaderNodeBlackbody")
def blackbody(reader: GraphReader, node: Node, output: str) -> Expr:
    temperature = reader.number(node, "Temperature", 6500.0)
    table, low, high = blackbody_table()
    return ramp(table, clamp((temperature - low) * literal(1.0 / (high - low)))).rgb


@value_node("ShaderNodeRGB")
def rgb(reader: GraphReader, node: Node, output: str) -> Expr:
    value = node.output_values.get(output, node.output_values.get("Color"))
    return constant(value[:3]) if isinstance(value, tuple) and len(value) >= 3 else literal((0.5, 0.5, 0.5))


@value_node("ShaderNodeValue")
def value(reader: GraphReader, node: Node, output: str) -> Expr:
    number = node.output_values.get(output, node.output_values.get("Value"))
    return constant(float(number)) if isinstance(number, int | float) else literal(0.0)
