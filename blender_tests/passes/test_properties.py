# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds for every scene, tried on random ones: meshes, transforms, lights, materials, settings.

The same examples each time; CONELIGHT_EXAMPLES=N looks at N others of each kind.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

from addon.gpu.context import GpuContext
from addon.scene import CameraData, LightData, LightKind, MeshData, RayVisibility, SceneData
from addon.settings import Settings
from blender_tests.passes import run, scenes

pytestmark = pytest.mark.once

EXAMPLES = int(os.environ.get("CONELIGHT_EXAMPLES", "0"))
some = settings(
    derandomize=not EXAMPLES, max_examples=EXAMPLES or 8, deadline=None, database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    phases=[Phase.generate, *([Phase.shrink] if EXAMPLES else [])],  # looking for the least example takes minutes
)  # fmt: skip
#: One picture a scene; everything is checked as it is made.
BASE = Settings(voxel_auto=False, voxel_resolution=16, samples=2, debug_checks=True)
SIZE = (12, 8)


def numbers(lo: float, hi: float) -> st.SearchStrategy[float]:
    return st.floats(lo, hi, allow_nan=False)


def vectors(lo: float, hi: float) -> st.SearchStrategy[tuple[float, float, float]]:
    return st.tuples(numbers(lo, hi), numbers(lo, hi), numbers(lo, hi))


def colours(most: float = 1.0) -> st.SearchStrategy[tuple[float, float, float]]:
    return vectors(0.0, most)


# Random parts ---------------------------------------------------------------------------------------------------


@st.composite
def soups(draw: Any, low: Any = (-2, -2, -2), high: Any = (2, 2, 2)) -> MeshData:
    """A few triangles, some of them thin, some of them doubled."""
    corner = st.tuples(*[numbers(lo, hi) for lo, hi in zip(low, high, strict=True)])
    triangles = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=6))
    if draw(st.booleans()):
        triangles.append(triangles[0])
    corners = np.array(triangles, np.float32)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners = corners[np.linalg.norm(sides, axis=1) > 1e-12]  # those without area are left out before
    assume(len(corners))
    return scenes.soup(corners)


def meshes() -> st.SearchStrategy[MeshData]:
    return st.one_of(
        soups(), st.builds(scenes.box), st.builds(scenes.plane, numbers(0.5, 4.0)),
        st.builds(scenes.sphere, numbers(0.25, 1.5), st.just(6)),
    )  # fmt: skip


@st.composite
def matrices(draw: Any) -> np.ndarray:
    """Moved, turned, scaled unevenly, mirrored, sheared: anything that has an inverse."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([draw(vectors(-1.5, 1.5)) for _ in range(3)])
    matrix[:3, 3] = draw(vectors(-1.0, 1.0))
    axes = np.linalg.norm(matrix[:3, :3], axis=0)
    assume(abs(np.linalg.det(matrix[:3, :3])) > 1e-3 * max(float(axes.prod()), 1e-3))
    return matrix


def materials() -> st.SearchStrategy[Any]:
    rough = st.one_of(st.just(0.0), numbers(0.0, 1.0))
    return st.one_of(
        st.builds(scenes.diffuse, colours()), st.builds(scenes.glowing, colours(), colours(5.0)),
        st.builds(scenes.emission, colours(5.0)),
        st.builds(lambda c, r, m: scenes.principled(c, Roughness=r, Metallic=m), colours(), rough, numbers(0.0, 1.0)),
    )  # fmt: skip


@st.composite
def lights(draw: Any) -> LightData:
    kind = draw(st.sampled_from(list(LightKind)))
    size = draw(st.one_of(st.just(0.0), numbers(0.0, 2.0)))
    direction = draw(vectors(-1.0, 1.0))
    assume(np.linalg.norm(direction) > 0.1)
    return scenes.light(
        kind, draw(colours(20.0)), draw(vectors(-3.0, 3.0)), direction, radius=size, angle=min(size, 3.0),
        size=(max(size, 0.01), 0.5), spot_angle=draw(numbers(0.02, 3.1)), spot_blend=draw(numbers(0.0, 1.0)),
        soft_falloff=draw(st.booleans()), casts_shadow=draw(st.booleans()),
    )  # fmt: skip


@st.composite
def whole_scenes(draw: Any) -> SceneData:
    objects = draw(st.lists(st.tuples(meshes(), materials(), matrices()), max_size=4))
    world = draw(st.one_of(st.none(), st.builds(scenes.world, colours(3.0))))
    place = draw(vectors(-4.0, 4.0))
    assume(np.linalg.norm(place) > 0.1)
    return scenes.scene(
        *objects, lights=draw(st.lists(lights(), max_size=3)), world=world,
        camera=scenes.camera(place, aspect=SIZE[0] / SIZE[1]),
    )  # fmt: skip


#: What random settings may be: those that decide how light is found, in ranges that stay quick.
VALUES: dict[str, st.SearchStrategy[Any]] = {
    "rays": st.integers(1, 4), "seed": st.integers(0, 2**31 - 1), "bounces": st.integers(0, 64),
    "bounce_rays": st.integers(1, 12), "gather_interval": st.integers(1, 2), "voxel_resolution": st.integers(8, 24),
    "clamp_indirect": st.one_of(st.just(0.0), numbers(0.0, 10.0)),
    "max_distance": st.one_of(st.just(0.0), numbers(0.0, 5.0)), "glossy_layers": st.integers(0, 4),
    "light_falloff": st.one_of(st.just(2.0), numbers(0.0, 4.0)), "specular_aperture": numbers(0.0, 4.0),
    "shadow_amount": numbers(0.0, 1.0), "gather_mode": st.sampled_from(["RAYS", "CONES", "OCCLUSION"]),
    "shadow_mode": st.sampled_from(["EXACT", "CONE"]),
    **{name: st.booleans() for name in (
        "use_reconstruction", "use_direct", "use_indirect", "use_specular", "use_shadows")},
}  # fmt: skip


def pictures(gpu: GpuContext, scene: SceneData, chosen: Settings = BASE, size: tuple[int, int] = SIZE) -> np.ndarray:
    """(H, W, 3), row 0 at the bottom."""
    with run.pipeline(gpu, scene, chosen, size) as made:
        return made.film.read("combined")[..., :3].copy()


# What holds -----------------------------------------------------------------------------------------------------


@some
@given(scene=whole_scenes(), values=st.fixed_dictionaries({}, optional=VALUES))
def test_pictures_are_numbers(gpu: GpuContext, scene: SceneData, values: dict[str, Any]) -> None:
    picture = pictures(gpu, scene, BASE.with_values(**values))
    assert np.isfinite(picture).all() and (picture >= 0.0).all()


@some
@given(shapes=st.lists(st.tuples(meshes(), st.builds(scenes.diffuse, colours()), matrices()), min_size=1, max_size=4))
def test_nothing_is_brighter_than_what_lights_it(gpu: GpuContext, shapes: list[Any]) -> None:
    """Under a world of 1 surfaces that reflect at most 1 send at most 1; pixels a little more, by noise of guides."""
    scene = scenes.scene(*shapes, world=scenes.world(1.0), camera=scenes.camera((3.0, -4.0, 2.0)))
    found = pictures(gpu, scene, BASE.with_values(rays=4, samples=8))
    assert found.mean() <= 1.0 + 1e-3 and found.max() <= 1.05


@some
@given(shapes=st.lists(st.tuples(meshes(), matrices()), min_size=1, max_size=4), albedo=numbers(0.0, 1.0))
def test_a_furnace_is_even(gpu: GpuContext, shapes: list[Any], albedo: float) -> None:
    """What emits as much as it does not reflect, under a world of 1, cannot be seen."""
    material = scenes.glowing(albedo, 1.0 - albedo)
    objects = [(mesh, material, matrix) for mesh, matrix in shapes]
    scene = scenes.scene(*objects, world=scenes.world(1.0), camera=scenes.camera((3.0, -4.0, 2.0)))
    np.testing.assert_allclose(pictures(gpu, scene, BASE.with_values(samples=8)).mean(), 1.0, atol=0.01)


@some
@given(scene=whole_scenes(), exponent=st.integers(-12, 12))
def test_light_is_linear(gpu: GpuContext, scene: SceneData, exponent: int) -> None:
    """Lamps, world and surfaces that give so many times the light make a picture so many times as bright."""
    factor = 2.0**exponent
    lamps = tuple(dataclasses.replace(lamp, intensity=lamp.intensity * np.float32(factor)) for lamp in scene.lights)
    assume(not any(material.name in ("emission", "glowing") for material in scene.materials))
    world = scene.world and dataclasses.replace(scene.world, color=tuple(factor * c for c in scene.world.color))
    first = pictures(gpu, scene)
    second = pictures(gpu, dataclasses.replace(scene, lights=lamps, world=world))
    np.testing.assert_allclose(second / factor, first, rtol=1e-3, atol=1e-4 * max(float(first.max()), 1e-6))


@some
@given(first=soups((-1, -1, 0.2), (1, 1, 1.8)), second=soups((-1, -1, 0.2), (1, 1, 1.8)), lamp=lights())
def test_occluders_do_not_brighten(gpu: GpuContext, first: MeshData, second: MeshData, lamp: LightData) -> None:
    """The same points on lamps: what is not seen of them through one thing is not seen through two."""
    assume(lamp.casts_shadow)
    frame = scenes.soup([[[x, x, 0], [x, x + 1e-3, 0], [x, x, 2]] for x in (-2.0, 2.0)])  # all have the same grid
    hidden = RayVisibility.ALL & ~RayVisibility.CAMERA
    grey = scenes.diffuse(0.5)
    seen = []
    for things in ((), (first,), (first, second)):
        blockers = [(thing, grey, np.eye(4), hidden) for thing in things]
        scene = scenes.scene(
            (scenes.plane(4.0), grey), (frame, grey), *blockers, lights=(lamp,),
            camera=scenes.camera((0.0, -0.1, 5.0), width=3.5),
        )  # fmt: skip
        seen.append(pictures(gpu, scene, BASE.with_values(use_indirect=False)))
    for before, after in itertools.pairwise(seen):
        assert (after <= before * (1.0 + 1e-5) + 1e-6).all()


def _patch(corners: np.ndarray, material: Any) -> tuple[MeshData, Any]:
    return scenes.mesh(corners, [[0, 1, 2], [0, 2, 3]]), material


def _received(gpu: GpuContext, sender: np.ndarray, receiver: np.ndarray, centre: np.ndarray, turn: float) -> float:
    """Light that leaves a square which reflects all, for another that sends 1 W/(m2 sr), times the first's area."""
    side = float(np.linalg.norm(receiver[1] - receiver[0]))
    normal = np.cross(receiver[1] - receiver[0], receiver[3] - receiver[0]) / side**2
    view = scenes.camera(centre + 0.05 * normal, centre, width=side, near=1e-3)
    scene = scenes.scene(
        _patch(sender, scenes.emission(1.0)), _patch(receiver, scenes.diffuse(1.0)), camera=_rolled(view, receiver)
    )
    # Eight pixels across a square see light change too much from one to the next for them to share it.
    chosen = BASE.with_values(samples=64, rays=16, use_reconstruction=False)
    return float(pictures(gpu, scene, chosen, (8, 8)).mean()) * side**2


def _rolled(view: CameraData, square: np.ndarray) -> CameraData:
    """The same view with its sides along those of a square."""
    matrix = view.world_from_camera.copy()
    x = (square[1] - square[0]) / np.linalg.norm(square[1] - square[0])
    matrix[:3, 0], matrix[:3, 1] = x, np.cross(matrix[:3, 2], x)
    return dataclasses.replace(view, world_from_camera=matrix)


@some
@given(sides=st.tuples(numbers(0.5, 2.0), numbers(0.5, 2.0)), tilt=numbers(-0.6, 0.6), away=numbers(1.0, 1.6),
       beside=numbers(-0.7, 0.7))  # fmt: skip
def test_two_squares_exchange_alike(
    gpu: GpuContext, sides: tuple[float, float], tilt: float, away: float, beside: float
) -> None:
    """Reciprocity: of two squares each sends the other as much as it gets, for the same radiance."""
    square = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    first = square * sides[0]
    turn = np.array([[math.cos(tilt), 0, math.sin(tilt)], [0, -1, 0], [math.sin(tilt), 0, -math.cos(tilt)]])
    centre = np.array([beside, 0.0, away])
    second = square * sides[1] @ turn.T + centre
    assert np.cross(second[1] - second[0], second[3] - second[0])[2] < 0.0  # faces the first
    there = _received(gpu, first, second, centre, tilt)
    back = _received(gpu, second, first, np.zeros(3), 0.0)
    assert there == pytest.approx(back, rel=0.03)  # noise: a tenth of 65,536 rays meet the other square


@some
@given(shapes=st.lists(st.tuples(meshes(), st.builds(scenes.diffuse, colours()), matrices()), min_size=1, max_size=3),
       lamp=lights())  # fmt: skip
def test_a_mirrored_scene_is_as_bright(gpu: GpuContext, shapes: list[Any], lamp: LightData) -> None:
    """x becomes -x, of matrices and of what they move."""
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    room = (scenes.box((-3, -3, -3), (3, 3, 3), inside_out=True), scenes.diffuse(0.5))
    view = scenes.camera((0.0, -2.8, 0.0), aspect=SIZE[0] / SIZE[1])
    axes = lamp.axes * np.array([-1.0, 1.0, 1.0]) * np.array([[-1.0], [1.0], [1.0]])
    turned = dataclasses.replace(lamp, position=lamp.position * [-1.0, 1.0, 1.0], axes=axes)
    assume(np.abs(lamp.position).max() < 2.9)
    chosen = BASE.with_values(samples=32, rays=4)
    found = pictures(gpu, scenes.scene(room, *shapes, lights=(lamp,), camera=view), chosen)
    moved = [(mesh, material, mirror @ matrix) for mesh, material, matrix in shapes]
    other = pictures(gpu, scenes.scene(room, *moved, lights=(turned,), camera=view), chosen)
    assert other.mean() == pytest.approx(found.mean(), rel=0.05, abs=1e-4 * float(lamp.intensity.max()))
