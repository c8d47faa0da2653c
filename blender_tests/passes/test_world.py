# SPDX-License-Identifier: GPL-3.0-or-later
"""A world that is a picture: how it is read, and that its light is the same however it is found."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.materials.graph import ImageData, ImageEncoding, ImageSet, NodeGraph, WorldData
from addon.passes import world
from addon.passes.world import WorldLight, picture_size
from addon.passes.world_table import direction_table, luminances, solid_angles, surplus
from addon.pipeline import Pipeline
from addon.scene import SceneData
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import map_list, pipeline, radiance, test_kernel


def picture(values: np.ndarray) -> WorldData:
    """A world of (R, C) radiance, row 0 lowest."""
    pixels = np.ones((*values.shape, 4), np.float32)
    pixels[..., :3] = values[..., None]
    image = ImageSet("sky", {1001: ImageData("sky", pixels, ImageEncoding.LINEAR)})
    nodes = (
        node("T", "TexEnvironment", image=image),
        node("B", "Background", Color="T.Color", Strength=1.0),
        node("Output", "OutputWorld", Surface="B.Background"),
    )
    return WorldData("sky", NodeGraph({n.name: n for n in nodes}, "Output"))


def patch(rows: slice, columns: slice, inside: float, outside: float = 0.0) -> np.ndarray:
    """(128, 256) radiance: a patch of its own."""
    values = np.full((128, 256), outside)
    values[rows, columns] = inside
    return values


def on_a_plane(values: np.ndarray) -> float:
    """Irradiance / pi on a surface that faces up."""
    rows, columns = values.shape
    squared_sine = np.sin(np.linspace(np.pi, 0.0, rows + 1)) ** 2
    projected = (np.pi / columns) * -np.diff(squared_sine)[:, None]  # integral of sine times cosine
    upper = np.arange(rows)[:, None] >= rows // 2
    return float((values * projected * upper).sum()) / np.pi


#: About 3 degrees wide, 41 above the horizon; and a wider one in a sky, for what rays find in a few passes too.
SUN = patch(slice(92, 94), slice(100, 102), 1000.0)
GLOW = patch(slice(86, 100), slice(90, 110), 20.0, 0.5)


# The picture ----------------------------------------------------------------------------------------------------


def image_of(columns: int, rows: int) -> ImageData:
    return ImageData("image", np.zeros((rows, columns, 4), np.uint8), ImageEncoding.LINEAR)


def test_size_of_the_picture() -> None:
    """Odd multiples of the finest image."""
    assert picture_size([]) == (512, 256)
    assert picture_size([image_of(256, 128)]) == (768, 384)
    assert picture_size([image_of(512, 256)]) == (512, 256)
    assert picture_size([image_of(1024, 512), image_of(64, 32)]) == (1024, 512)
    assert picture_size([image_of(8192, 4096)]) == (4096, 2048)


def test_steps_of_an_image_are_kept(gpu: GpuContext) -> None:
    """Between its texels a world shows what the image's own bilinear sampler gives."""
    values = np.zeros((24, 48))
    values[12:] = np.random.default_rng(0).random((12, 48)) + 1.0
    light = WorldLight(gpu)
    light.run(picture(values))
    assert light.texture is not None and light.texture.size[1] % 24 == 0
    baked = np.frombuffer(light.texture.read(), np.float32).reshape(*light.texture.size[::-1], 4)[..., 0]
    light.release()
    multiple = baked.shape[0] // 24
    np.testing.assert_allclose(baked[multiple // 2 :: multiple, baked.shape[1] // 96 :: baked.shape[1] // 48], values,
                               rtol=2e-3)  # fmt: skip


# Drawn directions -----------------------------------------------------------------------------------------------


def test_drawn_directions_follow_the_density(gpu: GpuContext) -> None:
    """Counts by part of the picture, the sum of 1 / density over lit directions, and the weights of rays there."""
    values = np.random.default_rng(1).random((8, 16)) ** 4
    values[2:5] = 0.0
    values[6, 5] = 50.0
    light = WorldLight(gpu)
    light.run(picture(values))
    assert light.texture is not None and light.is_concentrated
    columns, rows = light.texture.size
    baked = np.frombuffer(light.texture.read(), np.float32).reshape(rows, columns, 4)
    _, density = direction_table(surplus(luminances(baked[..., :3])))
    np.testing.assert_array_equal(baked[..., 3], density)

    count = 1 << 18
    inputs = np.zeros((count, 4))
    inputs[:, :2] = np.random.default_rng(2).random((count, 2))
    inputs[:, 2] = np.arange(count)
    kernel = test_kernel(gpu, "world_sample")
    light.bind(kernel)
    light.bind_drawn(kernel, 4, table=True)
    found = map_list(gpu, kernel, inputs, 8).astype(np.float64)
    light.release()

    direction = found[:, :3]
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=1e-5)
    u = 0.5 - np.arctan2(direction[:, 1], direction[:, 0]) / (2 * np.pi)
    v = 1.0 - np.arccos(direction[:, 2]) / np.pi
    column, row = (u * columns).astype(int) % columns, np.minimum((v * rows).astype(int), rows - 1)
    same = found[:, 3] == density[row, column].astype(np.float32)
    assert same.mean() > 0.98  # others lie on the border of two texels
    weights = 1.0 / (1.0 + (4.0 * found[:, 3]) ** 2)
    assert np.isclose(found[:, 7], weights, rtol=1e-2).mean() > 0.98

    chance = (density * solid_angles(rows, columns)).reshape(8, rows // 8, 16, columns // 16).sum(axis=(1, 3))
    drawn = np.histogram2d(v, u, bins=(8, 16), range=((0, 1), (0, 1)))[0] / count
    np.testing.assert_allclose(drawn, chance, atol=5.0 * np.sqrt(chance.max() / count))
    bright = chance > 1e-3
    np.testing.assert_allclose(drawn[bright], chance[bright], rtol=0.25)
    # The mean of 1 / density is the solid angle of what may be drawn.
    often = density > 0.02
    wanted = float((solid_angles(rows, columns) * often).sum())
    assert np.mean(np.where(found[:, 3] > 0.02, 1.0 / found[:, 3], 0.0)) == pytest.approx(wanted, rel=0.02)


# Light ----------------------------------------------------------------------------------------------------------


def plane_under(values: np.ndarray, surface: Any = None, **more: Any) -> SceneData:
    return scenes.scene(
        (scenes.plane(2.0), surface or scenes.diffuse(0.5)), world=picture(values),
        camera=scenes.camera((0.0, -0.4, 1.0), width=0.3), **more,
    )  # fmt: skip


def draws(ready: Pipeline) -> bool:
    assert ready.features is not None
    return ready.features.draws_world_at_pixels


def test_a_patch_over_a_plane(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Radiance times projected solid angle, all of it direct light, with far less noise than guided rays alone have."""
    expected = on_a_plane(SUN)
    spreads = {}
    for limit in (world.CONCENTRATED, np.inf):
        monkeypatch.setattr(world, "CONCENTRATED", limit)
        outputs = ("diffuse_direct", "diffuse_indirect")
        settings = scenes.settings(8, use_reconstruction=False)
        with pipeline(gpu, plane_under(SUN), settings, (32, 32), samples=4, outputs=outputs) as ready:
            assert draws(ready) == (limit < np.inf)
            found = ready.film.read("diffuse_direct")[..., 0]
            spreads[draws(ready)] = found.std() / found.mean()
            if draws(ready):
                assert found.mean() == pytest.approx(expected, rel=0.01)
                combined = ready.film.read("combined")[..., 0].mean()
                assert combined == pytest.approx(0.5 * found.mean(), rel=1e-4)
            assert ready.film.read("diffuse_indirect").max() == 0.0
    assert spreads[True] < 0.03 * spreads[False]


def test_a_real_sun(gpu: GpuContext) -> None:
    """Brighter than a half float holds."""
    values = SUN * 1e3
    settings = scenes.settings(8)
    with pipeline(gpu, plane_under(values), settings, (16, 16), samples=8, outputs=("diffuse_direct",)) as ready:
        assert ready.film.read("diffuse_direct")[..., 0].mean() == pytest.approx(on_a_plane(values), rel=0.02)


def test_shadow_of_a_patch(gpu: GpuContext) -> None:
    """A board between plane and patch takes all of it."""
    azimuth = (0.5 - 101 / 256) * 2 * np.pi
    along = np.array([np.cos(azimuth), np.sin(azimuth), np.tan(np.pi * 29 / 128)])
    place = scenes.at(*(along / along[2]))
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse(0.5)), (scenes.plane(0.6), scenes.diffuse(0.0), place), world=picture(SUN),
        camera=scenes.camera((0.0, 0.0, 0.5), width=0.1),
    )  # fmt: skip
    with pipeline(gpu, made, scenes.settings(16), (16, 16), samples=2, outputs=("diffuse_direct",)) as ready:
        assert draws(ready) and ready.film.read("diffuse_direct").max() == 0.0


def sheet() -> Any:
    """Half of it is not there."""
    return material(
        node("D", "BsdfDiffuse", Color=(0.0, 0.0, 0.0, 1.0)), node("T", "BsdfTransparent"),
        node("M", "MixShader", Fac=0.5, Shader="D.BSDF", Shader_001="T.BSDF"), surface="M.Shader",
    )  # fmt: skip


def below(cover: Any, surface: Any) -> SceneData:
    """A plane under a wide sheet, the camera between them."""
    made = plane_under(GLOW)
    hung = scenes.scene((scenes.plane(2.0), surface), (scenes.plane(6.0), cover, scenes.at(z=1.5)))
    return dataclasses.replace(made, meshes=hung.meshes, instances=hung.instances, materials=hung.materials)


METAL = scenes.principled(0.9, Metallic=1.0, Roughness=0.5)
POLISHED = scenes.principled(0.9, Metallic=1.0, Roughness=0.25)
COATED = scenes.principled(0.5, Roughness=0.3)
CASES: dict[str, tuple[SceneData, dict[str, Any]]] = {
    "matte": (plane_under(GLOW), {}),
    "metal": (plane_under(GLOW, METAL), {}),
    "coated": (plane_under(GLOW, COATED), {}),
    "sphere": (scenes.scene((scenes.sphere(), COATED), world=picture(GLOW), camera=scenes.camera(angle=0.5)), {}),
    "amounts": (plane_under(GLOW, COATED), {"direct_amount": 2.0, "indirect_amount": 0.5, "specular_amount": 3.0}),
    "clamped": (plane_under(GLOW, COATED), {"clamp_indirect": 3.0}),
    "near": (below(scenes.diffuse(0.5), COATED), {"max_distance": 0.5}),
    "some passes": (plane_under(GLOW, COATED), {"gather_interval": 4, "rays": 32}),
    "no indirect light": (plane_under(GLOW, COATED), {"use_indirect": False}),
    "no reflections": (plane_under(GLOW, COATED), {"use_specular": False}),
    "sheet": (below(sheet(), scenes.diffuse(0.5)), {}),
    "sheet, polished": (below(sheet(), POLISHED), {}),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_the_same_light_with_and_without(
    case: tuple[SceneData, dict[str, Any]], gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Weights of drawn directions and rays add up to 1, in each render pass."""
    made, values = case
    outputs = ("diffuse_direct", "diffuse_indirect", "glossy_direct", "glossy_indirect")
    found = {}
    for limit, samples in ((world.CONCENTRATED, 32), (np.inf, 256)):
        monkeypatch.setattr(world, "CONCENTRATED", limit)
        settings = scenes.settings(12, **({"rays": 4} | values))
        with pipeline(gpu, made, settings, (32, 32), samples=samples, outputs=outputs) as ready:
            assert draws(ready) == (limit < np.inf)
            found[draws(ready)] = {n: float(ready.film.read(n)[..., :3].mean()) for n in ("combined", *outputs)}
    whole = found[False]["combined"]
    for name, value in found[True].items():
        assert value == pytest.approx(found[False][name], rel=0.02, abs=0.005 * whole), name


def test_faces_receive_the_patch(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each face of a plane: albedo times irradiance / pi; rays alone leave most of them dark."""
    expected = 0.5 * on_a_plane(SUN)
    for limit in (world.CONCENTRATED, np.inf):
        monkeypatch.setattr(world, "CONCENTRATED", limit)
        with pipeline(gpu, plane_under(SUN), scenes.settings(64, bounce_rays=4), samples=0) as ready:
            light = radiance(ready)[:, 0]
            lit = light > 0.0
            if draws(ready):
                assert light[lit].mean() == pytest.approx(expected, rel=0.01)
                assert light[lit].std() < 0.3 * expected and lit.mean() >= 0.5
            else:
                assert lit.mean() < 0.2


def test_furnace(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Under a picture of one radiance a white sphere cannot be seen, even where directions are drawn by it."""
    made = scenes.scene(
        (scenes.sphere(1.0, 32), scenes.diffuse(1.0)), world=picture(np.ones((16, 32))), camera=scenes.camera(angle=0.5)
    )
    monkeypatch.setattr(world, "surplus", lambda luminance: luminance)  # which has none
    for limit in (world.CONCENTRATED, 0.0):
        monkeypatch.setattr(world, "CONCENTRATED", limit)
        with pipeline(gpu, made, scenes.settings(16, rays=1), (24, 24), samples=16) as ready:
            assert draws(ready) == (limit == 0.0)
            found = ready.film.read("combined")[..., :3]
            assert found.mean() == pytest.approx(1.0, abs=0.005)


def test_an_even_sky_costs_nothing(gpu: GpuContext) -> None:
    """Bright above, dim below: no table, no pass for direct light."""
    values = np.concatenate([np.full((64, 256), 0.1), np.linspace(0.5, 1.0, 64)[:, None] * np.ones((1, 256))])
    with pipeline(gpu, plane_under(values), scenes.settings(8), (8, 8), samples=1) as ready:
        assert not draws(ready) and not ready.voxel_light.world.is_concentrated
        memory = ready.statistics()["memory"]
        assert "direct light" not in memory and memory["world"] == 768 * 384 * 16
