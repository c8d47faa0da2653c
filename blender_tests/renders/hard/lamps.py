# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps of impossible sizes, strengths and places."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from blender_tests.scenes import build

from . import stage
from .case import Case
from .shapes import LIT, SUN, SUNLIT

#: Why there are more samples.
NEAR = "{} samples, as light differs a hundredfold within a pixel: places in it are what is to be sampled"
EDGES = "64 samples, as the picture is that of the edges of a square 65 times as bright as its mean"

HEIGHT = 2.0


def over_plane(kind: str, height: float = HEIGHT, side: float = 4.0, seen: float = 0.02, **properties: Any) -> None:
    stage.plane(side=side)
    build.add_light(kind, (0, 0, height), **properties)
    stage.patch_seen(seen, 0.5 * height)


def court_with(kind: str, location: Any, count: int = 1, world: float = 0.0, **properties: Any) -> None:
    stage.court(lamp=False, world=world)
    for k in range(count):
        build.add_light(kind, location, (0, 0.25, 0), name=f"Lamp {k}", **properties)


def room_with_ceiling_lamp(below: float) -> None:
    """A closed room with a lamp just below its ceiling."""
    stage.furnace_room(build.diffuse("Wall", (0.6, 0.6, 0.6)), 2.0)
    build.add_light("AREA", (0, 0, 1.0 - below), (0, 0, 0), energy=20.0, shape="SQUARE", size=0.5)
    stage.camera((-0.8, -0.85, -0.2), (0.5, 0.5, -0.1), lens=18)


def on_plane(radius: float, height: float) -> None:
    """A lamp on a plane, and a box beside it."""
    stage.plane(0.6)
    build.add_box("Box", (0.5, 0.5, 0.5), (0.9, 0.3, 0.25), 0.3, build.diffuse("Box", (0.7, 0.3, 0.2)))
    build.add_light("POINT", (0, 0, height), energy=20.0, shadow_soft_size=radius)
    stage.camera((2.0, -3.0, 2.0), (0.2, 0, 0), lens=35)


def emitters() -> None:
    """A glowing square a million times as bright as the one beside it, above a floor; the camera sees the floor."""
    stage.plane(0.6)
    for name, x, radiance in (("Bright", -1.0, 1e6), ("Dim", 1.0, 1e-3)):
        material = build.emission(name, build.WHITE, radiance)
        build.add_quad(name, [(x - 0.2, 0.2, 1), (x + 0.2, 0.2, 1), (x + 0.2, -0.2, 1), (x - 0.2, -0.2, 1)], material)
    stage.camera((0, -4.0, 3.0), (0, -0.1, 0.2), lens=45)


def lit_by_disk(power: float, radius: float) -> float:
    """Radiance of the plane under a sphere of light, taken for a disk that faces it: E = pi L R^2 / (R^2 + D^2)."""
    radiance = power / (math.pi * 4 * math.pi * radius**2)
    return radiance * math.pi * radius**2 / (radius**2 + HEIGHT**2) * stage.ALBEDO / math.pi


def lit_by_point(power: float) -> float:
    return power / (4 * math.pi) / HEIGHT**2 * stage.ALBEDO / math.pi


def lit_by_square(power: float, side: float) -> float:
    """Radiance of the plane under a square: pi L times its form factor (four times that of a corner)."""
    x = 0.5 * side / HEIGHT
    factor = 4 * 2 * x / math.hypot(1, x) * math.atan(x / math.hypot(1, x)) / (2 * math.pi)
    return power / side**2 * factor * stage.ALBEDO / math.pi


POINT = "I / D^2 x albedo / pi, I = P / (4 pi)"
CASES = (
    Case("lamp_in_box", "a lamp inside the closed box: the court has no light but the sky",
         partial(court_with, "POINT", (0.75, 0.5, 0.5), energy=1000.0, shadow_soft_size=0.05, world=0.3)),
    Case("lamp_in_wall", "a lamp whose middle lies in a wall of the court, half of it behind",
         partial(court_with, "POINT", (0.0, 2.0, 1.5), energy=60.0, shadow_soft_size=0.2, world=0.1),
         samples=64, reason=NEAR.format(64)),
    Case("lamp_on_plane", "a lamp of 10 cm that touches the floor", partial(on_plane, 0.1, 0.1)),
    Case("lamp_sunk", "the same, half in the floor", partial(on_plane, 0.1, 0.0),
         samples=256, cycles_samples=65536, reason=NEAR.format(256)),
    Case("point_near", "a lamp without size 2 cm above the floor", partial(on_plane, 0.0, 0.02),
         samples=512, cycles_samples=65536, reason=NEAR.format(512)),
    Case("lamp_under_ceiling", "an area lamp 1 mm below the ceiling of a closed room",
         partial(room_with_ceiling_lamp, 1e-3)),
    Case("lamp_in_ceiling", "the same in the very plane of the ceiling", partial(room_with_ceiling_lamp, 0.0),
         same_as="lamp_under_ceiling", formula="as 1 mm below it"),
    Case("point_radius_0", "a lamp without size",
         partial(over_plane, "POINT", energy=100.0, shadow_soft_size=0.0), exact=lit_by_point(100.0), formula=POINT),
    Case("point_radius_100", "a lamp of 100 m radius, 2 m above the floor",
         partial(over_plane, "POINT", energy=1e6, shadow_soft_size=100.0), exact=lit_by_disk(1e6, 100.0),
         formula="L x albedo x R^2 / (R^2 + D^2), L = P / (4 pi^2 R^2)"),
    Case("microwatt", "a lamp of 1e-6 W",
         partial(over_plane, "POINT", energy=1e-6, shadow_soft_size=0.0), exact=lit_by_point(1e-6), formula=POINT),
    Case("gigawatt", "a lamp of 1e9 W",
         partial(over_plane, "POINT", energy=1e9, shadow_soft_size=0.0), exact=lit_by_point(1e9), formula=POINT),
    Case("microwatt_court", "the court under 1e-6 W alone",
         partial(court_with, "AREA", (0.5, -0.5, 3.0), energy=1e-6, shape="SQUARE", size=1.0)),
    Case("gigawatt_court", "the court under 1e9 W alone",
         partial(court_with, "AREA", (0.5, -0.5, 3.0), energy=1e9, shape="SQUARE", size=1.0)),
    Case("sun_0", "a sun without a disk", partial(over_plane, "SUN", energy=SUN, angle=0.0), exact=LIT, formula=SUNLIT),
    Case("sun_180", "a sun as wide as the sky", partial(over_plane, "SUN", energy=SUN, angle=math.pi), exact=LIT,
         formula=SUNLIT),
    Case("sun_180_court", "the court under a sun as wide as the sky",
         partial(court_with, "SUN", (0.5, -0.5, 3.0), energy=SUN, angle=math.pi)),
    Case("sun_0_court", "the court under a sun without a disk",
         partial(court_with, "SUN", (0.5, -0.5, 3.0), energy=SUN, angle=0.0)),
    Case("area_tiny", "an area lamp of 0.1 mm",
         partial(over_plane, "AREA", energy=100.0, shape="SQUARE", size=1e-4), exact=lit_by_square(100.0, 1e-4),
         formula="form factor of a square"),
    Case("area_huge", "an area lamp of 1 km, 2 m above the floor",
         partial(over_plane, "AREA", energy=1e7, shape="SQUARE", size=1e3), exact=lit_by_square(1e7, 1e3),
         formula="form factor of a square"),
    Case("spot_1_degree", "a spot of 1 degree",
         partial(over_plane, "SPOT", energy=100.0, shadow_soft_size=0.0, spot_size=math.radians(1), spot_blend=0.0),
         exact=lit_by_point(100.0), formula=POINT),
    Case("spot_180_degrees", "a spot of 180 degrees in the court",
         partial(court_with, "SPOT", (0.5, -0.5, 3.0), energy=200.0, shadow_soft_size=0.1, spot_size=math.pi,
                 spot_blend=1.0)),
    Case("lamps_at_one_place", "300 lamps at one place",
         partial(court_with, "POINT", (0.5, -0.5, 2.5), count=300, energy=0.4, shadow_soft_size=0.1),
         same_as="lamp_of_300", formula="as one lamp with the power of all"),
    Case("lamp_of_300", "one lamp in their place",
         partial(court_with, "POINT", (0.5, -0.5, 2.5), energy=120.0, shadow_soft_size=0.1)),
    Case("emission_1e6_beside_1e-3", "a glowing square of 1e6 beside one of 0.001", emitters,
         samples=64, reason=EDGES),
)

