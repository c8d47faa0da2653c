# SPDX-License-Identifier: GPL-3.0-or-later
"""From the numbers of Blender's light panel to radiometry: intensity, irradiance, radiance.

Each function converts one quantity of one kind of light. "Power" is in watts, radiant; colour is multiplied later.
``normalize`` is Blender's switch of that name: on, the power does not depend on the size of the light; off, the
number is a radiant exitance, and a larger light gives more. All formulas were compared with Cycles' pictures.
"""

from __future__ import annotations

import math

from .scene import AreaShape

#: Radians. A narrower spread would need radiances beyond what the pipeline stores.
MINIMUM_SPREAD = math.radians(1.0)


def power(energy: float, exposure: float) -> float:
    """Watts (SUN: W/m2) from the panel's strength and its exposure in stops: energy 2^exposure."""
    return energy * math.exp2(exposure)


def point_intensity(watts: float, radius: float, normalize: bool) -> float:
    """Radiant intensity of a point or spot light, W/sr.

    A point sends its power evenly into 4 pi steradians: I = P / (4 pi). Equally, a sphere of radius r has the
    radiance L = P / (pi 4 pi r^2), and from afar I = L pi r^2. Without ``normalize`` the area is left out of L:
    L = P / pi, so I = P r^2. Without radius and without ``normalize`` Cycles takes I = P / pi (measured), and so do we.
    A spot is a point light behind a mask: its cone does not change the intensity.
    """
    if normalize:
        return watts / (4.0 * math.pi)
    return watts * radius * radius if radius > 0.0 else watts / math.pi


def sun_irradiance(strength: float, angle: float, normalize: bool) -> float:
    """Irradiance on a surface that faces the sun, W/m2. ``angle`` is the full angle of its disk.

    Normalized, the strength is the irradiance. Otherwise it is the radiance of the disk, whose projected solid angle
    is pi sin^2(angle / 2); a sun without a disk counts as normalized.
    """
    if normalize or angle <= 0.0:
        return strength
    return strength * math.pi * math.sin(0.5 * min(angle, math.pi)) ** 2


def area(shape: AreaShape, size: tuple[float, float]) -> float:
    """Square metres of an area light whose sides (or diameters) are ``size`` metres: a b, or pi/4 a b."""
    return size[0] * size[1] * (0.25 * math.pi if shape is AreaShape.ELLIPSE else 1.0)


def spread_gain(spread: float) -> float:
    """Radiance along the normal of an area light, over that of the same light without a limited spread.

    Spread weighs directions by w(x) = max(0, 1 - tan x / tan h), x from the normal and h = spread / 2, and keeps the
    power. A Lambertian emitter has the integral of cos x sin x from 0 to pi/2, which is 1/2; with the weight it is
    the integral of cos x sin x - sin^2 x / tan h from 0 to h, which is (tan h - h) / (2 tan h). Hence the gain
    tan h / (tan h - h), near 3 / h^2 for small h (used below .05, where the difference cancels).
    """
    half = 0.5 * max(spread, MINIMUM_SPREAD)
    if half >= 0.5 * math.pi - 1e-5:
        return 1.0
    if half < 0.05:
        return math.tan(half) * 3.0 / half**3
    return math.tan(half) / (math.tan(half) - half)


def area_radiance(watts: float, square_metres: float, spread: float, normalize: bool) -> float:
    """Radiance of an area light along its normal, W/(m2 sr).

    One side emits, Lambertian: exitance P / A = pi L, so L = P / (pi A). Without ``normalize``: L = P / pi.
    """
    exitance = watts / square_metres if normalize else watts
    return exitance / math.pi * spread_gain(spread)
