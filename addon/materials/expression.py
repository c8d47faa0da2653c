# SPDX-License-Identifier: GPL-3.0-or-later
"""Typed expressions that node graphs become: constants fold at once, the rest is written as GLSL by ``emit.py``.

Two kinds of numbers: a *literal* belongs to the structure and is written into the text; a *constant* is a number of
this one material (a socket's value and what folds from it), is read from ``material_parameter`` and so does not make
another shader. :func:`structural` turns a constant that is exactly 0 or 1 into a literal: the branch that it switches
off then disappears.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, Union

import numpy as np

from .operations import LARGEST, OPERATIONS, ramp_value

Number = Union["Expr", float, int]

FLOAT, VEC3, VEC4 = "float", "vec3", "vec4"


@dataclass(frozen=True, eq=False, slots=True)
class Expr:
    """A node of the expression graph. ``kind``: 'literal', 'constant', 'leaf', 'sample', 'ramp' or an operation."""

    type: str  # GLSL type
    kind: str
    args: tuple[Expr, ...] = ()
    value: Any = None  # literal, constant: float64 array; leaf: its key; sample: Sample; ramp: Ramp

    def __add__(self, other: Number) -> Expr:
        return operation("add", self, as_expr(other))

    def __radd__(self, other: Number) -> Expr:
        return as_expr(other) + self

    def __sub__(self, other: Number) -> Expr:
        return operation("sub", self, as_expr(other))

    def __rsub__(self, other: Number) -> Expr:
        return as_expr(other) - self

    def __mul__(self, other: Number) -> Expr:
        return operation("mul", self, as_expr(other))

    def __rmul__(self, other: Number) -> Expr:
        return as_expr(other) * self

    def __truediv__(self, other: Number) -> Expr:
        """Safe: 0 where the divisor is 0."""
        return operation("div", self, as_expr(other))

    def __rtruediv__(self, other: Number) -> Expr:
        return as_expr(other) / self

    def __neg__(self) -> Expr:
        return operation("neg", self)

    @property
    def is_known(self) -> bool:
        """Whether the value is a number here and now."""
        return self.kind in ("literal", "constant")

    def is_literal(self, number: float) -> bool:
        return self.kind == "literal" and bool(np.all(self.value == number))

    @property
    def x(self) -> Expr:
        return self if self.type == FLOAT else operation("x", self)

    @property
    def y(self) -> Expr:
        return self if self.type == FLOAT else operation("y", self)

    @property
    def z(self) -> Expr:
        return self if self.type == FLOAT else operation("z", self)

    @property
    def w(self) -> Expr:
        return operation("w", self)

    @property
    def rgb(self) -> Expr:
        """Three components: of a vec4 without the last, of a float three times the same."""
        return operation("rgb", self) if self.type == VEC4 else splat(self)


def _type_of(array: Any) -> str:
    return FLOAT if np.ndim(array) == 0 else {3: VEC3, 4: VEC4}[len(array)]


def _finite(value: Any) -> Any:
    array = np.asarray(value, dtype=np.float64)
    return np.clip(np.nan_to_num(array, nan=0.0, posinf=LARGEST, neginf=-LARGEST), -LARGEST, LARGEST)


def literal(value: float | tuple[float, ...]) -> Expr:
    """A number that belongs to the structure. A colour of three equal numbers stays a vec3."""
    array = _finite(value)
    return Expr(_type_of(array), "literal", (), array)


def constant(value: float | tuple[float, ...]) -> Expr:
    """A number of this one material: float, vec3 or vec4 by its length."""
    array = _finite(value)
    return Expr(_type_of(array), "constant", (), array)


def as_expr(value: Number) -> Expr:
    return value if isinstance(value, Expr) else literal(float(value))


def structural(expr: Expr) -> Expr:
    """``expr``, or the literal 0 or 1 if that is exactly what it is."""
    if expr.kind == "constant":
        for number in (0.0, 1.0):
            if np.all(expr.value == number):
                return literal(number)
    return expr


def unless_zero(expr: Expr) -> Expr:
    """``expr``, or the literal 0 if that is exactly what it is: for what is either there or not."""
    return literal(0.0) if expr.kind == "constant" and bool(np.all(expr.value == 0.0)) else expr


def _widest(args: tuple[Expr, ...]) -> str:
    types = {arg.type for arg in args}
    return VEC4 if VEC4 in types else VEC3 if VEC3 in types else FLOAT


def operation(kind: str, *args: Expr) -> Expr:
    """``kind`` of the arguments: folded if all are known, simplified where a literal 0 or 1 decides."""
    spec = OPERATIONS[kind]
    simple = _simplified(kind, args)
    if simple is not None:
        return simple
    if all(arg.is_known for arg in args):
        with np.errstate(all="ignore"):
            value = _finite(spec.evaluate(*[arg.value for arg in args]))
        is_literal = all(arg.kind == "literal" for arg in args)
        return Expr(_type_of(value), "literal" if is_literal else "constant", (), value)
    return Expr(_widest(args) if spec.result == "same" else spec.result, kind, args)


def _simplified(kind: str, args: tuple[Expr, ...]) -> Expr | None:
    if kind in ("add", "mul", "sub", "div"):
        a, b = args
        same_type = _widest(args)
        if (kind == "add" and a.is_literal(0.0)) or (kind == "mul" and a.is_literal(1.0)):
            return widened(b, same_type)
        if (kind in ("add", "sub") and b.is_literal(0.0)) or (kind in ("mul", "div") and b.is_literal(1.0)):
            return widened(a, same_type)
        if (kind in ("mul", "div") and a.is_literal(0.0)) or (kind == "mul" and b.is_literal(0.0)):
            return widened(literal(0.0), same_type)
    if kind == "select" and args[0].is_known and args[0].type == FLOAT:
        return args[1] if args[0].value != 0.0 else args[2]
    if kind in ("x", "y", "z") and args[0].kind == "vec3":
        return args[0].args["xyz".index(kind)]
    if kind in ("x", "y", "z") and args[0].kind == "splat":
        return args[0].args[0]
    return None


def widened(expr: Expr, type: str) -> Expr:
    """``expr`` with three components if ``type`` has them and it has one."""
    return splat(expr) if type == VEC3 and expr.type == FLOAT else expr


def splat(expr: Expr) -> Expr:
    return expr if expr.type == VEC3 else operation("splat", expr)


def vec3(x: Number, y: Number, z: Number) -> Expr:
    return operation("vec3", as_expr(x), as_expr(y), as_expr(z))


def mix(a: Expr, b: Expr, factor: Expr) -> Expr:
    """a (1 - factor) + b factor; a factor of exactly 0 or 1 leaves one of them."""
    if factor.is_literal(0.0):
        return a
    if factor.is_literal(1.0):
        return b
    return a * (1.0 - factor) + b * factor


def minimum(a: Number, b: Number) -> Expr:
    return operation("min", as_expr(a), as_expr(b))


def maximum(a: Number, b: Number) -> Expr:
    return operation("max", as_expr(a), as_expr(b))


def clamp(a: Expr, low: Number = 0.0, high: Number = 1.0) -> Expr:
    return minimum(maximum(a, low), high)


def less(a: Number, b: Number) -> Expr:
    """1 where a < b, else 0."""
    return operation("less", as_expr(a), as_expr(b))


def select(condition: Expr, a: Number, b: Number) -> Expr:
    """a where the condition is not 0, else b."""
    return operation("select", condition, as_expr(a), as_expr(b))


def power(a: Number, b: Number) -> Expr:
    return operation("pow", as_expr(a), as_expr(b))


def dot(a: Expr, b: Expr) -> Expr:
    return operation("dot", splat(a), splat(b))


def cross(a: Expr, b: Expr) -> Expr:
    return operation("cross", splat(a), splat(b))


def floor(a: Expr) -> Expr:
    return operation("floor", a)


def fract(a: Expr) -> Expr:
    return operation("fract", a)


def absolute(a: Expr) -> Expr:
    return operation("abs", a)


def sqrt(a: Expr) -> Expr:
    return operation("sqrt", a)


def normalize(a: Expr) -> Expr:
    return operation("normalize", splat(a))


def length(a: Expr) -> Expr:
    return operation("length", splat(a))


def luminance(color: Expr) -> Expr:
    """Rec.709 luminance, as Blender turns a colour into a number."""
    if color.type == FLOAT:
        return color
    return dot(color, literal((0.2126, 0.7152, 0.0722)))


def average(vector: Expr) -> Expr:
    """As Blender turns a vector into a number."""
    return vector if vector.type == FLOAT else dot(vector, literal((1 / 3, 1 / 3, 1 / 3)))


# --- what varies over a surface --------------------

#: Leaves without a name of a layer: key -> GLSL type. ``emit.py`` has their GLSL.
LEAVES = {
    "position_ws": VEC3, "position_os": VEC3, "generated": VEC3, "normal_ws": VEC3, "normal_os": VEC3,
    "geometric_normal_ws": VEC3, "incoming_ws": VEC3, "back_facing": FLOAT, "object_random": FLOAT,
    "object_index": FLOAT, "object_position_ws": VEC3, "direction_ws": VEC3,
    "view_cosine": FLOAT,  # between the interpolated normal and the viewer, at least 0
    "specular_cosine": FLOAT,  # the same with the normal that reflection takes
}  # fmt: skip
#: Leaves with the name of an attribute layer (None: the active one).
LAYER_LEAVES = {"uv": VEC3, "uv_tangent": VEC3, "uv_bitangent": VEC3, "uv_footprint": FLOAT, "color": VEC4}


@functools.cache
def leaf(name: str) -> Expr:
    return Expr(LEAVES[name], "leaf", (), (name, None))


@functools.cache
def layer_leaf(name: str, layer: str | None) -> Expr:
    return Expr(LAYER_LEAVES[name], "leaf", (), (name, layer))


@dataclass(frozen=True, eq=False)
class Sample:
    """A look-up of an image. Its expression has the arguments (coordinate, footprint)."""

    tiles: tuple[tuple[int, Any], ...]  # (column + 10 row, ImageData); one with key 0 for a plain image
    is_udim: bool
    extension: str
    interpolation: str
    divides: bool = False  # colour by alpha, which it holds as a factor


@dataclass(frozen=True, eq=False)
class Ramp:
    """A table of colours over a float: the argument of its expression."""

    table: Any  # (N, 5) float64: position (ascending), RGBA
    is_constant: bool  # steps instead of lines
    is_uniform: bool  # positions are 0, 1/(N-1), ... 1


def ramp(table: Any, factor: Expr, is_constant: bool = False) -> Expr:
    """Colour (vec4) at ``factor`` of an (N, 5) table of position and RGBA; N at least 1."""
    table = np.asarray(table, dtype=np.float64)
    table = table[np.argsort(table[:, 0], kind="stable")]
    if factor.is_known:
        return constant(tuple(ramp_value(table, is_constant, factor.value)))
    if len(table) == 1:
        return constant(tuple(table[0, 1:]))
    uniform = not is_constant and len(table) > 16 and np.allclose(table[:, 0], np.linspace(0.0, 1.0, len(table)))
    return Expr(VEC4, "ramp", (factor,), Ramp(table, is_constant, bool(uniform)))
