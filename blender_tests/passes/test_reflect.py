# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflections show the scene: mirrors, partly transparent surfaces in them, lights in lobes of any width."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.materials.graph import ImageData, ImageEncoding, ImageSet, MaterialData
from addon.passes.frame import Frame, Gather
from addon.passes.reflect import _layer_frame
from addon.scene import LightKind, SceneData
from addon.settings import Settings
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline

Picture = np.ndarray


def picture(gpu: GpuContext, made: SceneData, settings: Settings, size: tuple[int, int], samples: int) -> Picture:
    """(H, W, 3)."""
    with pipeline(gpu, made, settings, size, samples=samples) as ready:
        return ready.film.read("combined")[..., :3].astype(np.float64)


def glossy(color: Any = 1.0, roughness: float = 0.0) -> MaterialData:
    rgba = (*np.broadcast_to(np.asarray(color, float), 3).tolist(), 1.0)
    return material(
        node("G", "BsdfGlossy", Color=rgba, Roughness=roughness, p_distribution="GGX"), surface="G.BSDF", name="glossy"
    )


def textured(opacity: float = 1.0) -> MaterialData:
    """A picture of 16 x 16 random colours, for ``opacity`` of it."""
    pixels = np.random.default_rng(1).integers(0, 255, (16, 16, 4), dtype=np.uint8)
    image = ImageSet("colours", {1001: ImageData("colours", pixels, ImageEncoding.DATA)})
    return material(
        node("I", "TexImage", image, p_interpolation="Closest"), node("P", "BsdfDiffuse", Color="I.Color"),
        node("T", "BsdfTransparent", Color=(1.0, 1.0, 1.0, 1.0)),
        node("M", "MixShader", Fac=opacity, Shader="T.BSDF", Shader_001="P.BSDF"),
        surface="M.Shader", name="textured",
    )  # fmt: skip


def standing(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    """A plane that faces +z, turned to face -y, x to the right."""
    return scenes.at(x, y, z) @ np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])


def wall_and_mirror(wall: MaterialData, *, in_mirror: bool) -> SceneData:
    """A wall at y = 1 and a glowing one behind it; a mirror at y = -1 that faces them.

    Seen straight from y = -3 (the mirror's back is not there for the camera), or in the mirror from y = 1 behind the
    wall: the mirror image of that eye is the other one.
    """
    mirror = np.diag([1.0, -1.0, 1.0, 1.0]) @ standing(0.0, 1.0, 0.0)
    eye, target = ((0.0, 0.9, 0.0), (0.0, -1.0, 0.0)) if in_mirror else ((0.0, -2.9, 0.0), (0.0, 1.0, 0.0))
    behind = scenes.emission((0.0, 0.3, 0.6))
    things: list[tuple[Any, ...]] = [
        (scenes.plane(2.0), wall, standing(0.0, 1.0, 0.0)), (scenes.plane(8.0), behind, standing(0.0, 1.3, 0.0))
    ]  # fmt: skip
    if in_mirror:
        things.append((scenes.plane(2.0), glossy(), mirror))
    return scenes.scene(
        *things, lights=[scenes.light(LightKind.SUN, 3.0, direction=(0.2, 1.0, -0.3), casts_shadow=False)],
        camera=scenes.camera(eye, target, angle=0.5), pixel_filter_width=0.0,
    )  # fmt: skip


STRAIGHT = {"use_indirect": False, "bounces": 0}


@pytest.mark.parametrize("layers", [8, 0])
def test_a_mirror_shows_a_textured_wall_as_the_eye_sees_it(layers: int, gpu: GpuContext) -> None:
    """Pixel by pixel, however coarse the voxels. Without layers the same picture shows voxels: the test can fail."""
    settings = scenes.settings(12, **STRAIGHT, glossy_layers=layers)
    seen = picture(gpu, wall_and_mirror(textured(), in_mirror=False), settings, (48, 48), 1)
    mirrored = picture(gpu, wall_and_mirror(textured(), in_mirror=True), settings, (48, 48), 1)[:, ::-1]
    close = np.isclose(mirrored, seen, rtol=2e-3, atol=1e-4).all(axis=-1).mean()
    assert seen.std() > 0.05
    if layers:
        assert close > 0.99  # a pixel at the edge between two colours may fall on the other side
    else:
        assert close < 0.5


def test_a_mirror_shows_what_is_behind_partly_transparent_surfaces(gpu: GpuContext) -> None:
    settings = scenes.settings(12, **STRAIGHT)
    seen = picture(gpu, wall_and_mirror(textured(0.4), in_mirror=False), settings, (24, 24), 256)
    mirrored = picture(gpu, wall_and_mirror(textured(0.4), in_mirror=True), settings, (24, 24), 256)[:, ::-1]
    np.testing.assert_allclose(mirrored.mean(axis=(0, 1)), seen.mean(axis=(0, 1)), rtol=0.02)
    assert np.median(np.abs(mirrored - seen)) < 0.05


def glowing_picture(opacity: float) -> MaterialData:
    """As ``textured``, but emitting."""
    made = textured(opacity)
    assert made.graph is not None
    nodes = dict(made.graph.nodes)
    nodes["P"] = node("P", "Emission", Color="I.Color", Strength=1.0)
    return dataclasses.replace(made, graph=dataclasses.replace(made.graph, nodes=nodes))


def test_a_mirror_shows_a_glowing_picture_as_the_eye_sees_it(gpu: GpuContext) -> None:
    """Pixel by pixel where it is solid, on average where half of it is there: points drawn on it, rays that meet it and
    the surfaces that are shaded share its light without loss."""
    settings = scenes.settings(12, **STRAIGHT)
    for opacity, side, samples in ((1.0, 48, 1), (0.4, 24, 64)):
        wall = glowing_picture(opacity)
        seen = picture(gpu, wall_and_mirror(wall, in_mirror=False), settings, (side, side), samples)
        mirrored = picture(gpu, wall_and_mirror(wall, in_mirror=True), settings, (side, side), samples)[:, ::-1]
        np.testing.assert_allclose(mirrored.mean(axis=(0, 1)), seen.mean(axis=(0, 1)), rtol=0.02)
        if opacity == 1.0:
            assert np.isclose(mirrored, seen, rtol=2e-3, atol=1e-4).all(axis=-1).mean() > 0.99


def test_mirrors_that_face_each_other(gpu: GpuContext) -> None:
    """Two mirrors of reflectance 1/2 side by side with the eye between them: the n-th image of the glow is 1/2^n."""
    facing = scenes.plane(20.0)
    left = scenes.at(0.0, 0.0, -1.0)
    right = np.diag([1.0, -1.0, -1.0, 1.0]) + scenes.at(0.0, 0.0, 1.0) - np.eye(4)
    made = scenes.scene(
        (facing, glossy(0.5), left), (facing, glossy(0.5), right), world=scenes.world(1.0),
        camera=scenes.camera((0.0, 0.0, 0.0), (1.0, 0.0, -0.999), width=0.01), pixel_filter_width=0.0,
    )  # fmt: skip
    # From the middle at 45 degrees to mirrors that reach 10 m: down after 1 m, then every 2 m, out after 10 m.
    found = picture(gpu, made, scenes.settings(16, glossy_layers=16), (8, 8), 64).mean()
    assert found == pytest.approx(0.5**5, rel=0.05)


def area_reflection(roughness: float) -> float:
    """Radiance that a white GGX lobe at the origin, normal +z, sends straight up, lit by the lamp of the next test."""
    n = 400
    u = (np.arange(n) + 0.5) / n * 2.0 - 1.0
    x, y = np.meshgrid(u * 0.5 + 0.6, u * 0.5)
    squared = x * x + y * y + 4.0
    light = np.stack([x, y, np.full_like(x, 2.0)], -1) / np.sqrt(squared)[..., None]
    half = light + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    a2 = roughness**4
    d = a2 / (np.pi * (half[..., 2] ** 2 * (a2 - 1) + 1) ** 2)
    lam = 0.5 * (np.sqrt(1 + a2 * (1 / light[..., 2] ** 2 - 1)) - 1)
    brdf_cos = d / (1 + lam) / 4
    return float((3.0 * brdf_cos * light[..., 2] / squared).mean())  # the lamp's area is 1


@pytest.mark.parametrize(
    ("roughness", "surface", "aperture"),
    [(0.15, 0.15, 1.0), (0.3, 0.3, 1.0), (0.5, 0.5, 1.0), (0.9, 0.9, 1.0), (0.3, 0.5, 0.36), (0.6, 0.3, 4.0)],
)
def test_a_lamp_in_lobes_of_any_width(roughness: float, surface: float, aperture: float, gpu: GpuContext) -> None:
    """Points on the lamp and rays of the lobe find it together: the integral of the lobe over the lamp. ``roughness``:
    of the lobe, which setting specular_aperture makes of that of the surface."""
    made = scenes.scene(
        (scenes.plane(0.1), glossy(1.0, surface)),
        lights=[scenes.light(LightKind.AREA, 3.0, (0.6, 0.0, 2.0), size=(1.0, 1.0))],
        camera=scenes.camera((0.0, 0.0, 1.0), width=0.001),
    )
    settings = scenes.settings(8, use_indirect=False, specular_aperture=aperture)
    values = picture(gpu, made, settings, (16, 16), 64)
    assert values.mean() == pytest.approx(area_reflection(roughness), rel=0.03)


def test_only_sharp_gloss_has_layers(gpu: GpuContext) -> None:
    """Not a byte of them where reflections are wide, and no program."""

    def memory(roughness: float, **settings: Any) -> tuple[set[str], bool]:
        room = scenes.cornell()
        made = dataclasses.replace(room, materials=(glossy(0.5, roughness), *room.materials[1:]))
        with pipeline(gpu, made, scenes.settings(12, **settings), samples=1) as ready:
            assert ready.features is not None
            return set(ready.statistics()["memory"]), ready.features.follows_glossy

    for found, follows in (memory(0.6), memory(0.1, glossy_layers=0), memory(0.1, use_specular=False)):
        assert not follows and "reflected surfaces" not in found
    found, follows = memory(0.1)
    assert follows and "reflected surfaces" in found


def test_layers_draw_points_of_their_own(gpu: GpuContext) -> None:
    """No layer of a pass, nor the picture itself, draws the points of another: products of them would be wrong."""
    with pipeline(gpu, wall_and_mirror(scenes.diffuse(), in_mirror=True), Settings(samples=1), (8, 8)) as ready:
        surface, features = ready.picture.surface.pictures, ready.features
        assert surface is not None and features is not None
        for index in (1, 2, 7):
            camera, gather = ready.picture.camera, Gather(index, index)
            frame = Frame(index, index, gather, camera, (0.5, 0.5), surface, features, Settings())
            layers = [_layer_frame(frame, surface, number) for number in range(4)]
            assert len({frame.sample, *(layer.sample for layer in layers)}) == 5
            assert [layer.gather.sample for layer in layers if layer.gather] == [layer.sample for layer in layers]
