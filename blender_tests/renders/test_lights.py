# SPDX-License-Identifier: GPL-3.0-or-later
"""What a plane of albedo 0.8 reflects under each kind of light, against formulas written down here, and Cycles.

The formulas are those of radiometry with Blender's units: P = energy 2^exposure; a Lambertian surface has the radiance
L = albedo E / pi; E of an extended light is the integral of its radiance, times both cosines, over distance squared.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy")

from blender_tests.scenes import build, lit_plane, rendering

FORMULA_TOLERANCE = 0.01
CYCLES_TOLERANCE = 0.02
HEIGHT = 2.0  # metres: of the light above the plane
SAMPLES = 64  # of 16 x 16 pixels that all measure the same number: noise below 0.1 %


def disk_at(distance: float, radius: float) -> float:
    """Irradiance over radiance, on the axis of a disk that faces the receiver: pi sin^2 of its half-angle."""
    return math.pi * radius**2 / (distance**2 + radius**2)


def area_at(size: tuple[float, float], *, is_ellipse: bool = False, spread: float = math.pi, steps: int = 800) -> float:
    """Irradiance below the middle of an area light, over the radiance of the same light with full spread."""
    x, y = ((np.arange(steps) + 0.5) / steps - 0.5 for _ in range(2))
    x, y = np.meshgrid(x * size[0], y * size[1])
    squared = x**2 + y**2 + HEIGHT**2
    cosine = HEIGHT / np.sqrt(squared)
    weight = np.ones_like(x)
    if is_ellipse:
        weight = ((2 * x / size[0]) ** 2 + (2 * y / size[1]) ** 2 <= 1).astype(float)
    if spread < math.pi:
        h = spread / 2
        weight *= np.maximum(math.tan(h) - np.tan(np.arccos(cosine)), 0.0) / (math.tan(h) - h)
    return float((weight * cosine**2 / squared).sum() * size[0] * size[1] / steps**2)


def smoothstep(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return x * x * (3 - 2 * x)


@dataclass(frozen=True)
class Case:
    """``irradiance``: W/m2 at the point that is seen, for white light."""

    kind: str
    properties: dict[str, Any]
    irradiance: float
    position: tuple[float, float, float] = (0.0, 0.0, HEIGHT)
    target: tuple[float, float, float] | None = (0.0, 0.0, 0.0)  # what it shines at; None: straight down
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def add(self) -> Any:
        target = self.target or (self.position[0], self.position[1], 0.0)
        light = build.add_light(self.kind, self.position, target, **self.properties)
        light.scale = self.scale
        return light

    @property
    def radiance(self) -> np.ndarray:
        return np.array(self.color) * self.irradiance * lit_plane.ALBEDO / math.pi


P = 100.0
D = HEIGHT
POINT = P / (4 * math.pi)  # W/sr
OFF = 1.0  # metres that a light is beside the point
SLANT = math.hypot(OFF, D)
SPOT = {"energy": P, "shadow_soft_size": 0.0, "spot_size": math.radians(80), "spot_blend": 0.6}
IN_CONE = smoothstep((D / SLANT - math.cos(math.radians(40))) / ((1 - math.cos(math.radians(40))) * 0.6))
SQUARE = {"energy": P, "shape": "SQUARE", "size": 1.0}

CASES = {
    "point": Case("POINT", {"energy": P, "shadow_soft_size": 0.0}, POINT / D**2),
    "point aside": Case(
        "POINT", {"energy": P, "shadow_soft_size": 0.0}, POINT / SLANT**2 * D / SLANT, position=(OFF, 0, D)),
    "point with radius": Case(
        "POINT", {"energy": P, "shadow_soft_size": 0.25}, P / (math.pi * 4 * math.pi * 0.25**2) * disk_at(D, 0.25)),
    "large point": Case(
        "POINT", {"energy": P, "shadow_soft_size": 0.8}, P / (math.pi * 4 * math.pi * 0.8**2) * disk_at(D, 0.8)),
    "sphere without soft falloff": Case(
        "POINT", {"energy": P, "shadow_soft_size": 0.8, "use_soft_falloff": False}, POINT / D**2),
    "point not normalized": Case(
        "POINT", {"energy": P, "shadow_soft_size": 0.5, "normalize": False}, P / math.pi * disk_at(D, 0.5)),
    "exposure": Case("POINT", {"energy": P, "shadow_soft_size": 0.0, "exposure": -1.5}, POINT / D**2 * 2**-1.5),
    "colour": Case(
        "POINT", {"energy": P, "shadow_soft_size": 0.0, "color": (1.0, 0.5, 0.25)}, POINT / D**2,
        color=(1.0, 0.5, 0.25)),
    "temperature": Case(
        "POINT", {"energy": P, "shadow_soft_size": 0.0, "use_temperature": True, "temperature": 3000.0}, POINT / D**2,
        color=(1.7708, 0.8443, 0.2722)),
    "spot": Case("SPOT", {**SPOT, "spot_size": math.radians(30)}, POINT / D**2),
    "spot aside": Case("SPOT", SPOT, POINT / SLANT**2 * D / SLANT * IN_CONE, position=(OFF, 0, D), target=None),
    "spot outside": Case(
        "SPOT", {**SPOT, "spot_size": math.radians(50)}, 0.0, position=(OFF, 0, D), target=None),
    "spot with radius": Case(
        "SPOT", {**SPOT, "shadow_soft_size": 0.25, "spot_blend": 0.0},
        P / (math.pi * 4 * math.pi * 0.25**2) * disk_at(D, 0.25)),
    "spot not normalized": Case(
        "SPOT", {**SPOT, "shadow_soft_size": 0.5, "normalize": False, "spot_blend": 0.0},
        P / math.pi * disk_at(D, 0.5)),
    "sun": Case("SUN", {"energy": 3.0, "angle": 0.0}, 3.0),
    "sun aslant": Case("SUN", {"energy": 3.0, "angle": 0.01}, 3.0 * D / SLANT, position=(OFF, 0, D)),
    "wide sun": Case("SUN", {"energy": 3.0, "angle": math.radians(60)}, 3.0),
    "sun not normalized": Case(
        "SUN", {"energy": 3.0, "angle": math.radians(20), "normalize": False},
        3.0 * math.pi * math.sin(math.radians(10)) ** 2),
    "sun with exposure": Case("SUN", {"energy": 3.0, "angle": 0.01, "exposure": 1.0}, 6.0),
    "area square": Case("AREA", SQUARE, P / math.pi * area_at((1, 1))),
    "area rectangle": Case(
        "AREA", {"energy": P, "shape": "RECTANGLE", "size": 2.0, "size_y": 0.5}, P / math.pi * area_at((2, 0.5))),
    "area disk": Case(
        "AREA", {"energy": P, "shape": "DISK", "size": 1.0}, P / (math.pi * math.pi / 4) * disk_at(D, 0.5)),
    "area ellipse": Case(
        "AREA", {"energy": P, "shape": "ELLIPSE", "size": 1.5, "size_y": 0.5},
        P / (math.pi * math.pi / 4 * 0.75) * area_at((1.5, 0.5), is_ellipse=True)),
    "area scaled": Case("AREA", SQUARE, P / (math.pi * 3) * area_at((2, 1.5)), scale=(2.0, 1.5, 1.0)),
    "area not normalized": Case("AREA", {**SQUARE, "size": 0.5, "normalize": False}, P / math.pi * area_at((0.5, 0.5))),
    "area from behind": Case("AREA", SQUARE, 0.0, target=(0, 0, 2 * D)),
    "point wider than it is far": Case(
        "POINT", {"energy": 1e6, "shadow_soft_size": 100.0},
        1e6 / (math.pi * 4 * math.pi * 100.0**2) * disk_at(D, 100.0)),
    "inside a sphere": Case(
        "POINT", {"energy": 1e4, "shadow_soft_size": 5.0, "use_soft_falloff": False},
        1e4 / (math.pi * 4 * math.pi * 5.0**2) * math.pi),
    "disk wider than it is far": Case(
        "AREA", {"energy": 1e6, "shape": "DISK", "size": 200.0},
        1e6 / (math.pi * math.pi * 100.0**2) * disk_at(D, 100.0)),
    "tube": Case(
        "AREA", {"energy": P, "shape": "RECTANGLE", "size": 0.02, "size_y": 5.0},
        P / (math.pi * 0.1) * area_at((0.02, 5.0))),
    "ellipse wider than it is far": Case(
        "AREA", {"energy": P, "shape": "ELLIPSE", "size": 12.0, "size_y": 3.0},
        P / (math.pi * math.pi / 4 * 36.0) * area_at((12.0, 3.0), is_ellipse=True)),
    "area with spread": Case(
        "AREA", {**SQUARE, "spread": math.radians(60)}, P / math.pi * area_at((1, 1), spread=math.radians(60))),
    "area with narrow spread": Case(
        "AREA", {**SQUARE, "spread": math.radians(20)}, P / math.pi * area_at((1, 1), spread=math.radians(20))),
}


@pytest.fixture(scope="module")
def pictures() -> Callable[[str, str], np.ndarray]:
    """A function (case, engine) -> (3,) mean radiance."""
    scene = lit_plane.scene()
    scene.render.use_persistent_data = True  # one pipeline for all cases: only the light differs

    def measure(name: str, engine: str) -> np.ndarray:
        import bpy

        light = CASES[name].add()
        try:
            if engine == "cycles":
                picture = rendering.cycles(samples=SAMPLES, bounces=0)
            else:
                picture = rendering.conelight(voxels=16, samples=SAMPLES, use_indirect=False)
                assert rendering.last_warnings() == []
        finally:
            bpy.data.lights.remove(light.data)  # and the object with it
        return picture[..., :3].mean(axis=(0, 1), dtype=np.float64)

    return measure


@pytest.mark.parametrize("name", CASES)
def test_light_follows_its_formula(name: str, pictures: Callable[[str, str], np.ndarray]) -> None:
    assert pictures(name, "conelight") == pytest.approx(CASES[name].radiance, rel=FORMULA_TOLERANCE, abs=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_light_agrees_with_cycles(name: str, pictures: Callable[[str, str], np.ndarray]) -> None:
    reference = pictures(name, "cycles")
    # Cycles first against the same formula: a case that is wrong on paper shows here.
    assert reference == pytest.approx(CASES[name].radiance, rel=CYCLES_TOLERANCE, abs=1e-6)
    assert pictures(name, "conelight") == pytest.approx(reference, rel=CYCLES_TOLERANCE, abs=1e-6)
