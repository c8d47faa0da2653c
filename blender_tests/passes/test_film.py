# SPDX-License-Identifier: GPL-3.0-or-later
"""Render passes add up to the picture; depth, position, normal, colour and alpha are what geometry says."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.passes.compose import OUTPUTS
from addon.scene import LightKind, SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline


def glossy_room() -> SceneData:
    """Everything a picture can be made of: diffuse, glossy, emission, sky, a sun and a lamp that is seen."""
    return scenes.scene(
        (scenes.plane(3.0), scenes.principled((0.7, 0.4, 0.2), Roughness=0.3)),
        (scenes.sphere(0.5, 12), scenes.principled(0.9, Metallic=1.0, Roughness=0.4), scenes.at(-0.4, 0.3, 0.5)),
        (scenes.box(), scenes.glowing(0.5, (0.2, 0.1, 0.4)), scenes.at(0.7, 0.3, 0.3, 0.3)),
        lights=[
            scenes.light(LightKind.SUN, 2.0, direction=(0.3, 0.2, -1.0), angle=0.05),
            scenes.light(LightKind.POINT, 5.0, (0.0, 1.2, 1.0), radius=0.2),
        ],
        world=scenes.world((0.1, 0.2, 0.4)), camera=scenes.camera((0.0, -3.0, 1.5), (0.0, 0.0, 0.4), aspect=4 / 3),
    )  # fmt: skip


PASSES = tuple(OUTPUTS)


@pytest.mark.parametrize("amounts", [{}, {"direct_amount": 0.5, "indirect_amount": 2.0, "specular_amount": 0.25}])
@pytest.mark.parametrize("exposure", [1.0, 4.0])
def test_passes_add_up(amounts: dict[str, float], exposure: float, gpu: GpuContext) -> None:
    """(diffuse direct + diffuse indirect) * colour + glossy direct + glossy indirect + emission + environment."""
    made = dataclasses.replace(glossy_room(), exposure=exposure)
    with pipeline(gpu, made, scenes.settings(24, bounces=2, **amounts), (40, 30), samples=3, outputs=PASSES) as ready:
        found = {name: ready.film.read(name) for name in PASSES}
    total = (found["diffuse_direct"] + found["diffuse_indirect"]) * found["diffuse_color"]
    total = total + found["glossy_direct"] + found["glossy_indirect"] + found["emission"] + found["environment"]
    np.testing.assert_allclose(total, found["combined"][..., :3], rtol=1e-4, atol=1e-5 * exposure)
    for name in ("diffuse_direct", "diffuse_indirect", "glossy_direct", "glossy_indirect", "emission", "environment"):
        assert found[name].max() > 0.01, f"{name} is black: the sum would not notice it"


def test_geometry_passes(gpu: GpuContext) -> None:
    """An orthographic view from above at height 3: depth 3 - z, positions on the plane, normal up."""
    made = scenes.scene(
        (scenes.plane(2.0, 0.5), scenes.diffuse((0.1, 0.2, 0.3))),
        camera=scenes.camera((0.2, 0.1, 3.0), (0.2, 0.1, 0.0), width=4.0), world=scenes.world(0.5),
        pixel_filter_width=0.0,
    )  # fmt: skip
    with pipeline(gpu, made, scenes.settings(16), (32, 32), samples=2, outputs=PASSES) as ready:
        found = {name: ready.film.read(name) for name in PASSES}
        assert (ready.film.read_mean("depth")[..., 3] == 1.0).all(), "on a screen it is opaque everywhere"
    x = 0.2 + 4.0 * ((np.arange(32) + 0.5) / 32 - 0.5)
    y = 0.1 + 4.0 * ((np.arange(32) + 0.5) / 32 - 0.5)
    up = np.array([0.0, 1.0, 0.0])  # of the camera, as scenes.axes_along turns it
    right = np.cross(up, [0.0, 0.0, 1.0])
    assert right @ [1, 0, 0] == 1
    inside = (np.abs(x)[None, :] < 0.99) & (np.abs(y)[:, None] < 0.99)
    outside = (np.abs(x)[None, :] > 1.01) | (np.abs(y)[:, None] > 1.01)
    np.testing.assert_allclose(found["depth"][inside][:, 0], 2.5, atol=1e-4)
    assert (found["depth"][outside] >= 1e9).all()
    np.testing.assert_allclose(found["normal"][inside], np.broadcast_to([0, 0, 1], (inside.sum(), 3)), atol=1e-3)
    position = found["position"]
    np.testing.assert_allclose(position[..., 0][inside], np.broadcast_to(x, (32, 32))[inside], atol=1e-4)
    np.testing.assert_allclose(position[..., 1][inside], np.broadcast_to(y[:, None], (32, 32))[inside], atol=1e-4)
    np.testing.assert_allclose(
        found["diffuse_color"][inside], np.broadcast_to([0.1, 0.2, 0.3], (inside.sum(), 3)), atol=2e-4
    )
    np.testing.assert_array_equal(found["environment"][outside], 0.5)
    np.testing.assert_array_equal(found["combined"][outside], np.broadcast_to([0.5, 0.5, 0.5, 1.0], (outside.sum(), 4)))


def test_transparent_film_and_holdouts(gpu: GpuContext) -> None:
    """Alpha 0 beside surfaces and where a holdout cuts a hole, 1 on them."""
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse()), (scenes.plane(0.8, 0.2), scenes.diffuse()),
        camera=scenes.camera((0.0, 0.0, 3.0), width=4.0), world=scenes.world(0.5), film_transparent=True,
    )  # fmt: skip
    instances = (made.instances[0], dataclasses.replace(made.instances[1], is_holdout=True))
    made = dataclasses.replace(made, instances=instances, pixel_filter_width=0.0)
    with pipeline(gpu, made, scenes.settings(16), (40, 40), samples=1) as ready:
        alpha = ready.film.read("combined")[..., 3]
    assert alpha[20, 20] == 0.0 and alpha[20, 27] == 1.0 and alpha[20, 2] == 0.0


def test_alpha_of_a_partly_transparent_sheet(gpu: GpuContext) -> None:
    """Alpha 0.25 before a white sky: a quarter is black surface, three quarters sky."""
    sheet = scenes.principled(0.0, Alpha=0.25, Specular_IOR_Level=0.0)
    made = scenes.scene(
        (scenes.plane(2.0), sheet), world=scenes.world(1.0), camera=scenes.camera((0.0, 0.0, 3.0), width=1.0)
    )
    with pipeline(gpu, made, scenes.settings(8), (32, 32), samples=16) as ready:
        assert ready.film.read("combined")[..., :3].mean() == pytest.approx(0.75, abs=0.02)


@pytest.mark.parametrize("kind", ["point", "spot", "sun", "area"])
def test_white_plane_under_each_light(kind: str, gpu: GpuContext) -> None:
    """Lambert's plane at pixels: E / pi, within 1 %."""
    source, irradiance = {
        "point": (scenes.light(LightKind.POINT, 4.0, (0.0, 0.0, 2.0), radius=0.05), 4.0 / (4.0 + 0.05**2)),
        "spot": (scenes.light(LightKind.SPOT, 4.0, (0.0, 0.0, 2.0), spot_angle=1.0, spot_blend=0.2), 1.0),
        "sun": (scenes.light(LightKind.SUN, 4.0, direction=(0.0, 0.6, -0.8), angle=0.01), 3.2),
        "area": (scenes.light(LightKind.AREA, 4.0, (0.0, 0.0, 2.0), size=(0.5, 0.5)), 0.2384),  # Lambert's polygon
    }[kind]
    made = scenes.scene(
        (scenes.plane(2.0), scenes.diffuse(1.0)), lights=[source], camera=scenes.camera((0.0, -0.5, 1.5), width=0.02)
    )
    if kind == "area":
        from blender_tests.passes.test_light import rectangle_form

        corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 0.25 + [0, 0, 2.0]
        irradiance = 4.0 * rectangle_form(corners, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    with pipeline(gpu, made, scenes.settings(8, use_indirect=False), (16, 16), samples=8) as ready:
        assert ready.film.read("combined")[..., :3].mean() == pytest.approx(irradiance / np.pi, rel=0.01)
