# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of every kind of light against its formula, and against rays that meet it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.grid import VoxelGrid
from addon.passes.inject import LightTable
from addon.scene import AreaShape, LightData, LightKind
from addon.settings import Settings
from blender_tests.passes.run import map_list, test_kernel
from blender_tests.passes.scenes import light
from blender_tests.passes.test_ggx import strata

GRID = VoxelGrid((-3.0, 2.0, -1.0), 0.25, (64, 64, 64))  # neither the origin nor the scale of the world
COUNT = 1 << 14


class Measured:
    """Samples of one light from one point, in metres."""

    def __init__(
        self, gpu: GpuContext, source: LightData, point: np.ndarray, directions: np.ndarray, falloff: float
    ) -> None:
        table = LightTable(gpu)
        table.run([source], GRID)
        inputs = np.zeros((COUNT, 12), np.float32)
        inputs[:, :3] = (point - np.array(GRID.origin)) / GRID.cell_size
        inputs[:, 4:7] = directions
        inputs[:, 8:10] = strata(COUNT)
        chosen = Settings(light_falloff=falloff)
        kernel = test_kernel(gpu, "light", table.defines(chosen))
        table.bind(kernel, chosen)
        found = map_list(gpu, kernel, inputs, 16)
        table.release()
        self.direction, self.distance = found[:, :3], found[:, 3] * GRID.cell_size
        self.irradiance, self.half_angle = found[:, 4:7], found[:, 7]
        self.seen, self.seen_distance = found[:, 8:11], found[:, 11] * GRID.cell_size
        self.density, self.density_there = found[:, 12], found[:, 13]

    def on_plane(self, normal: np.ndarray) -> float:
        """Irradiance (first channel) on a surface with this normal."""
        return float((self.irradiance[:, 0] * np.maximum(0.0, self.direction @ normal)).mean())


@pytest.fixture
def measure(gpu: GpuContext) -> Iterator[object]:
    up = np.broadcast_to([0.0, 0.0, 1.0], (COUNT, 3))

    def run(source: LightData, point: object, directions: np.ndarray = up, falloff: float = 2.0) -> Measured:
        return Measured(gpu, source, np.asarray(point, np.float64), directions, falloff)

    yield run


def hemisphere(axis: np.ndarray) -> np.ndarray:
    """COUNT directions spread evenly over the solid angle of a half space around ``axis``."""
    u = strata(COUNT)
    z = u[:, :1]
    s = np.sqrt(1 - z * z)
    phi = 2 * np.pi * u[:, 1:]
    x = np.cross([0.3, 0.9, 0.1], axis)
    x /= np.linalg.norm(x)
    return s * np.cos(phi) * x + s * np.sin(phi) * np.cross(axis, x) + z * axis


def rectangle_form(corners: np.ndarray, point: np.ndarray, normal: np.ndarray) -> float:
    """Integral of the cosine over a polygon's solid angle, all of it above the horizon. Lambert 1760."""
    v = corners - point
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    total = 0.0
    for i in range(len(v)):
        j = (i + 1) % len(v)
        edge = np.cross(v[i], v[j])
        total += np.arccos(np.clip(v[i] @ v[j], -1, 1)) * (edge / np.linalg.norm(edge)) @ normal
    return abs(total) / 2


@pytest.mark.parametrize("soft", [True, False])
@pytest.mark.parametrize("radius", [0.0, 0.3])
def test_point(radius: float, soft: bool, measure: object) -> None:
    """I / d^2. A sphere gives that exactly on a surface facing its centre; a disk that faces the receiver
    gives L pi sin^2 of its half angle, L = I / (pi r^2)."""
    found = measure(
        light(LightKind.POINT, (3.0, 1.0, 0.0), (0.0, 0.0, 2.0), radius=radius, soft_falloff=soft), (0.5, 0.0, 0.5)
    )  # type: ignore[operator]
    to_light = np.array([-0.5, 0.0, 1.5])
    squared = to_light @ to_light
    expected = 3.0 / squared if not soft or radius == 0 else 3.0 / (squared + radius**2)
    assert found.on_plane(to_light / np.sqrt(squared)) == pytest.approx(expected, rel=2e-3)
    np.testing.assert_allclose(found.irradiance[:, 1] * 3.0, found.irradiance[:, 0], rtol=1e-5)
    assert found.irradiance[:, 2].max() == 0.0
    tilted = np.array([0.0, 0.0, 1.0])
    if not soft or radius == 0:
        assert found.on_plane(tilted) == pytest.approx(3.0 / squared * 1.5 / np.sqrt(squared), rel=2e-3)
    assert abs(found.distance.mean() - np.sqrt(squared)) < radius + 1e-4


@pytest.mark.parametrize("falloff", [0.0, 1.0, 2.0, 3.0])
def test_falloff(falloff: float, measure: object) -> None:
    found = measure(light(LightKind.POINT, 3.0, (0.0, 0.0, 2.5)), (0.0, 0.0, 0.5), falloff=falloff)  # type: ignore[operator]
    assert found.on_plane(np.array([0.0, 0.0, 1.0])) == pytest.approx(3.0 / 2.0**falloff, rel=1e-4)


@pytest.mark.parametrize("angle", [0.0, 0.1, 0.3, 0.34, 0.4])
def test_spot(angle: float, measure: object) -> None:
    """Full cone 0.8 rad, half blended: smoothstep of (cos a - cos c) / ((1 - cos c) / 2)."""
    cone, blend, distance = 0.8, 0.5, 2.0
    source = light(LightKind.SPOT, 4.0, (0.0, 0.0, 2.0), spot_angle=cone, spot_blend=blend)
    point = np.array([distance * np.sin(angle), 0.0, 2.0 - distance * np.cos(angle)])
    found = measure(source, point)  # type: ignore[operator]
    edge = np.cos(cone / 2)
    t = np.clip((np.cos(angle) - edge) / ((1 - edge) * blend), 0, 1)
    expected = 4.0 / distance**2 * t * t * (3 - 2 * t)
    to_light = (np.array([0.0, 0.0, 2.0]) - point) / distance
    assert found.on_plane(to_light) == pytest.approx(expected, rel=2e-3, abs=1e-4)


def test_stretched_spot(measure: object) -> None:
    """Scale 2 along x: an angle of atan(2 tan a) off the axis along x is like a along y."""
    make = dict(spot_angle=0.8, spot_blend=0.9, spot_scale=(2.0, 1.0, 1.0))
    source = light(LightKind.SPOT, 4.0, (0.0, 0.0, 2.0), **make)
    x, y = source.axes[0], source.axes[1]
    axis = np.array([0.0, 0.0, -1.0])
    values = []
    for across in (2.0 * 0.2 * x, 0.2 * y):
        way = axis + across
        found = measure(source, np.array([0.0, 0.0, 2.0]) + 1.5 * way)  # type: ignore[operator]
        values.append(found.irradiance[0, 0] * (1.5**2 * (way @ way)))
    assert values[0] == pytest.approx(values[1], rel=1e-3)
    assert 0.1 < values[1] / 4.0 < 0.95


@pytest.mark.parametrize("angle", [0.0, 0.00918, 0.5, 2.0])
def test_sun(angle: float, measure: object) -> None:
    """E on a surface that faces it, whatever its disk; E cos on others while all of it is above the horizon."""
    down = np.array([0.3, 0.0, -1.0])
    down /= np.linalg.norm(down)
    found = measure(light(LightKind.SUN, 5.0, direction=down, angle=angle), (0.0, 0.0, 0.0))  # type: ignore[operator]
    assert found.on_plane(-down) == pytest.approx(5.0, rel=2e-3)
    if angle < 1.0:
        assert found.on_plane(np.array([0.0, 0.0, 1.0])) == pytest.approx(5.0 * -down[2], rel=2e-3)
    assert np.arccos(np.clip(found.direction @ -down, -1, 1)).max() <= angle / 2 + 1e-3
    if angle > 0:
        assert np.arccos(np.clip(found.direction @ -down, -1, 1)).max() > 0.9 * angle / 2
    assert found.distance.min() > 1e20


def test_area_rectangle(measure: object) -> None:
    source = light(LightKind.AREA, 7.0, (0.2, 0.1, 1.5), size=(1.0, 0.4))
    corners = source.position + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ (source.axes[:2] * [[0.5], [0.2]])
    for point, normal in (((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), ((0.6, -0.5, 0.4), (-0.5, 0.5, 0.707))):
        n = np.array(normal) / np.linalg.norm(normal)
        found = measure(source, point)  # type: ignore[operator]
        assert found.on_plane(n) == pytest.approx(7.0 * rectangle_form(corners, np.array(point), n), rel=5e-3)
    assert measure(source, (0.0, 0.0, 3.0)).irradiance.max() == 0.0  # type: ignore[operator]  # it shines one way


def test_area_ellipse(measure: object) -> None:
    """A disk seen along its axis: L pi r^2 / (r^2 + d^2)."""
    source = light(LightKind.AREA, 7.0, (0.0, 0.0, 1.5), size=(0.8, 0.8), shape=AreaShape.ELLIPSE)
    found = measure(source, (0.0, 0.0, 0.5))  # type: ignore[operator]
    assert found.on_plane(np.array([0.0, 0.0, 1.0])) == pytest.approx(7.0 * np.pi * 0.16 / 1.16, rel=3e-3)


@pytest.mark.parametrize("spread", [0.5, 1.5, np.pi])
def test_area_spread(spread: float, measure: object) -> None:
    """L (1 - tan a / tan(spread / 2)) off the normal by a: integrated over the rectangle in float64."""
    source = light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(0.5, 0.5), spread=spread)
    point = np.array([0.15, 0.0, 0.0])
    g = (np.arange(200) + 0.5) / 200 - 0.5
    x, y = np.meshgrid(g * 0.5, g * 0.5)
    d = np.stack([x - point[0], y - point[1], np.ones_like(x)], axis=-1)
    squared = (d**2).sum(axis=-1)
    cosine = 1.0 / np.sqrt(squared)
    share = 1.0 if spread > 3.1 else np.maximum(0, 1 - np.sqrt(1 / cosine**2 - 1) / np.tan(spread / 2))
    expected = 7.0 * (cosine * cosine / squared * share).mean() * 0.25
    assert measure(source, point).on_plane(np.array([0.0, 0.0, 1.0])) == pytest.approx(expected, rel=5e-3)  # type: ignore[operator]


WIDE = {
    "rectangle": (light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(1.2, 0.8)), (0.1, 0.0, 0.0)),
    "rectangle_aside": (light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(0.8, 3.0)), (-2.0, 0.7, 0.0)),
    "rectangle_spread": (light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(9.0, 8.0), spread=1.0), (0.1, 0.0, 0.0)),
    "square_huge": (light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(1e4, 1e4)), (0.1, 0.0, 0.0)),
    "square_edge": (light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(100.0, 100.0)), (49.9, 0.3, 0.9)),
    "tube": (light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(0.1, 100.0)), (0.1, 3.0, 0.0)),
    "ellipse": (
        light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(1.2, 0.8), shape=AreaShape.ELLIPSE, spread=1.8),
        (0.1, 0.0, 0.0),
    ),
    "ellipse_aside": (
        light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(0.8, 3.0), shape=AreaShape.ELLIPSE),
        (-2.0, 0.7, 0.0),
    ),
    "disk_huge": (
        light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(1e4, 1e4), shape=AreaShape.ELLIPSE),
        (0.1, 0.0, 0.0),
    ),
    "disk_edge": (
        light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(100.0, 100.0), shape=AreaShape.ELLIPSE),
        (49.9, 0.3, 0.9),
    ),
    "ellipse_long": (
        light(LightKind.AREA, 7.0, (0.0, 0.0, 1.0), size=(0.5, 100.0), shape=AreaShape.ELLIPSE),
        (0.1, 9.0, 0.0),
    ),
    "sphere": (light(LightKind.POINT, 2.0, (0.0, 0.0, 1.0), radius=0.5, soft_falloff=False), (0.1, 0.0, 0.0)),
    "sphere_huge": (light(LightKind.POINT, 2.0, (0.0, 0.0, 99.0), radius=98.9, soft_falloff=False), (0.1, 0.0, 0.0)),
    "sphere_inside": (light(LightKind.POINT, 2.0, (0.0, 0.0, 1.0), radius=2.0, soft_falloff=False), (0.1, 0.0, 0.0)),
    "soft": (light(LightKind.POINT, 2.0, (0.0, 0.0, 1.0), radius=0.5), (0.1, 0.0, 0.0)),
    "soft_huge": (light(LightKind.POINT, 2.0, (0.0, 0.0, 1.0), radius=1e3), (0.1, 0.0, 0.0)),
    "spot": (light(LightKind.SPOT, 2.0, (0.0, 0.0, 1.0), radius=0.5, spot_angle=1.5, spot_blend=0.5), (0.1, 0.0, 0.0)),
    "spot_sphere": (
        light(LightKind.SPOT, 2.0, (0.0, 0.0, 1.0), radius=0.5, soft_falloff=False, spot_angle=1.5, spot_blend=0.5),
        (0.1, 0.0, 0.0),
    ),
    "sun": (light(LightKind.SUN, 2.0, direction=(0.0, 0.0, -1.0), angle=1.0), (0.1, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", WIDE)
def test_rays_see_what_samples_bring(name: str, measure: object) -> None:
    """Radiance along rays, integrated over the hemisphere, is the irradiance that samples add up to."""
    source, point = WIDE[name]
    normal = np.array([0.0, 0.0, 1.0])
    directions = hemisphere(normal)
    found = measure(source, point, directions)  # type: ignore[operator]
    by_rays = (found.seen[:, 0] * (directions @ normal)).mean() * 2 * np.pi
    met = found.seen[:, 0] > 0
    tolerance = 0.02 + 1.5 / np.sqrt(met.sum()) * (1 - met.mean())  # how many of the rays met it is known to that
    assert by_rays == pytest.approx(found.on_plane(normal), rel=tolerance)
    assert 0.005 < met.mean() <= 1.0
    if source.kind is LightKind.AREA:
        assert found.seen_distance[met] * directions[met, 2] == pytest.approx(1.0 - point[2], rel=1e-3)


@pytest.mark.parametrize("name", WIDE)
def test_density_is_that_of_samples(name: str, measure: object) -> None:
    """What rays that meet the light are weighed by is what samples say, and its inverse has the mean that the light's
    solid angle is; samples bring the radiance that rays see."""
    source, point = WIDE[name]
    found = measure(source, point)  # type: ignore[operator]
    np.testing.assert_allclose(found.density_there, found.density, rtol=2e-3)
    assert np.linalg.norm(found.direction, axis=1) == pytest.approx(1.0, abs=1e-5)
    again = measure(source, point, found.direction)  # type: ignore[operator]
    seen = again.seen[:, 0] > 0
    if "spread" not in name:  # corners of what it may shine from do not
        assert seen.mean() > 0.99
    brought = found.irradiance[:, 0] * found.density
    np.testing.assert_allclose(brought[seen], again.seen[seen, 0], rtol=2e-2)
    assert again.seen_distance[seen] == pytest.approx(found.distance[seen], rel=5e-3)


def solid_angle_of_rectangle(source: LightData, point: np.ndarray) -> float:
    """Van Oosterom and Strackee 1983: twice the arc tangent for each of two triangles."""
    half = np.array(source.size)[:, None] / 2
    corners = source.position + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ (source.axes[:2] * half)
    v = corners - point
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    total = 0.0
    for a, b, c in ((v[0], v[1], v[2]), (v[0], v[2], v[3])):
        total += 2 * np.arctan2(abs(a @ np.cross(b, c)), 1 + a @ b + b @ c + c @ a)
    return total


@pytest.mark.parametrize("height", [1e-3, 0.1, 1.0, 5.0, 25.0])
@pytest.mark.parametrize("aside", [0.0, 0.45, 0.7])
@pytest.mark.parametrize("size", [(1.0, 1.0), (0.02, 1.0), (1.0, 0.02)])
def test_rectangle_is_uniform_in_solid_angle(
    height: float, aside: float, size: tuple[float, float], measure: object
) -> None:
    source = light(LightKind.AREA, 7.0, (0.0, 0.0, height), size=size)
    point = np.array([aside, 0.1, 0.0])
    found = measure(source, point)  # type: ignore[operator]
    expected = solid_angle_of_rectangle(source, point)
    assert (1 / found.density.astype(float)).mean() == pytest.approx(expected, rel=2e-3)
    if expected > 1.1e-3:
        np.testing.assert_allclose(found.density, found.density[0], rtol=1e-5)


@pytest.mark.parametrize("height", [0.01, 0.1, 1.0, 5.0, 25.0])
@pytest.mark.parametrize("aside", [0.0, 0.45, 0.7])
@pytest.mark.parametrize("size", [(1.0, 1.0), (0.1, 1.0)])
def test_ellipse_is_about_uniform_in_solid_angle(
    height: float, aside: float, size: tuple[float, float], measure: object
) -> None:
    """Densities differ by as little; their inverse has the mean of the solid angle, here added up in float64."""
    source = light(LightKind.AREA, 7.0, (0.0, 0.0, height), size=size, shape=AreaShape.ELLIPSE)
    point = np.array([aside, 0.1, 0.0])
    found = measure(source, point)  # type: ignore[operator]
    inverse = 1 / found.density.astype(float)
    # Chords across x, each exactly: z / (x^2 + z^2) of the difference of the sines under which its ends are seen.
    axes = np.array([abs(source.axes[0] @ [1, 0, 0]), abs(source.axes[0] @ [0, 1, 0])]) > 0.5
    a, b = np.array(size)[[0, 1] if axes[0] else [1, 0]] / 2
    t = (np.arange(200000) + 0.5) / 200000 * np.pi
    x = -a * np.cos(t)
    y = b * np.sin(t)
    side = (x - point[0]) ** 2 + height**2
    ends = [(s * y - point[1]) / np.sqrt(side + (s * y - point[1]) ** 2) for s in (-1, 1)]
    expected = (height / side * (ends[1] - ends[0]) * a * np.sin(t)).mean() * np.pi
    assert inverse.mean() == pytest.approx(expected, rel=3e-3)
    assert inverse.std() / inverse.mean() < (0.02 if size == (1.0, 1.0) and aside == 0.0 else 0.15)
