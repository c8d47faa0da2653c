# SPDX-License-Identifier: GPL-3.0-or-later
"""Of many lights a part is asked for its shadows, at pixels as at voxels: their sum is what all together bring."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from addon.gpu import interface
from addon.gpu.context import GpuContext
from addon.scene import LightData, LightKind, RayVisibility
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, radiance, sample

GROUP = interface.LIGHT_PICKS


def lights_of_all_kinds(count: int) -> list[LightData]:
    """Of all kinds, sizes and colours, some brighter by far, some behind a roof, some that diffuse surfaces or mirrors
    do not see, some that are off."""
    rng = np.random.default_rng(3)
    kinds = (LightKind.POINT, LightKind.AREA, LightKind.SUN, LightKind.SPOT)
    made = []
    for index in range(count):
        kind = kinds[index % 4]
        more: dict = {"direction": (*rng.uniform(-0.5, 0.5, 2).tolist(), -1.0)}
        if kind != LightKind.SUN:
            more["position"] = (*rng.uniform(-1.0, 1.0, 2).tolist(), float(rng.uniform(0.7, 1.5)))
        if kind == LightKind.AREA:
            more["size"] = (0.3, 0.1)
        if kind == LightKind.SPOT:
            more |= {"spot_angle": 1.2, "spot_blend": 0.3, "radius": 0.02}
        if kind == LightKind.POINT:
            more |= {"radius": 0.05 * (index % 8), "soft_falloff": index % 3 == 0}
        hidden = {5: RayVisibility.DIFFUSE, 6: RayVisibility.GLOSSY}.get(index % 7, RayVisibility(0))
        power = 0.0 if index % 11 == 3 else 10.0 ** rng.uniform(-2.0, 0.0) * (0.2 if kind == LightKind.SUN else 1.0)
        color = tuple((power * rng.uniform(0.2, 1.0, 3)).tolist())
        more |= {"visibility": RayVisibility.ALL & ~RayVisibility.CAMERA & ~hidden, "casts_shadow": index % 9 != 0}
        made.append(scenes.light(kind, color, **more))
    return made


def picture(gpu: GpuContext, lights: Sequence[LightData], passes: int, seed: int = 0, **inputs: float) -> np.ndarray:
    """(16, 16, 3) direct light on a floor under a roof that shades a part of it."""
    floor, roof = scenes.plane(2.0), scenes.box((-0.3, -0.3, 0.2), (0.3, 0.3, 0.4))
    surface = scenes.principled(0.6, **inputs) if inputs else scenes.diffuse(0.8)
    view = scenes.camera((0.0, -1.6, 1.0), (0.0, 0.0, 0.0))
    made = scenes.scene((floor, surface), (roof, scenes.diffuse(0.5)), lights=lights, camera=view)
    chosen = scenes.settings(16, seed=seed, samples=passes, use_indirect=False)
    with pipeline(gpu, made, chosen, size=(16, 16), samples=passes) as ready:
        return ready.film.read("combined")[..., :3].astype(np.float64)


@pytest.mark.parametrize("inputs", [{}, {"Metallic": 1.0, "Roughness": 0.3}], ids=["diffuse", "metal"])
def test_many_lights_at_pixels_bring_what_they_bring_in_groups(gpu: GpuContext, inputs: dict) -> None:
    lights = lights_of_all_kinds(3 * GROUP)
    groups = sum(picture(gpu, lights[i : i + GROUP], 128, seed=1, **inputs) for i in range(0, len(lights), GROUP))
    many = picture(gpu, lights, 128, seed=2, **inputs)
    np.testing.assert_allclose(many.mean(axis=(0, 1)), groups.mean(axis=(0, 1)), rtol=0.01)
    assert np.abs(many - groups).mean() < 0.03 * groups.mean()


def test_few_lights_are_all_asked(gpu: GpuContext) -> None:
    """As many as are asked anyway: a light that is off changes nothing, bit for bit; one more, and a part is asked."""
    lights = lights_of_all_kinds(GROUP - 1)
    off = scenes.light(LightKind.POINT, 0.0, (0.0, 0.0, 1.0))
    one = picture(gpu, lights, 1)
    np.testing.assert_array_equal(picture(gpu, [*lights, off], 1), one)
    assert not np.array_equal(picture(gpu, [*lights, off, off], 1), one)


def test_a_light_that_outshines_all_others_is_free_of_noise(gpu: GpuContext) -> None:
    """A point among 255 that bring nothing next to it: each pass asks it, once, and counts it as it is."""
    bright = scenes.light(LightKind.POINT, 5.0, (0.3, 0.2, 1.2))
    dim = [scenes.light(LightKind.POINT, 1e-9, (0.01 * k - 1.0, 0.0, 1.0)) for k in range(255)]
    many = picture(gpu, [*dim[:100], bright, *dim[100:]], 1)
    np.testing.assert_allclose(many, picture(gpu, [bright], 1), rtol=1e-4)


def test_lights_that_are_all_off(gpu: GpuContext) -> None:
    assert picture(gpu, [scenes.light(LightKind.POINT, 0.0, (0.0, 0.0, 1.0))] * (GROUP + 1), 1).max() == 0.0


def test_one_pass_is_right_on_average_over_pixels(gpu: GpuContext) -> None:
    """Equal lights over an open floor: what is picked stands for all, with hardly any noise where nothing is shaded."""
    places = [(x, y, 1.5) for x, y in np.random.default_rng(1).uniform(-1.0, 1.0, (256, 2))]
    lights = [scenes.light(LightKind.POINT, 0.05, place) for place in places]
    made = scenes.scene((scenes.plane(2.0), scenes.diffuse(0.8)), lights=lights)
    all_asked = scenes.settings(16, use_indirect=False, use_shadows=False)
    with pipeline(gpu, made, all_asked, size=(16, 16), samples=1) as ready:
        expected = ready.film.read("combined")[..., :3]
    with pipeline(gpu, made, scenes.settings(16, use_indirect=False), size=(16, 16), samples=1) as ready:
        found = ready.film.read("combined")[..., :3]
    np.testing.assert_allclose(found.mean(), expected.mean(), rtol=0.005)
    lit = expected[..., 0] > 0.5 * expected.max()
    assert np.abs(found - expected)[lit].mean() < 0.07 * expected[lit].mean()


def test_repeated_picks_of_a_light_are_not_one_point(gpu: GpuContext) -> None:
    """An area light that outshines all others gets several points at each voxel face, as it does alone: its half shadow
    has as little noise."""
    floor, roof, white = scenes.plane(2.0), scenes.box((-0.3, -0.3, 0.2), (0.3, 0.3, 0.4)), scenes.diffuse(0.8)
    area = scenes.light(LightKind.AREA, 5.0, (0.2, 0.0, 1.5), size=(0.8, 0.8))
    dim = [scenes.light(LightKind.POINT, 1e-9, (0.0, 0.0, 1.0))] * GROUP

    def noise(lights: list[LightData]) -> float:
        found = []
        for seed in range(4):
            made = scenes.scene((floor, white), (roof, white), lights=lights)
            with pipeline(gpu, made, scenes.settings(32, bounces=0, seed=seed), samples=0) as ready:
                sample(ready, 0)
                found.append(radiance(ready)[:, 0])
        return float(np.std(found, axis=0).mean())

    assert noise([area, *dim]) < 1.2 * noise([area])
