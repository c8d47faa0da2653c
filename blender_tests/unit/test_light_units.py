# SPDX-License-Identifier: GPL-3.0-or-later
"""Light conversions against numbers worked out on paper."""

from __future__ import annotations

import math

import pytest

from addon import light_units as units
from addon.scene import AreaShape


def test_exposure_counts_in_stops() -> None:
    assert units.power(100.0, 0.0) == 100.0
    assert units.power(100.0, 3.0) == 800.0
    assert units.power(100.0, -1.0) == 50.0


def test_point_of_100_watts() -> None:
    # 100 W / 12.566 sr
    assert units.point_intensity(100.0, 0.1, normalize=True) == pytest.approx(7.957747, rel=1e-6)
    assert units.point_intensity(100.0, 5.0, normalize=True) == pytest.approx(7.957747, rel=1e-6)


def test_point_without_normalize_grows_with_its_area() -> None:
    assert units.point_intensity(100.0, 0.1, normalize=False) == pytest.approx(1.0)
    assert units.point_intensity(100.0, 0.2, normalize=False) == pytest.approx(4.0)
    assert units.point_intensity(100.0, 0.0, normalize=False) == pytest.approx(31.830989)  # as Cycles: P / pi


def test_point_without_normalize_equals_normalized_where_its_surface_is_one_square_metre() -> None:
    radius = math.sqrt(1.0 / (4.0 * math.pi))
    assert units.point_intensity(9.0, radius, normalize=False) == pytest.approx(
        units.point_intensity(9.0, radius, normalize=True)
    )


def test_sun() -> None:
    assert units.sun_irradiance(3.0, math.radians(10.0), normalize=True) == 3.0
    # radiance 2 over a disk of 60 degrees: 2 pi / 4
    assert units.sun_irradiance(2.0, math.radians(60.0), normalize=False) == pytest.approx(1.5707963)


def test_area_of_shapes() -> None:
    assert units.area(AreaShape.RECTANGLE, (2.0, 3.0)) == 6.0
    assert units.area(AreaShape.ELLIPSE, (2.0, 2.0)) == pytest.approx(math.pi)


def test_area_radiance() -> None:
    # 10 W from 2 m2: exitance 5, radiance 5 / pi
    assert units.area_radiance(10.0, 2.0, math.pi, normalize=True) == pytest.approx(1.5915494)
    assert units.area_radiance(10.0, 2.0, math.pi, normalize=False) == pytest.approx(3.1830989)


def test_spread_of_90_degrees() -> None:
    # tan 45 = 1: 1 / (1 - pi/4)
    assert units.spread_gain(math.pi / 2) == pytest.approx(4.6597924)
    assert units.spread_gain(math.pi) == 1.0


@pytest.mark.parametrize("spread", [0.06, 0.0999, 0.1001, 0.5, 1.5, 3.0, 3.14])
def test_spread_keeps_the_power(spread: float) -> None:
    half = 0.5 * spread
    steps = 20000
    flux = 0.0
    for i in range(steps):
        x = (i + 0.5) / steps * half
        flux += math.cos(x) * math.sin(x) * max(0.0, 1.0 - math.tan(x) / math.tan(half)) * half / steps
    assert units.spread_gain(spread) * flux == pytest.approx(0.5, rel=2e-3)


def test_no_spread_at_all_stays_finite() -> None:
    assert units.spread_gain(0.0) == units.spread_gain(math.radians(1.0)) < 1e5
