# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums of shader nodes: what a Surface is made of, still as expressions.

A closure's reflectances already hold their weights, so mixing scales and adds. What is literally 0 costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .expression import Expr, absolute, leaf, literal, luminance, maximum, mix, normalize

ZERO = literal(0.0)
ONE = literal(1.0)


def _zero() -> Expr:
    return ZERO


@dataclass(frozen=True, eq=False)
class Closure:
    """Lobes around one normal; see ``Surface`` in shaders/lib/surface.glsl."""

    diffuse: Expr = field(default_factory=_zero)
    specular_f0: Expr = field(default_factory=_zero)
    specular_f90: Expr = field(default_factory=_zero)
    roughness: Expr = field(default_factory=lambda: ONE)
    emission: Expr = field(default_factory=_zero)
    transparency: Expr = field(default_factory=_zero)
    normal: Expr = field(default_factory=lambda: leaf("normal_ws"))

    @property
    def has_specular(self) -> bool:
        return not (self.specular_f0.is_literal(0.0) and self.specular_f90.is_literal(0.0))

    def scaled(self, weight: Expr) -> Closure:
        return Closure(
            self.diffuse * weight, self.specular_f0 * weight, self.specular_f90 * weight, self.roughness,
            self.emission * weight, self.transparency * weight, self.normal,
        )  # fmt: skip

    def plus(self, other: Closure) -> Closure:
        """The sum. One lobe stands for both: roughness and normal are means weighted by what they reflect."""
        return Closure(
            self.diffuse + other.diffuse,
            self.specular_f0 + other.specular_f0,
            self.specular_f90 + other.specular_f90,
            _mean_roughness(self, other),
            self.emission + other.emission,
            self.transparency + other.transparency,
            _mean_normal(self, other),
        )


def mixed(a: Closure, b: Closure, factor: Expr) -> Closure:
    """a (1 - factor) + b factor."""
    if factor.is_literal(0.0):
        return a
    if factor.is_literal(1.0):
        return b
    return a.scaled(1.0 - factor).plus(b.scaled(factor))


def mean_fresnel(f0: Expr, f90: Expr) -> Expr:
    """Cosine-weighted mean over the hemisphere of f0 + (f90 - f0)(1 - cos)^5: the integral 2 c (1-c)^5 dc is 1/21."""
    return f0 * literal(20 / 21) + f90 * literal(1 / 21)


def _specular_weight(closure: Closure) -> Expr:
    return luminance(mean_fresnel(closure.specular_f0, closure.specular_f90))


def _mean_roughness(a: Closure, b: Closure) -> Expr:
    if not b.has_specular or a.roughness is b.roughness:
        return a.roughness
    if not a.has_specular:
        return b.roughness
    weight_a, weight_b = _specular_weight(a), _specular_weight(b)
    return mix(a.roughness, b.roughness, weight_b / maximum(weight_a + weight_b, 1e-6))


def _reflectance(closure: Closure) -> Expr:
    return luminance(closure.diffuse) + _specular_weight(closure)


def _mean_normal(a: Closure, b: Closure) -> Expr:
    weight_a, weight_b = _reflectance(a), _reflectance(b)
    if weight_b.is_literal(0.0) or a.normal is b.normal:
        return a.normal
    if weight_a.is_literal(0.0):
        return b.normal
    return normalize(a.normal * absolute(weight_a) + b.normal * absolute(weight_b))
