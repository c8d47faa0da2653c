# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that calculate with numbers and vectors: Math, Vector Math, Map Range, Clamp, Separate, Combine, Mapping, ...

Formulas follow what Blender's manual and the pictures of Cycles say of each operation; a, b, c are the inputs in order.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from .expression import (
    Expr,
    absolute,
    clamp,
    constant,
    cross,
    dot,
    floor,
    fract,
    length,
    less,
    literal,
    maximum,
    minimum,
    normalize,
    operation,
    power,
    select,
    splat,
    sqrt,
    vec3,
)  # fmt: skip
from .graph import Node
from .reader import GraphReader, value_node


def smooth_minimum(a: Expr, b: Expr, distance: Expr) -> Expr:
    h = maximum(distance - absolute(a - b), 0.0) / distance
    return minimum(a, b) - h * h * h * distance * literal(1 / 6)


def wrap(a: Expr, high: Expr, low: Expr) -> Expr:
    """``a`` shifted by a whole number of ranges into [low, high)."""
    span = high - low
    return select(operation("equal", span, literal(0.0)), low, a - span * floor((a - low) / span))


def pingpong(a: Expr, scale: Expr) -> Expr:
    return absolute(fract((a - scale) / (scale * 2.0)) * scale * 2.0 - scale)


def _one(name: str) -> Callable[[Expr, Expr, Expr], Expr]:
    return lambda a, b, c: operation(name, a)


def _two(name: str) -> Callable[[Expr, Expr, Expr], Expr]:
    return lambda a, b, c: operation(name, a, b)


def _inverse_sqrt(a: Expr) -> Expr:
    return select(less(0.0, a), 1.0 / sqrt(a), 0.0)


#: Operations that Math and Vector Math have alike.
COMMON = {
    "ADD": lambda a, b, c: a + b,
    "SUBTRACT": lambda a, b, c: a - b,
    "MULTIPLY": lambda a, b, c: a * b,
    "DIVIDE": lambda a, b, c: a / b,
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": _two("pow"),
    "ABSOLUTE": _one("abs"),
    "SIGN": _one("sign"),
    "MINIMUM": _two("min"),
    "MAXIMUM": _two("max"),
    "ROUND": lambda a, b, c: floor(a + 0.5),
    "FLOOR": _one("floor"),
    "CEIL": _one("ceil"),
    "FRACTION": _one("fract"),
    "MODULO": _two("fmod"),
    "WRAP": wrap,
    "SNAP": lambda a, b, c: floor(a / b) * b,
    "SINE": _one("sin"),
    "COSINE": _one("cos"),
    "TANGENT": _one("tan"),
}

MATH = COMMON | {
    "FRACT": _one("fract"),
    "LOGARITHM": lambda a, b, c: operation("log", a) / operation("log", b),
    "SQRT": _one("sqrt"),
    "INVERSE_SQRT": lambda a, b, c: _inverse_sqrt(a),
    "EXPONENT": _one("exp"),
    "LESS_THAN": lambda a, b, c: less(a, b),
    "GREATER_THAN": lambda a, b, c: less(b, a),
    "COMPARE": lambda a, b, c: 1.0 - less(maximum(c, 1e-5), absolute(a - b)),
    "SMOOTH_MIN": smooth_minimum,
    "SMOOTH_MAX": lambda a, b, c: -smooth_minimum(-a, -b, c),
    "TRUNC": _one("trunc"),
    "FLOORED_MODULO": lambda a, b, c: a - select(operation("equal", b, literal(0.0)), a, floor(a / b) * b),
    "PINGPONG": lambda a, b, c: pingpong(a, b),
    "ARCSINE": _one("asin"),
    "ARCCOSINE": _one("acos"),
    "ARCTANGENT": _one("atan"),
    "ARCTAN2": _two("atan2"),
    "SINH": _one("sinh"),
    "COSH": _one("cosh"),
    "TANH": _one("tanh"),
    "RADIANS": lambda a, b, c: a * literal(math.pi / 180.0),
    "DEGREES": lambda a, b, c: a * literal(180.0 / math.pi),
}


def _refract(incident: Expr, normal: Expr, eta: Expr) -> Expr:
    cosine = dot(normal, incident)
    k = 1.0 - eta * eta * (1.0 - cosine * cosine)
    bent = incident * eta - normal * (eta * cosine + sqrt(k))
    return bent * (1.0 - less(k, 0.0))


#: Vector Math: (a, b, c, scale) -> vector or float.
VECTOR_MATH = {
    "CROSS_PRODUCT": lambda a, b, c, s: cross(a, b),
    "PROJECT": lambda a, b, c, s: b * (dot(a, b) / dot(b, b)),
    "REFLECT": lambda a, b, c, s: a - normalize(b) * (2.0 * dot(a, normalize(b))),
    "REFRACT": lambda a, b, c, s: _refract(a, normalize(b), s),
    "FACEFORWARD": lambda a, b, c, s: select(less(dot(c, b), 0.0), a, -a),
    "DOT_PRODUCT": lambda a, b, c, s: dot(a, b),
    "DISTANCE": lambda a, b, c, s: length(a - b),
    "LENGTH": lambda a, b, c, s: length(a),
    "SCALE": lambda a, b, c, s: a * s,
    "NORMALIZE": lambda a, b, c, s: normalize(a),
}
_VECTOR_MATH_NUMBERS = ("DOT_PRODUCT", "DISTANCE", "LENGTH")


@value_node("ShaderNodeMath")
def math_node(reader: GraphReader, node: Node, output: str) -> Expr:
    inputs = [reader.number(node, name) for name in ("Value", "Value_001", "Value_002")]
    name = node.properties.get("operation", "ADD")
    if name not in MATH:
        reader.warn(node, f"does not know the operation {name}; its first value passes through")
        return inputs[0]
    answer = MATH[name](*inputs)
    return clamp(answer) if node.properties.get("use_clamp") else answer


@value_node("ShaderNodeVectorMath")
def vector_math(reader: GraphReader, node: Node, output: str) -> Expr:
    a, b, c = (reader.vector(node, name) for name in ("Vector", "Vector_001", "Vector_002"))
    name = node.properties.get("operation", "ADD")
    if (output == "Value") != (name in _VECTOR_MATH_NUMBERS):
        return literal(0.0)  # Blender hides this output and leaves it 0
    if name in VECTOR_MATH:
        return VECTOR_MATH[name](a, b, c, reader.number(node, "Scale"))
    if name in COMMON:
        return COMMON[name](a, b, c)
    reader.warn(node, f"does not know the operation {name}; its first vector passes through")
    return a


@value_node("ShaderNodeClamp")
def clamp_node(reader: GraphReader, node: Node, output: str) -> Expr:
    value, low, high = (reader.number(node, name) for name in ("Value", "Min", "Max"))
    if node.properties.get("clamp_type") == "RANGE":
        low, high = minimum(low, high), maximum(low, high)
    return clamp(value, low, high)


def _smooth(t: Expr) -> Expr:
    return t * t * (3.0 - 2.0 * t)


def _smoother(t: Expr) -> Expr:
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


@value_node("ShaderNodeMapRange")
def map_range(reader: GraphReader, node: Node, output: str) -> Expr:
    if node.properties.get("data_type") == "FLOAT_VECTOR":
        value = reader.vector(node, "Vector")
        low, high, to_low, to_high, steps = (
            reader.vector(node, f"{name}_FLOAT3") for name in ("From_Min", "From_Max", "To_Min", "To_Max", "Steps")
        )
    else:
        value = reader.number(node, "Value")
        low, high, to_low, to_high, steps = (
            reader.number(node, name) for name in ("From Min", "From Max", "To Min", "To Max", "Steps")
        )
    kind = node.properties.get("interpolation_type", "LINEAR")
    factor = (value - low) / (high - low)
    if kind == "STEPPED":
        factor = floor(factor * (steps + 1.0)) / steps
    elif kind == "SMOOTHSTEP":
        factor = _smooth(clamp(factor))
    elif kind == "SMOOTHERSTEP":
        factor = _smoother(clamp(factor))
    answer = to_low + factor * (to_high - to_low)
    if node.properties.get("clamp", True) and kind in ("LINEAR", "STEPPED"):
        answer = clamp(answer, minimum(to_low, to_high), maximum(to_low, to_high))
    return answer


@value_node("ShaderNodeSeparateXYZ")
def separate_xyz(reader: GraphReader, node: Node, output: str) -> Expr:
    vector = reader.vector(node, "Vector")
    return {"X": vector.x, "Y": vector.y, "Z": vector.z}[output]


@value_node("ShaderNodeCombineXYZ")
def combine_xyz(reader: GraphReader, node: Node, output: str) -> Expr:
    return vec3(*(reader.number(node, name) for name in "XYZ"))


def rotation_rows(euler: Expr) -> tuple[Expr, Expr, Expr]:
    """Rows of the matrix Rz Ry Rx of Euler angles XYZ in radians."""
    sx, sy, sz = (operation("sin", angle) for angle in (euler.x, euler.y, euler.z))
    cx, cy, cz = (operation("cos", angle) for angle in (euler.x, euler.y, euler.z))
    return (
        vec3(cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz),
        vec3(cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz),
        vec3(-sy, sx * cy, cx * cy),
    )


def _is_all(expr: Expr, number: float) -> bool:
    return expr.is_known and bool((expr.value == number).all())


def rotated(vector: Expr, euler: Expr) -> Expr:
    if _is_all(euler, 0.0):
        return vector
    return vec3(*(dot(row, vector) for row in rotation_rows(euler)))


def rotated_back(vector: Expr, euler: Expr) -> Expr:
    if _is_all(euler, 0.0):
        return vector
    rows = rotation_rows(euler)
    return rows[0] * vector.x + rows[1] * vector.y + rows[2] * vector.z


@value_node("ShaderNodeMapping")
def mapping(reader: GraphReader, node: Node, output: str) -> Expr:
    vector, location, rotation, scale = (
        reader.vector(node, name) for name in ("Vector", "Location", "Rotation", "Scale")
    )
    moved = not _is_all(location, 0.0)
    kind = node.properties.get("vector_type", "POINT")
    if kind == "TEXTURE":
        return rotated_back(vector - location if moved else vector, rotation) / scale
    if kind == "NORMAL":
        return normalize(rotated(vector / scale, rotation))
    answer = rotated(vector if _is_all(scale, 1.0) else vector * scale, rotation)
    return answer + location if moved and kind == "POINT" else answer


@value_node("ShaderNodeVectorRotate")
def vector_rotate(reader: GraphReader, node: Node, output: str) -> Expr:
    vector, center = reader.vector(node, "Vector"), reader.vector(node, "Center")
    invert = bool(node.properties.get("invert"))
    kind = node.properties.get("rotation_type", "AXIS_ANGLE")
    arm = vector - center
    if kind == "EULER_XYZ":
        turn = rotated_back if invert else rotated
        return turn(arm, reader.vector(node, "Rotation")) + center
    axes = {"X_AXIS": (1.0, 0.0, 0.0), "Y_AXIS": (0.0, 1.0, 0.0), "Z_AXIS": (0.0, 0.0, 1.0)}
    axis = literal(axes[kind]) if kind in axes else normalize(reader.vector(node, "Axis"))
    angle = -reader.number(node, "Angle") if invert else reader.number(node, "Angle")
    sine, cosine = operation("sin", angle), operation("cos", angle)
    turned = arm * cosine + cross(axis, arm) * sine + axis * (dot(axis, arm) * (1.0 - cosine))  # Rodrigues
    return turned + center


@value_node("ShaderNodeNormal")
def normal_node(reader: GraphReader, node: Node, output: str) -> Expr:
    """The direction of the sphere in the node; Dot with the input."""
    value = node.output_values.get("Normal")
    direction = constant(value) if isinstance(value, tuple) and len(value) == 3 else literal((0.0, 0.0, 1.0))
    if output == "Dot":
        return dot(reader.vector(node, "Normal"), normalize(direction))
    return normalize(direction)


@value_node("ShaderNodeSqueeze")
def squeeze(reader: GraphReader, node: Node, output: str) -> Expr:
    value, width, center = (reader.number(node, name) for name in ("Value", "Width", "Center"))
    return 1.0 / (1.0 + power(2.71828183, -((value - center) * width)))


def as_vector(expr: Expr) -> Expr:
    return splat(expr)
