# SPDX-License-Identifier: GPL-3.0-or-later
"""Glowing surfaces as lights: what the table holds, and that light is the same however it is found."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from addon.gpu import interface
from addon.gpu.context import GpuContext
from addon.materials.graph import MaterialData
from addon.passes import emitters
from addon.passes.emitters import EmitterTable, distribution, divisions, effective_area
from addon.pipeline import Pipeline
from addon.scene import LightData, LightKind, MeshData, RayVisibility, SceneData
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import map_list, pipeline, radiance, read_list, read_voxels, test_kernel

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def turned(x: float, y: float, z: float) -> np.ndarray:
    """Moves, and turns what faces up to face down."""
    return scenes.at(x, y, z) @ DOWN


def one_sided(radiance: float) -> MaterialData:
    """Emits from the front, reflects nothing."""
    return material(
        node("G", "NewGeometry"), node("E", "Emission", Color=(radiance,) * 3 + (1.0,), Strength=1.0),
        node("B", "BsdfDiffuse", Color=(0.0, 0.0, 0.0, 1.0)),
        node("M", "MixShader", Fac="G.Backfacing", Shader="E.Emission", Shader_001="B.BSDF"), surface="M.Shader",
    )  # fmt: skip


def painted(radiance: float) -> MaterialData:
    """Emits (u, v, 0) times ``radiance``."""
    return material(
        node("T", "TexCoord"), node("E", "Emission", Color="T.UV", Strength=radiance), surface="E.Emission"
    )


# The table ------------------------------------------------------------------------------------------------------


def test_chances_follow_power() -> None:
    power = np.array([0.0, 1.0, 3.0, 0.0, 1e-12, 4.0, 0.0])
    units = np.diff(distribution(power), prepend=0.0)
    assert units.sum() == interface.EMITTER_UNITS and (units == np.rint(units)).all()
    assert (units[power == 0.0] == 0.0).all() and units[4] == 1.0
    np.testing.assert_allclose(units / interface.EMITTER_UNITS, power / 8.0, atol=3 / interface.EMITTER_UNITS)


def test_edges_are_divided_where_emission_varies() -> None:
    """Parts as large as half a cell's square; constant emission needs one; all together stay within bounds."""
    found = divisions(np.array([0.1, 8.0, 8.0, 1e9]), np.array([True, True, False, False]))
    assert found.tolist() == [1, 4, 1, 1]
    many = divisions(np.full(10000, 1e4), np.ones(10000, bool))
    assert 1 <= many.max() <= emitters.MAX_DIVISION and (many**2).sum() < 2 * emitters.MAX_PARTS


def test_effective_area() -> None:
    """Even brightness: all of it. A small bright one among large dim ones: about its own."""
    assert effective_area(np.array([1.0, 2.0]), np.array([5.0, 5.0])) == pytest.approx(3.0)
    assert effective_area(np.array([1.0, 100.0]), np.array([1e4, 1e-3])) == pytest.approx(1.0, rel=1e-4)
    assert effective_area(np.zeros(2), np.ones(2)) == 0.0


@pytest.mark.parametrize("n", [1, 2, 3, 7, 64])
def test_parts_of_a_triangle(n: int, gpu: GpuContext) -> None:
    """They have equal areas that add up, keep the triangle's orientation, and a point of each is found in it."""
    inner = np.array([[0.05, 0.05], [0.9, 0.05], [0.05, 0.9], [0.3, 0.3]])
    inputs = np.zeros((n * n * len(inner), 4))
    inputs[:, 0], inputs[:, 1] = np.repeat(np.arange(n * n), len(inner)), n
    inputs[:, 2:] = np.tile(inner, (n * n, 1))
    found = map_list(gpu, test_kernel(gpu, "emitter_part"), inputs, 8)
    np.testing.assert_array_equal(found[:, 6], inputs[:, 0])
    area = found[:, 2] * found[:, 5] - found[:, 3] * found[:, 4]
    np.testing.assert_allclose(area, 1.0 / n**2, rtol=1e-4)


def table(made: Pipeline) -> np.ndarray:
    """The records of the pipeline's emitters."""
    found: EmitterTable = made.voxel_light.emitters
    if found.records is None:
        return np.zeros(0, interface.EMITTER.dtype)
    texels = read_list(found.records, found.count * interface.EMITTER.texels, np.uint32)
    return np.ascontiguousarray(texels).ravel().view(interface.EMITTER.dtype)


def test_instances_and_sides(gpu: GpuContext) -> None:
    """Instances of one mesh, one of them mirrored, one emitting to the front alone: each triangle with its own area,
    radiance on the right side, and chance."""
    shape = scenes.plane(0.2)
    mirrored = scenes.at(1.0, 0.0, 1.0, (1.0, -1.0, 1.0))
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse()),
        (shape, scenes.emission((3.0, 2.0, 1.0)), scenes.at(0.0, 0.0, 1.0)),
        (shape, one_sided(4.0), scenes.at(-1.0, 0.0, 1.0, 2.0)),
        (shape, one_sided(4.0), mirrored),
    )
    with pipeline(gpu, made, scenes.settings(16), samples=0) as ready:
        found = table(ready)
        cell = ready.grid.cell_size  # type: ignore[union-attr]
        normal = np.cross(found["edge_1"].astype(float), found["edge_2"].astype(float))
        area = 0.5 * np.linalg.norm(normal, axis=1) * cell**2
        np.testing.assert_allclose(area, [0.02, 0.02, 0.08, 0.08, 0.02, 0.02], rtol=1e-4)
        np.testing.assert_allclose(found["front"][:2], np.tile([3.0, 2.0, 1.0], (2, 1)), rtol=1e-6)
        np.testing.assert_array_equal(found["front"][:2], found["back"][:2])
        for k in range(2, 6):
            # A mirrored mesh keeps its front: up, whichever way its corners now go round.
            up, down = ("front", "back") if normal[k, 2] > 0 else ("back", "front")
            np.testing.assert_allclose(found[up][k], 4.0, rtol=1e-6)
            assert found[down][k].max() == 0.0
        assert (normal[4:, 2] < 0).all()
        luminance = np.array([0.2126, 0.7152, 0.0722]) @ [3.0, 2.0, 1.0]
        power = area * np.array([2 * luminance] * 2 + [4.0] * 4)
        np.testing.assert_allclose(np.diff(found["cumulative"], prepend=0.0) / 2**24, power / power.sum(), atol=1e-6)


def test_what_emits_nothing_is_left_out(gpu: GpuContext) -> None:
    """Black emission, triangles without area, emitters that no ray from a surface sees: no table, no pass for it."""
    flat = scenes.soup(np.zeros((3, 3, 3)))
    unseen = RayVisibility.CAMERA | RayVisibility.SHADOW
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse()),
        (scenes.plane(0.2, 1.0), scenes.emission(0.0)),
        (flat, scenes.emission(5.0)),
        (scenes.plane(0.2, 1.5), scenes.emission(7.0), np.eye(4), unseen),
    )
    with pipeline(gpu, made, scenes.settings(16), samples=1) as ready:
        assert ready.features is not None and ready.features.names == ["geometry"]
        assert not {"emitters", "straight light of faces", "direct light"} & set(ready.statistics()["memory"])
        assert len(table(ready)) == 0


def test_many_emitters(gpu: GpuContext) -> None:
    """As many as a dispatch takes, and more: all are there, in order, each with a chance of its own."""
    count = emitters.EMITTERS_PER_STEP + 1000
    shape = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]])
    corners = shape + np.random.default_rng(0).uniform(-1.0, 1.0, (count, 1, 3))
    made = scenes.scene((scenes.soup(corners), scenes.emission(1.0)))
    with pipeline(gpu, made, scenes.settings(8, bounces=0), samples=0) as ready:
        found = table(ready)
        assert len(found) == count and (np.diff(found["cumulative"]) >= 1.0).all()
        assert found["cumulative"][-1] == interface.EMITTER_UNITS
        origin, cell = np.array(ready.grid.origin), ready.grid.cell_size  # type: ignore[union-attr]
        np.testing.assert_allclose(found["corner_grid"] * cell + origin, corners[:, 0], atol=1e-4)


# Light ----------------------------------------------------------------------------------------------------------


def form_factor(a: float, b: float, c: float) -> float:
    """From a point to an a x b rectangle that is parallel to its surface, a corner of it at height c above the point.

    Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-3.
    """
    x, y = a / c, b / c
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return float((x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * np.pi))


def lamp_over_plane(side: float, height: float, glow: MaterialData) -> SceneData:
    """The camera looks straight down at the middle of a plane, from below the lamp."""
    return scenes.scene(
        (scenes.plane(4.0), scenes.diffuse(0.5)),
        (scenes.plane(side), glow, turned(0.0, 0.0, height)),
        camera=scenes.camera((0.0, 0.0, 0.5 * height), width=0.01 * side),
    )  # fmt: skip


def _both(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    monkeypatch.setattr(emitters, "effective_area", lambda *_: 0.0)
    return {}


def _rays(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    monkeypatch.setattr(emitters, "effective_area", lambda *_: np.inf)
    return {}


def _points(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    return {"gather_mode": "OCCLUSION"}


#: Ways to find the light of emitters at pixels: settings of each.
WAYS = {"both": _both, "rays": _rays, "points": _points}
Way = Callable[[pytest.MonkeyPatch], dict[str, object]]


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS.keys())
@pytest.mark.parametrize("side", [0.5, 4.0])
def test_square_over_a_plane(side: float, way: Way, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Irradiance / pi below the middle is radiance times four form factors, all of it direct light."""
    expected = 4.0 * form_factor(side / 2, side / 2, 1.0) * np.array([6.0, 3.0, 1.0])
    made = lamp_over_plane(side, 1.0, scenes.emission((6.0, 3.0, 1.0)))
    settings = scenes.settings(20, rays=32, **way(monkeypatch))
    outputs = ("diffuse_direct", "diffuse_indirect")
    with pipeline(gpu, made, settings, (32, 32), samples=16, outputs=outputs) as ready:
        mean = ready.film.read("diffuse_direct").mean(axis=(0, 1))
        np.testing.assert_allclose(mean, expected, rtol=0.02)
        assert ready.film.read("diffuse_indirect").max() == 0.0
        np.testing.assert_allclose(ready.film.read("combined")[..., :3].mean(axis=(0, 1)), 0.5 * mean, rtol=1e-4)


def test_both_ways_are_less_noisy_than_either(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Points fail where the lamp is near, rays where it is small: together they fail in neither."""
    near, small = (lamp_over_plane(1.0, 0.02, scenes.emission(1.0)), lamp_over_plane(0.1, 1.0, scenes.emission(1.0)))

    def spread(made: SceneData, way: Way) -> float:
        settings = scenes.settings(20, rays=1, **way(monkeypatch))
        with pipeline(gpu, made, settings, (32, 32), samples=1, outputs=("diffuse_direct",)) as ready:
            picture = ready.film.read("diffuse_direct")[..., 0]
            return float(picture.std() / picture.mean())

    assert spread(near, _both) < 0.5 * spread(near, _points)
    assert spread(small, _both) < 0.1 * spread(small, _rays)


def test_an_emitter_has_two_sides_unless_its_material_says_otherwise(gpu: GpuContext) -> None:
    """Between two planes: light on both, or on the lower one alone; at pixels and at faces."""
    for glow, sides in ((scenes.emission(4.0), 2), (one_sided(4.0), 1)):
        made = scenes.scene(
            (scenes.plane(2.0), scenes.diffuse(0.5), turned(0.0, 0.0, 2.0)),
            (scenes.plane(2.0), scenes.diffuse(0.5)),
            (scenes.plane(0.4), glow, turned(0.0, 0.0, 1.0)),
            camera=scenes.camera((0.0, 0.0, 0.9), width=0.1),
        )
        above = dataclasses.replace(made, camera=scenes.camera((0.0, 0.0, 1.1), (0.0, 0.0, 2.0), width=0.1))
        expected = 4.0 * 4.0 * form_factor(0.2, 0.2, 1.0)
        settings = scenes.settings(16, bounces=1, rays=8)
        for view, lit in ((made, True), (above, sides == 2)):
            with pipeline(gpu, view, settings, (24, 24), samples=2, outputs=("diffuse_direct",)) as ready:
                direct = ready.film.read("diffuse_direct").mean()
                assert direct == pytest.approx(expected if lit else 0.0, rel=0.03)
        with pipeline(gpu, made, scenes.settings(16, bounces=0), samples=0) as ready:
            found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
            height = found.faces["position"][:, 2]
            light = radiance(ready)[:, 0]
            floor = (found.faces["facing"] == 4) & (height < height.min() + 1)
            ceiling = (found.faces["facing"] == 5) & (height > height.max() - 1)
            assert light[floor].mean() > 0.01
            assert light[ceiling].mean() == pytest.approx(light[floor].mean() if sides == 2 else 0.0, rel=0.1)


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS.keys())
def test_painted_emission(way: Way, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """A square that emits (u, v, 0): against the integral over it, in steps."""
    made = lamp_over_plane(2.0, 1.0, painted(4.0))
    # Off the middle, so that u and v differ: the lamp is turned over about x, which turns v round.
    at = np.array([0.6, 0.5])
    made = dataclasses.replace(made, camera=scenes.camera((*at, 0.5), (*at, 0.0), width=0.02))
    u, v = np.meshgrid((np.arange(200) + 0.5) / 200, (np.arange(200) + 0.5) / 200)
    squared = (2 * u - 1 - at[0]) ** 2 + (1 - 2 * v - at[1]) ** 2 + 1.0
    kernel = 4.0 / (np.pi * squared**2)  # area of the square / pi r^4, height 1
    expected = [4.0 * (u * kernel).mean(), 4.0 * (v * kernel).mean(), 0.0]
    assert expected[0] > 1.3 * expected[1]
    settings = scenes.settings(40, rays=16, **way(monkeypatch))
    with pipeline(gpu, made, settings, (32, 32), samples=4, outputs=("diffuse_direct",)) as ready:
        mean = ready.film.read("diffuse_direct").mean(axis=(0, 1))
        np.testing.assert_allclose(mean, expected, rtol=0.02, atol=1e-6)


def half_there(radiance: float) -> MaterialData:
    """Emission mixed half and half with nothing."""
    return material(
        node("E", "Emission", Color=(radiance,) * 3 + (1.0,), Strength=1.0), node("T", "BsdfTransparent"),
        node("M", "MixShader", Fac=0.5, Shader="E.Emission", Shader_001="T.BSDF"), surface="M.Shader",
    )  # fmt: skip


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS.keys())
def test_transparent_emitter(way: Way, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of it is not there: half of the light is."""
    expected = 4.0 * form_factor(0.5, 0.5, 1.0) * 3.0
    settings = scenes.settings(20, rays=16, **way(monkeypatch))
    made = lamp_over_plane(1.0, 1.0, half_there(6.0))
    with pipeline(gpu, made, settings, (32, 32), samples=4, outputs=("diffuse_direct",)) as ready:
        assert ready.film.read("diffuse_direct").mean() == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("roughness", [0.15, 0.5])
def test_reflections_of_an_emitter(roughness: float, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same highlight by points, rays and both, all of it glossy direct light."""
    metal = scenes.principled((0.9, 0.6, 0.3), Metallic=1.0, Roughness=roughness)
    made = scenes.scene(
        (scenes.plane(3.0), metal),
        (scenes.plane(0.5), scenes.emission(5.0), turned(0.0, 0.8, 1.0)),
        camera=scenes.camera((0.0, -1.0, 1.0), (0.0, 0.0, 0.0), width=0.6),
    )  # fmt: skip
    means = {}
    for name, way in WAYS.items():
        with monkeypatch.context() as patch:
            settings = scenes.settings(16, use_reconstruction=False, **way(patch))
            outputs = ("glossy_direct", "glossy_indirect")
            with pipeline(gpu, made, settings, (48, 48), samples=32, outputs=outputs) as ready:
                means[name] = ready.film.read("glossy_direct").mean(axis=(0, 1))
                assert ready.film.read("glossy_indirect").max() == 0.0
    assert means["both"].min() > 0.05
    np.testing.assert_allclose(means["points"], means["both"], rtol=0.03)
    np.testing.assert_allclose(means["rays"], means["both"], rtol=0.03)


def test_emitters_obey_visibility(gpu: GpuContext) -> None:
    """A lamp that diffuse rays do not see lights nothing diffuse; a roof below it leaves darkness, unless shadow rays
    and diffuse rays pass it."""

    def light(lamp: RayVisibility, roof: RayVisibility) -> float:
        made = scenes.scene(
            (scenes.plane(4.0), scenes.diffuse(0.5)),
            (scenes.plane(0.2), scenes.emission(50.0), turned(0.0, 0.0, 1.0), lamp),
            (scenes.plane(4.0, 0.8), scenes.diffuse(0.0), np.eye(4), roof),
            camera=scenes.camera((0.0, 0.0, 0.5), width=0.1),
        )
        with pipeline(gpu, made, scenes.settings(16), (8, 8), samples=4) as ready:
            return float(ready.film.read("combined")[..., :3].mean())

    all_rays = RayVisibility.ALL
    passed = light(all_rays, all_rays & ~RayVisibility.SHADOW & ~RayVisibility.DIFFUSE)
    assert passed == pytest.approx(0.5 * 50.0 * 4 * form_factor(0.1, 0.1, 1.0), rel=0.03)
    assert light(all_rays, all_rays) == 0.0
    assert light(all_rays & ~RayVisibility.DIFFUSE, RayVisibility.CAMERA) == 0.0


def test_a_mesh_shines_as_an_area_light_does(gpu: GpuContext) -> None:
    """The Cornell box with its area light below a black plate, and with a glowing square in the light's place: block by
    block the same."""
    made = scenes.cornell()
    lamp = made.lights[0]
    assert lamp.kind == LightKind.AREA
    shape: MeshData = scenes.plane(lamp.size[0])
    hidden = RayVisibility.ALL & ~RayVisibility.CAMERA

    def with_square(surface: MaterialData, lights: tuple[LightData, ...], z: float) -> SceneData:
        square = dataclasses.replace(
            made.instances[0], mesh=len(made.meshes), materials=(len(made.materials),),
            world_from_object=turned(0.0, 0.0, z), visibility=hidden,
        )  # fmt: skip
        return dataclasses.replace(
            made, lights=lights, meshes=(*made.meshes, shape), materials=(*made.materials, surface),
            instances=(*made.instances, square),
        )  # fmt: skip

    z = float(lamp.position[2])
    light = with_square(scenes.diffuse(0.0), (dataclasses.replace(lamp, visibility=hidden),), z + 1e-3)
    mesh = with_square(one_sided(float(lamp.intensity[0])), (), z)
    pictures = []
    for variant in (light, mesh):
        settings = scenes.settings(32, bounce_rays=32)
        outputs = ("diffuse_direct", "diffuse_indirect")
        with pipeline(gpu, variant, settings, (32, 32), samples=32, outputs=outputs) as ready:
            pictures.append([ready.film.read(name).reshape(4, 8, 4, 8, 3).mean(axis=(1, 3)) for name in outputs])
    for expected, found in zip(*pictures, strict=True):
        assert found.mean() == pytest.approx(expected.mean(), rel=0.01)
        np.testing.assert_allclose(found, expected, rtol=0.1, atol=0.03 * expected.mean())


@pytest.mark.parametrize("albedo", [0.5, 0.95])
def test_furnace_by_both_ways(albedo: float, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where rays alone would do, points drawn as well change nothing but the noise."""
    _both(monkeypatch)
    made = scenes.scene(
        (scenes.box(inside_out=True), scenes.glowing(albedo, 1.0 - albedo)),
        camera=scenes.camera((0.3, -0.2, 0.4), (1.0, 1.0, -1.0), angle=1.6),
    )
    with pipeline(gpu, made, scenes.settings(24, bounces=256, bounce_rays=16), (24, 24), samples=16) as ready:
        assert ready.features is not None and ready.features.draws_emitters_at_pixels
        assert ready.film.read("combined")[..., :3].mean() == pytest.approx(1.0, abs=0.01)


def test_large_emitters_are_left_to_rays(gpu: GpuContext) -> None:
    """A closed glowing room draws no points; a lamp in a room does."""
    room = scenes.scene((scenes.box(inside_out=True), scenes.glowing(0.5, 0.5)))
    lamp = scenes.scene(
        (scenes.box(inside_out=True), scenes.diffuse(0.5)), (scenes.plane(0.2), scenes.emission(5.0))
    )
    for made, drawn in ((room, False), (lamp, True)):
        with pipeline(gpu, made, scenes.settings(16), samples=0) as ready:
            assert ready.features is not None
            assert ready.features.draws_emitters_at_pixels is drawn and ready.features.draws_emitters_at_faces is drawn
