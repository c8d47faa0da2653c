# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums of shader nodes: what a Surface is made of, still as expressions.

A closure's reflectances already hold their weights, so mixing scales and adds. What is literally 0 costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .expression import Expr, absolute, leaf, less, literal, luminance, maximum, mix, normalize, select

ZERO = literal(0.0)
ONE = literal(1.0)


def _zero() -> Expr:
    return ZERO


def _one() -> Expr:
    return ONE


@dataclass(frozen=True, eq=False)
class Lobe:
    """A GGX lobe of reflectance f0 at normal and f90 at grazing incidence, and what it lets into the surface.

    ``ior``: of the far side over the near one, which says how reflectance goes from f0 to f90, and how light is bent;
    0: Schlick's formula. ``transmission``: factor on what is not reflected.
    """

    f0: Expr = field(default_factory=_zero)
    f90: Expr = field(default_factory=_zero)
    ior: Expr = field(default_factory=_zero)
    roughness: Expr = field(default_factory=_one)
    transmission: Expr = field(default_factory=_zero)

    @property
    def is_there(self) -> bool:
        return not all(part.is_literal(0.0) for part in (self.f0, self.f90, self.transmission))

    @property
    def weight(self) -> Expr:
        """About what the lobe reflects and transmits of a white hemisphere."""
        return luminance(mean_fresnel(self.f0, self.f90)) + luminance(self.transmission)

    def scaled(self, weight: Expr) -> Lobe:
        return Lobe(self.f0 * weight, self.f90 * weight, self.ior, self.roughness, self.transmission * weight)

    def plus(self, other: Lobe) -> Lobe:
        """One lobe that stands for both: roughness is the mean by weight, the ior that of the stronger one."""
        if not other.is_there:
            return self
        if not self.is_there:
            return other
        mine, others = self.weight, other.weight
        roughness, ior = self.roughness, self.ior
        if roughness is not other.roughness:
            roughness = mix(roughness, other.roughness, others / maximum(mine + others, 1e-6))
        if ior is not other.ior and not (ior.is_literal(0.0) and other.ior.is_literal(0.0)):
            ior = select(less(mine, others), other.ior, ior)
        return Lobe(self.f0 + other.f0, self.f90 + other.f90, ior, roughness, self.transmission + other.transmission)


@dataclass(frozen=True, eq=False)
class Closure:
    """Lobes around one normal, the coat's apart; see ``Surface`` in shaders/lib/surface.glsl."""

    diffuse: Expr = field(default_factory=_zero)
    specular: Lobe = field(default_factory=Lobe)
    glass: Lobe = field(default_factory=Lobe)
    coat: Lobe = field(default_factory=Lobe)  # grey: f90 is its weight
    emission: Expr = field(default_factory=_zero)
    transparency: Expr = field(default_factory=_zero)
    normal: Expr = field(default_factory=lambda: leaf("normal_ws"))
    coat_normal: Expr = field(default_factory=lambda: leaf("normal_ws"))

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """Those that are there."""
        return tuple(lobe for lobe in (self.specular, self.glass, self.coat) if lobe.is_there)

    def scaled(self, weight: Expr) -> Closure:
        return Closure(
            self.diffuse * weight, self.specular.scaled(weight), self.glass.scaled(weight), self.coat.scaled(weight),
            self.emission * weight, self.transparency * weight, self.normal, self.coat_normal,
        )  # fmt: skip

    def plus(self, other: Closure) -> Closure:
        """The sum; normals are means weighted by what is reflected around them."""
        return Closure(
            self.diffuse + other.diffuse,
            self.specular.plus(other.specular),
            self.glass.plus(other.glass),
            self.coat.plus(other.coat),
            self.emission + other.emission,
            self.transparency + other.transparency,
            _mean_normal(self.normal, _weight(self), other.normal, _weight(other)),
            _mean_normal(self.coat_normal, self.coat.weight, other.coat_normal, other.coat.weight),
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


def _weight(closure: Closure) -> Expr:
    return luminance(closure.diffuse) + closure.specular.weight + closure.glass.weight


def _mean_normal(a: Expr, weight_a: Expr, b: Expr, weight_b: Expr) -> Expr:
    if weight_b.is_literal(0.0) or a is b:
        return a
    if weight_a.is_literal(0.0):
        return b
    return normalize(a * absolute(weight_a) + b * absolute(weight_b))
