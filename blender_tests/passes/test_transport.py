# SPDX-License-Identifier: GPL-3.0-or-later
"""Light in voxels: direct light by its formula, bounces in closed and open rooms, the picture of a furnace."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.materials.operations import specular_scale_bias
from addon.passes import bounce, inject
from addon.scene import LightData, LightKind, RayVisibility
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, radiance, read_voxels, sample


def facing_up(made: object) -> np.ndarray:
    """Which voxel faces face +z, and carry surface of their own."""
    found = read_voxels(made.voxel_light.voxelize.voxels, made.voxel_light.geometry.geometry)  # type: ignore[attr-defined]
    return found.faces["facing"] == 4


# Injection ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [0.0, 30.0, 75.0])
def test_sun_on_a_plane(degrees: float, gpu: GpuContext) -> None:
    """Albedo a under irradiance E at an angle: a E cos / pi above, nothing below."""
    angle = np.radians(degrees)
    sun = scenes.light(LightKind.SUN, (3.0, 2.0, 1.0), direction=(np.sin(angle), 0.0, -np.cos(angle)))
    made = scenes.scene((scenes.plane(2.0), scenes.diffuse((0.5, 0.25, 1.0))), lights=[sun])
    with pipeline(gpu, made, scenes.settings(12, bounces=0), samples=0) as ready:
        up = facing_up(ready)
        expected = np.array([3.0 * 0.5, 2.0 * 0.25, 1.0]) * np.cos(angle) / np.pi
        found = radiance(ready)
        np.testing.assert_allclose(found[up], np.broadcast_to(expected, found[up].shape), rtol=2e-3)
        assert up.sum() > 80 and found[~up].max() == 0.0


def test_lights_obey_shadows_and_visibility(gpu: GpuContext) -> None:
    """Under a roof it is dark; not when the light casts no shadow, or the roof is unseen by shadow rays, or shadows are
    off; and it is when the light has no effect on diffuse surfaces."""
    floor, roof = scenes.plane(2.0), scenes.plane(6.0, 1.0)
    white = scenes.diffuse(0.8)

    def brightest(roof_seen_by: RayVisibility = RayVisibility.ALL, use_shadows: bool = True, **light: object) -> float:
        sun = scenes.light(LightKind.SUN, np.pi, direction=(0.0, 0.0, -1.0), **light)
        made = scenes.scene((floor, white), (roof, white, np.eye(4), roof_seen_by), lights=[sun])
        with pipeline(gpu, made, scenes.settings(24, bounces=0, use_shadows=use_shadows), samples=0) as ready:
            found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
            low = (found.faces["facing"] == 4) & (found.face_cells[:, 2] < found.cells[:, 2].mean())
            return float(radiance(ready)[low].max())

    assert brightest() == 0.0
    assert brightest(casts_shadow=False) == pytest.approx(0.8, rel=2e-3)
    assert brightest(use_shadows=False) == pytest.approx(0.8, rel=2e-3)
    assert brightest(RayVisibility.ALL & ~RayVisibility.SHADOW) == pytest.approx(0.8, rel=2e-3)
    assert brightest(casts_shadow=False, visibility=RayVisibility.ALL & ~RayVisibility.DIFFUSE) == 0.0


def test_many_lights_bring_what_they_bring_in_groups(gpu: GpuContext) -> None:
    """Sixteen lights are all asked for their shadows, of 48 a part: their sum, on average; and exactly where nothing is
    in shadow. Lights of all kinds, sizes and colours, some brighter by far, some that shine elsewhere."""
    rng = np.random.default_rng(3)
    floor, roof, white = scenes.plane(2.0), scenes.box((-0.3, -0.3, 0.2), (0.3, 0.3, 0.5)), scenes.diffuse(0.8)
    lights = []
    for index in range(48):
        kind = (LightKind.POINT, LightKind.AREA, LightKind.SUN)[index % 3]
        at = (*rng.uniform(-1.0, 1.0, 2).tolist(), float(rng.uniform(0.6, 1.5)))
        more = {"direction": (*rng.uniform(-0.5, 0.5, 2).tolist(), -1.0)} if kind == LightKind.SUN else {"position": at}
        more |= {"size": (0.2, 0.1)} if kind == LightKind.AREA else {}
        power = 10.0 ** rng.uniform(-2.0, 0.0) * (0.2 if kind == LightKind.SUN else 1.0)
        seen_by = RayVisibility.ALL & ~RayVisibility.DIFFUSE if index % 7 == 0 else RayVisibility.ALL
        color = tuple((power * rng.uniform(0.2, 1.0, 3)).tolist())
        lights.append(scenes.light(kind, color, visibility=seen_by, **more))

    def leaving(chosen: list[Any], seed: int, **settings: Any) -> np.ndarray:
        made = scenes.scene((floor, white), (roof, white), lights=chosen)
        with pipeline(gpu, made, scenes.settings(40, bounces=0, seed=seed, **settings), samples=0) as ready:
            return radiance(ready)

    seeds = range(6)
    groups = np.mean([sum(leaving(lights[i : i + 16], seed) for i in (0, 16, 32)) for seed in seeds], axis=0)
    many = np.array([leaving(lights, seed) for seed in seeds])
    shadowed = groups.mean() / sum(leaving(lights[i : i + 16], 0, use_shadows=False) for i in (0, 16, 32)).mean()
    assert shadowed < 0.8, "shadows matter here"
    means = many.mean(axis=(0, 1)) / groups.mean(axis=0)
    np.testing.assert_allclose(means, 1.0, atol=0.01)
    assert np.abs(many.mean(axis=0) - groups).mean() < 0.05 * groups.mean()
    assert np.array_equal(many[0], leaving(lights, 0)), "the same seed, the same light"


@pytest.mark.parametrize(("radius", "points"), [(0.4, 1), (0.9, 2), (1.4, 3), (3.0, 4)])
def test_wide_penumbras_are_asked_at_more_points(
    radius: float, points: int, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Under an edge half way to a lamp, ``radius`` cells wide: of so many points on it each face sees some, or none."""
    monkeypatch.setattr(inject, "POINTS_IN_ALL", 1)  # as where faces are many: one point of each
    edge = scenes.mesh([[-1, -1, 1], [0, -1, 1], [0, 1, 1], [-1, 1, 1]], [[0, 1, 2], [0, 2, 3]])
    lamp = scenes.light(LightKind.POINT, 1.0, (0.0, 0.0, 2.0), radius=radius / 8.0)

    def leaving(use_shadows: bool) -> np.ndarray:
        made = scenes.scene((scenes.plane(4.0), scenes.diffuse(1.0)), (edge, scenes.diffuse(1.0)), lights=[lamp])
        chosen = scenes.settings(32, bounces=0, use_shadows=use_shadows)
        with pipeline(gpu, made, chosen, samples=0) as ready:
            faces = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry).faces  # type: ignore[arg-type]
            floor = (faces["facing"] == 4) & (faces["position"][:, 2] < faces["position"][:, 2].mean())
            return radiance(ready)[floor, 0]

    seen = points * leaving(True) / leaving(False)
    counts = np.rint(seen)
    np.testing.assert_allclose(seen, counts, atol=0.05 * points)
    assert set(counts.astype(int)) == set(range(points + 1))


@pytest.mark.parametrize(
    "lamp",
    [
        scenes.light(LightKind.POINT, 1.0, (0.0, 0.0, -0.1), radius=0.3),
        scenes.light(LightKind.POINT, 1.0, (0.0, 0.0, -0.1), radius=0.3, soft_falloff=False),
        scenes.light(LightKind.AREA, 1.0, (-0.9, 0.0, -0.18), direction=(1.0, 0.0, 0.0), size=(0.3, 0.3)),
        scenes.light(LightKind.SUN, 1.0, direction=(0.8, 0.0, 0.6), angle=2.0),
    ],
    ids=["disk", "sphere", "area", "sun"],
)
def test_a_light_with_its_middle_below_a_floor_lights_it(lamp: LightData, gpu: GpuContext) -> None:
    """What of it lies above shines there; all of it further down does not."""

    def brightest(light: LightData) -> float:
        made = scenes.scene((scenes.plane(2.0), scenes.diffuse(1.0)), lights=[light])
        with pipeline(gpu, made, scenes.settings(32, bounces=0, use_shadows=False), samples=0) as ready:
            return float(radiance(ready)[facing_up(ready)].max())

    if lamp.kind == LightKind.AREA:  # stands on a corner: none of its sides is as high as it lies low
        x, y, z = lamp.axes
        lamp = dataclasses.replace(lamp, axes=np.array([(x + y) / np.sqrt(2.0), (y - x) / np.sqrt(2.0), z]))
    assert brightest(lamp) > 1e-3
    below = {"angle": 0.5} if lamp.kind == LightKind.SUN else {"position": (0.0, 0.0, -0.6)}
    assert brightest(dataclasses.replace(lamp, **below)) == 0.0


# Bounces --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("albedo", [0.5, 0.8, 0.95])
def test_closed_box(albedo: float, gpu: GpuContext) -> None:
    """Emission 1 - r on walls of albedo r: after n bounces 1 - r^(n + 2), in the end 1, leaves every face inside. What
    is not emission was passed on."""
    made = scenes.scene((scenes.box(inside_out=True), scenes.glowing(albedo, 1.0 - albedo)))
    for bounces in (3, 200):
        with pipeline(gpu, made, scenes.settings(16, bounces=bounces), samples=0) as ready:
            found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
            middle = np.array(found.voxels.grid.grid_from_world[:3, 3])
            inside = np.einsum("fk,fk->f", found.faces["normal"], middle - found.faces["position"]) > 0
            expected = (1.0 - albedo**5 if bounces == 3 else 1.0) - (1.0 - albedo)
            # Bounces stop when little changes: 1/(1 - r) makes more of it near 1.
            np.testing.assert_allclose(radiance(ready)[inside], expected, atol=5e-3)
            assert radiance(ready)[~inside].max() == 0.0
            assert inside.sum() > 1000


@pytest.mark.parametrize("albedo", [0.5, 0.95])
def test_bounces_that_are_not_made(albedo: float, gpu: GpuContext) -> None:
    """Bounces stop when little changes, and what is left is added: within .05 % of all that there is."""
    made = scenes.scene((scenes.box(inside_out=True), scenes.glowing(albedo, 1.0 - albedo)))
    with pipeline(gpu, made, scenes.settings(16, bounces=1000), samples=0) as ready:
        found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
        middle = np.array(found.voxels.grid.grid_from_world[:3, 3])
        inside = np.einsum("fk,fk->f", found.faces["normal"], middle - found.faces["position"]) > 0
        np.testing.assert_allclose(radiance(ready)[inside], albedo, rtol=5e-4)
        assert ready.statistics()["bounces"] < 130  # 0.95^130 is 0.13 %


def test_bounces_end_when_dim_places_are_done_too(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lamp in one of three rooms, each with a chink to the next: as if bounces went on for ever."""
    white = scenes.diffuse(0.8)
    walls = [scenes.box((x - 0.02, -1.0, -1.0), (x + 0.02, 0.9, 1.0)) for x in (-1.0, 1.0)]
    made = scenes.scene(
        (scenes.box((-3.0, -1.0, -1.0), (3.0, 1.0, 1.0), inside_out=True), white), *[(wall, white) for wall in walls],
        lights=[scenes.light(LightKind.POINT, 10.0, (2.0, -0.5, 0.5))],
    )  # fmt: skip
    settings = scenes.settings(48, bounces=600)
    with pipeline(gpu, made, settings, samples=0) as ready:
        found, bounces = radiance(ready).sum(axis=1), ready.statistics()["bounces"]
    monkeypatch.setattr(bounce, "CONVERGED", 0.0)
    with pipeline(gpu, made, settings, samples=0) as ready:
        exact, all_bounces = radiance(ready).sum(axis=1), ready.statistics()["bounces"]
        there = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
    x = there.faces["position"][:, 0] * there.voxels.grid.cell_size + there.voxels.grid.origin[0]
    for first, end in ((1.0, 3.0), (-1.0, 1.0), (-3.0, -1.0)):
        room = (x > first + 0.1) & (x < end - 0.1)
        assert found[room].sum() == pytest.approx(exact[room].sum(), rel=5e-3)
    roots = np.sqrt(exact)
    assert 2.0 * np.abs(np.sqrt(found) - roots).sum() < 2e-3 * roots.sum()
    assert bounces < all_bounces / 3


def test_bounces_go_on_where_few_faces_have_light(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lit closet in a dark hall: none of the faces that are asked at first knows of it."""
    white = scenes.diffuse(0.8)
    hall = (scenes.box((-4.0, -1.0, -1.0), (4.0, 1.0, 1.0), inside_out=True), white)
    closet = (scenes.box((3.0, 0.5, 0.5), (3.4, 0.9, 0.9), inside_out=True), white)
    made = scenes.scene(hall, closet, lights=[scenes.light(LightKind.POINT, 10.0, (3.2, 0.7, 0.7))])
    found = {}
    for asked in (1, 1 << 16):
        monkeypatch.setattr(bounce, "_ASKED", asked)
        with pipeline(gpu, made, scenes.settings(48, bounces=256), samples=0) as ready:
            found[asked] = ready.statistics()["bounces"], radiance(ready)
    assert found[1][0] == found[1 << 16][0] > 8
    np.testing.assert_allclose(found[1][1], found[1 << 16][1], rtol=1e-3)
    assert not found[1][1][0].any() and found[1][1].any(), "the first face is dark"


def test_many_links(gpu: GpuContext) -> None:
    """As many links as can be set, beside a ball that has a thousand triangles in a cell: none is lost, and in a closed
    room that emits half of what leaves it the other half comes by links."""
    room = (scenes.box(inside_out=True), scenes.glowing(0.5, 0.5))
    ball = (scenes.sphere(0.1, 24), scenes.glowing(0.5, 0.5), scenes.at(0.3, 0.2, 0.1))
    with pipeline(gpu, scenes.scene(room, ball), scenes.settings(12, bounce_rays=256), samples=0) as ready:
        found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
        grid = found.voxels.grid
        place = found.faces["position"] * grid.cell_size + grid.origin
        out = place - [0.3, 0.2, 0.1]
        of_ball = (np.linalg.norm(out, axis=1) < 0.15) & (np.einsum("fk,fk->f", out, found.faces["normal"]) > 0.0)
        assert of_ball.sum() > 6
        np.testing.assert_allclose(radiance(ready)[of_ball], 0.5, rtol=0.03)


def test_sky_over_a_plane(gpu: GpuContext) -> None:
    """Under a sky of radiance L a plane of albedo a leaves a L above; what is below sees the sky too."""
    made = scenes.scene((scenes.plane(2.0), scenes.diffuse(0.6)), world=scenes.world((2.0, 1.0, 0.5)))
    with pipeline(gpu, made, scenes.settings(8, bounces=1), samples=0) as ready:
        found = radiance(ready)
        np.testing.assert_allclose(found, np.broadcast_to([1.2, 0.6, 0.3], found.shape), rtol=2e-3)


def test_black_world_brings_nothing(gpu: GpuContext) -> None:
    """An open, unlit, white plane stays black: no light is made."""
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse(1.0)),
        (scenes.plane(0.2, 1.0), scenes.emission(0.0)),
        world=scenes.world(0.0),
    )
    with pipeline(gpu, made, scenes.settings(8), samples=1) as ready:
        assert ready.film.read("combined")[..., :3].max() == 0.0


def test_form_factor_of_parallel_squares(gpu: GpuContext) -> None:
    """A square that emits 1 over an equal black one at its own side's distance: mean incoming / pi = 0.1998."""
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse(1.0)),
        (scenes.plane(2.0), scenes.emission(1.0), scenes.at(z=2.0) @ down),
        camera=scenes.camera((0, 0, 1.9), width=2.0),
    )
    with pipeline(gpu, made, scenes.settings(24, bounces=1, bounce_rays=64), samples=0) as ready:
        found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
        faces = found.faces
        low = (faces["facing"] == 4) & (faces["position"][:, 2] < faces["position"][:, 2].mean())
        mean = np.average(radiance(ready)[low, 0], weights=faces["weight"][low])
        assert mean == pytest.approx(0.19982, rel=0.02)


@pytest.mark.parametrize("edge", [-0.2, -0.1, 0.2])
def test_coarse_voxels_know_where_shadows_end(edge: float, gpu: GpuContext) -> None:
    """A floor half in the shade of an edge that lies anywhere in its voxels: on few faces, too, the light in all is
    what falls on the lit part."""
    shade = scenes.mesh([[-1, -1, 0.5], [edge, -1, 0.5], [edge, 1, 0.5], [-1, 1, 0.5]], [[0, 1, 2], [0, 2, 3]])
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse(1.0)), (shade, scenes.diffuse(0.0)),
        lights=[scenes.light(LightKind.SUN, np.pi, direction=(0.0, 0.0, -1.0))],
    )  # fmt: skip
    with pipeline(gpu, made, scenes.settings(8, bounces=0), samples=0) as ready:
        faces = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry).faces  # type: ignore[arg-type]
        floor = (faces["facing"] == 4) & (faces["reflectance"][:, 0] > 0.5)
        found = np.average(radiance(ready)[floor, 0], weights=faces["weight"][floor])
    assert found == pytest.approx(0.5 * (1.0 - edge), abs=0.012)


# Pictures -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_furnace(albedo: float, gpu: GpuContext) -> None:
    """The same closed box in a picture: 1 everywhere."""
    made = scenes.scene(
        (scenes.box(inside_out=True), scenes.glowing(albedo, 1.0 - albedo)),
        camera=scenes.camera((0.3, -0.2, 0.4), (1.0, 1.0, -1.0), angle=1.6),
    )
    with pipeline(gpu, made, scenes.settings(24, bounces=64, rays=8), (24, 24), samples=2) as ready:
        picture = ready.film.read("combined")
        assert picture[..., :3].mean() == pytest.approx(1.0, abs=0.01)
        assert np.abs(picture[..., :3] - 1.0).max() < 0.05
        np.testing.assert_allclose(picture[..., 3], 1.0, atol=1e-6)


@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.6, 1.0])
def test_white_metal_under_a_white_sky(roughness: float, gpu: GpuContext) -> None:
    """A metal that absorbs nothing, its lobe's lost light put back, is as bright as the sky: within 3 %, seen from
    60 degrees and from above."""
    metal = scenes.principled(1.0, Metallic=1.0, Roughness=roughness)
    for position in ((0.0, -1.0, 0.577), (0.0, -0.1, 1.0)):
        made = scenes.scene(
            (scenes.plane(2.0), metal), world=scenes.world(1.0), camera=scenes.camera(position, width=0.3, near=-5.0)
        )
        with pipeline(gpu, made, scenes.settings(8), (16, 16), samples=16) as ready:
            assert ready.film.read("combined")[..., :3].mean() == pytest.approx(1.0, abs=0.03)


def test_white_principled_under_a_white_sky(gpu: GpuContext) -> None:
    """Diffuse below, dielectric above, nothing absorbed."""
    made = scenes.scene(
        (scenes.plane(2.0), scenes.principled(1.0, Roughness=0.4, IOR=1.5)),
        world=scenes.world(1.0),
        camera=scenes.camera((0.0, -0.5, 1.0), width=0.3),
    )
    with pipeline(gpu, made, scenes.settings(8), (16, 16), samples=16) as ready:
        assert ready.film.read("combined")[..., :3].mean() == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("roughness", [0.3, 0.8])
def test_glossy_reflection_of_a_sun(roughness: float, gpu: GpuContext) -> None:
    """Sampled from the light: E f(n, v, l) cos, f in float64 (Walter 2007, Heitz 2014), mirror direction."""
    alpha = roughness**2
    sun = scenes.light(LightKind.SUN, np.pi, direction=(0.0, 0.5, -np.sqrt(0.75)))
    metal = scenes.principled(1.0, Metallic=1.0, Roughness=roughness)
    made = scenes.scene(
        (scenes.plane(2.0), metal), lights=[sun], camera=scenes.camera((0.0, 1.0, np.sqrt(3.0)), width=0.2)
    )
    cosine = np.sqrt(0.75)
    tan2 = 1 / cosine**2 - 1
    smith = 1 / (1 + 2 * 0.5 * (np.sqrt(1 + alpha**2 * tan2) - 1))
    expected = np.pi * (1 / (np.pi * alpha**2)) * smith / (4 * cosine)
    with pipeline(gpu, made, scenes.settings(8), (8, 8), samples=2, outputs=("glossy_direct",)) as ready:
        found = ready.film.read("glossy_direct").mean()
        # What one scattering loses, the others bring back, as a factor on the lobe.
        assert found == pytest.approx(expected / sum(specular_scale_bias(cosine, roughness)), rel=0.02)


def test_no_surface_shows_the_world_exactly(gpu: GpuContext) -> None:
    """Nothing at all; one point; an object without triangles; one triangle without area."""
    empty = scenes.mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    point = scenes.mesh([[0.1, 0.2, 0.3]], np.zeros((0, 3)))
    flat = scenes.soup(np.zeros((1, 3, 3)))
    white = scenes.diffuse()
    for objects in ((), ((empty, white),), ((point, white),), ((flat, white),)):
        made = scenes.scene(*objects, world=scenes.world((0.25, 0.5, 1.0)))
        with pipeline(gpu, made, scenes.settings(8), (5, 3), samples=2) as ready:
            np.testing.assert_array_equal(
                ready.film.read("combined"), np.broadcast_to([0.25, 0.5, 1.0, 1.0], (3, 5, 4))
            )
            assert ready.statistics()["occupied"] == 0


def test_camera_inside_geometry_and_odd_sizes(gpu: GpuContext) -> None:
    """Pictures of 1 x 1 and 300 x 5 pixels (more than one tile), and a camera in the middle of a wall: finite."""
    made = scenes.scene(
        (scenes.box(), scenes.diffuse()),
        world=scenes.world(1.0),
        camera=scenes.camera((0.0, 0.0, 1.0), (0.0, 1.0, 1.0)),
    )
    for size in ((1, 1), (300, 5)):
        with pipeline(gpu, made, scenes.settings(8), size, samples=1) as ready:
            picture = ready.film.read("combined")
            assert picture.shape == (size[1], size[0], 4) and np.isfinite(picture).all()


def test_samples_converge(gpu: GpuContext) -> None:
    """Noise falls: the mean of sixteen passes is nearer to that of many than one pass is."""
    made = scenes.cornell()
    with pipeline(gpu, made, scenes.settings(24), (24, 24), samples=1) as ready:
        one = ready.film.read("combined")
        sample(ready, 15)
        sixteen = ready.film.read("combined")
        sample(ready, 48)
        many = ready.film.read("combined")
    assert np.square(sixteen - many).mean() < 0.3 * np.square(one - many).mean()
    assert many[..., :3].mean() > 0.01


@pytest.mark.parametrize("distance", [1e3, 1e5, 1e7])
def test_shadows_of_far_lights_begin_where_things_stand(distance: float, gpu: GpuContext) -> None:
    """A point light that is far is a sun: a card close above a floor throws its shadow."""
    toward = np.array([-1.0, 0.0, 0.5]) / 1.25**0.5
    card = scenes.plane(0.6, 0.05)
    sun = scenes.light(LightKind.SUN, 1.0, direction=-toward)
    point = scenes.light(LightKind.POINT, distance**2, toward * distance)

    def lit(light: LightData) -> np.ndarray:
        white = scenes.diffuse(0.8)
        made = scenes.scene((scenes.plane(2.0), white), (card, white), lights=[light])
        with pipeline(gpu, made, scenes.settings(16, use_indirect=False), size=(32, 32), samples=1) as ready:
            return ready.film.read("combined")[..., 0]

    expected, found = lit(sun), lit(point)
    assert (expected < 0.1 * expected.max()).sum() > 20
    assert (np.abs(found - expected) > 0.1 * expected.max()).mean() < 0.005
