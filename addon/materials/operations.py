# SPDX-License-Identifier: GPL-3.0-or-later
"""What an expression can do: for each operation its GLSL and the same in numpy, which folds constants.

Operations that do not say otherwise work on each component and follow Blender's safe versions: no division by zero,
no root of a negative number. A test runs every operation on the GPU against its numpy twin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: What a float32 shader can hold without becoming infinite in the next multiplication.
LARGEST = 1e30


@dataclass(frozen=True)
class Operation:
    """``glsl`` has one {} for each argument. ``result``: 'float', 'vec3', 'vec4' or 'same' (the widest argument)."""

    glsl: str
    evaluate: Callable[..., Any]
    result: str = "same"
    is_scalar: bool = False  # GLSL has it for float only: written once for each component


def _divide(a: Array, b: Array) -> Array:
    return np.where(b != 0.0, a / np.where(b != 0.0, b, 1.0), 0.0)


def _power(a: Array, b: Array) -> Array:
    whole = b == np.trunc(b)
    magnitude = np.abs(np.where(a == 0.0, 1.0, a)) ** b
    sign = np.where((a < 0.0) & (np.mod(b, 2.0) != 0.0), -1.0, 1.0)
    answer = np.where((a < 0.0) & ~whole, 0.0, sign * magnitude)
    return np.where(b == 0.0, 1.0, np.where(a == 0.0, 0.0, answer))


def _log(a: Array) -> Array:
    return np.where(a > 0.0, np.log(np.where(a > 0.0, a, 1.0)), 0.0)


def _fmod(a: Array, b: Array) -> Array:
    return np.where(b != 0.0, np.fmod(a, np.where(b != 0.0, b, 1.0)), 0.0)


def _normalize(a: Array) -> Array:
    length = np.sqrt(np.sum(a * a))
    return a / length if length > 0.0 else np.zeros(3)


def ramp_value(table: Array, is_constant: bool, f: Array) -> Array:
    """Colour at ``f`` of a (N, 5) table of position, RGBA."""
    positions = table[:, 0]
    if is_constant:
        return table[max(int(np.searchsorted(positions, f, side="right")) - 1, 0), 1:]
    return np.array([np.interp(f, positions, table[:, channel]) for channel in range(1, 5)])


def specular_scale_bias(cosine: Any, roughness: Any) -> tuple[Array, Array]:
    """Twin of ``specular_scale_bias`` in shaders/lib/closure.glsl, where its origin is told."""
    x = np.clip(np.asarray(cosine, dtype=np.float64), 0.05, 1.0)
    y = np.clip(np.asarray(roughness, dtype=np.float64), 0.0, 1.0)
    lost_above = [
        (0.47482, -2.17892, 3.03689, -0.73195),
        (-7.43404, 55.04485, -103.25196, 92.29573),
        (7.87567, -64.44368, 136.35403, -88.31867),
    ]
    lost_below = [(1.0, -7.13346, 19.80432), (-1.05011, -26.84713, 67.53021), (68.43221, -101.0177, 20.77605)]
    lost = y * np.polynomial.polynomial.polyval2d(x, y, lost_above)
    whole = 1.0 - np.clip(lost / np.polynomial.polynomial.polyval2d(x, y, lost_below), 0.0, 1.0)
    above = 1.02276 - 2.48686 * x - 0.88254 * y + 1.84063 * x * y + 1.56836 * x**2 + 0.47871 * y**2
    above = above - 0.98276 * x**2 * y - 1.61105 * x * y**2 + 1.20929 * x**2 * y**2
    below = 1.0 + 2.66107 * x - 0.48812 * y - 20.44128 * x * y + 7.78812 * x**2 + 13.28358 * y**2
    below = below + 18.0169 * x**2 * y + 5.32168 * x * y**2 - 10.09386 * x**2 * y**2
    bias = np.clip(above / below, 0.0, 1.0)
    return np.maximum(whole - bias, 0.0), bias


def dielectric_reflectance(cosine: Any, ior: Any) -> Array:
    """Twin of ``dielectric_reflectance`` in shaders/lib/fresnel.glsl."""
    squared = 1.0 - (1.0 - np.square(cosine)) / np.square(ior)
    inside = np.sqrt(np.maximum(squared, 0.0))
    across = (cosine - ior * inside) / np.maximum(cosine + ior * inside, 1e-20)
    along = (ior * cosine - inside) / np.maximum(ior * cosine + inside, 1e-20)
    return np.where(squared <= 0.0, 1.0, 0.5 * (across**2 + along**2))


def fresnel_cosine(cosine: Any, roughness: Any) -> Array:
    """Twin of ``fresnel_cosine`` in shaders/lib/fresnel.glsl, where its origin is told."""
    m, r = np.asarray(cosine, dtype=np.float64), np.asarray(roughness, dtype=np.float64)
    rows = [(-0.034, -0.3374, -0.6184), (1.1999, 1.8814, -2.569), (-0.9488, -1.0547, 2.2503)]
    return np.sqrt(np.clip(m * m + r * r * np.polynomial.polynomial.polyval2d(r, m, rows), 0.0, 1.0))


def dielectric_scale_bias(cosine: Any, roughness: Any, ior: Any) -> tuple[Array, Array]:
    """Twin of ``specular_scale_bias`` with an ior."""
    scale, bias = specular_scale_bias(cosine, roughness)
    ior = np.maximum(ior, 1e-5)
    f0 = np.square((ior - 1.0) / (ior + 1.0))
    reflected = dielectric_reflectance(fresnel_cosine(cosine, roughness), ior)
    share = np.clip((reflected - f0) / np.maximum(1.0 - f0, 1e-6), 0.0, 1.0)
    return (scale + bias) * (1.0 - share), (scale + bias) * share


def _specular_split(cosine: Array, roughness: Array, ior: Array) -> Array:
    split = dielectric_scale_bias(cosine, roughness, ior) if ior > 0.0 else specular_scale_bias(cosine, roughness)
    return np.array([*split, 0.0])


OPERATIONS: dict[str, Operation] = {
    "neg": Operation("-{}", np.negative),
    "add": Operation("{} + {}", np.add),
    "sub": Operation("{} - {}", np.subtract),
    "mul": Operation("{} * {}", np.multiply),
    "div": Operation("safe_divide({}, {})", _divide, is_scalar=True),
    "pow": Operation("safe_pow({}, {})", _power, is_scalar=True),
    "log": Operation("safe_log({})", _log, is_scalar=True),
    "exp": Operation("exp(min({}, 69.0))", lambda a: np.exp(np.minimum(a, 69.0)), is_scalar=True),
    "sqrt": Operation("sqrt(max({}, 0.0))", lambda a: np.sqrt(np.maximum(a, 0.0))),
    "abs": Operation("abs({})", np.abs),
    "sign": Operation("sign({})", np.sign),
    "min": Operation("min({}, {})", np.minimum),
    "max": Operation("max({}, {})", np.maximum),
    "floor": Operation("floor({})", np.floor),
    "ceil": Operation("ceil({})", np.ceil),
    "trunc": Operation("trunc({})", np.trunc),
    "fract": Operation("fract({})", lambda a: a - np.floor(a)),
    "fmod": Operation("safe_fmod({}, {})", _fmod, is_scalar=True),
    "sin": Operation("sin({})", np.sin),
    "cos": Operation("cos({})", np.cos),
    "tan": Operation("tan({})", np.tan),
    "asin": Operation("asin(clamp({}, -1.0, 1.0))", lambda a: np.arcsin(np.clip(a, -1.0, 1.0))),
    "acos": Operation("acos(clamp({}, -1.0, 1.0))", lambda a: np.arccos(np.clip(a, -1.0, 1.0))),
    "atan": Operation("atan({})", np.arctan),
    "atan2": Operation("safe_atan2({}, {})", np.arctan2, is_scalar=True),
    "sinh": Operation("sinh(clamp({}, -69.0, 69.0))", lambda a: np.sinh(np.clip(a, -69.0, 69.0))),
    "cosh": Operation("cosh(clamp({}, -69.0, 69.0))", lambda a: np.cosh(np.clip(a, -69.0, 69.0))),
    "tanh": Operation("tanh(clamp({}, -15.0, 15.0))", lambda a: np.tanh(np.clip(a, -15.0, 15.0))),
    "less": Operation("float({} < {})", lambda a, b: np.where(a < b, 1.0, 0.0), is_scalar=True),
    "equal": Operation("float({} == {})", lambda a, b: np.where(a == b, 1.0, 0.0), is_scalar=True),
    "select": Operation("({} != 0.0 ? {} : {})", lambda c, a, b: np.where(c != 0.0, a, b), is_scalar=True),
    "vec3": Operation("vec3({}, {}, {})", lambda x, y, z: np.array([x, y, z], dtype=np.float64), "vec3"),
    "splat": Operation("vec3({})", lambda a: np.full(3, a), "vec3"),
    "rgb": Operation("{}.xyz", lambda a: a[:3], "vec3"),
    "x": Operation("{}.x", lambda a: a[0], "float"),
    "y": Operation("{}.y", lambda a: a[1], "float"),
    "z": Operation("{}.z", lambda a: a[2], "float"),
    "w": Operation("{}.w", lambda a: a[3], "float"),
    "dot": Operation("dot({}, {})", lambda a, b: np.sum(a * b), "float"),
    "cross": Operation("cross({}, {})", np.cross, "vec3"),
    "length": Operation("length({})", lambda a: np.sqrt(np.sum(a * a)), "float"),
    "normalize": Operation("safe_normalize({})", _normalize, "vec3"),
    "specular_split": Operation("vec3(specular_scale_bias({}, {}, {}), 0.0)", _specular_split, "vec3"),
    # The rest depends on the surface or on textures and is never folded.
    "specular_cosine": Operation("specular_cosine(p.geometric_normal_ws, p.incoming_ws, {})", lambda _: 1.0, "float"),
    "tangent_normal": Operation("normal_from_tangent_space({}, {}, {}, {}, {})", lambda *_: np.zeros(3), "vec3"),
}
