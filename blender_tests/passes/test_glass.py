# SPDX-License-Identifier: GPL-3.0-or-later
"""Glass bends, reflects totally, loses nothing and is not there when its index is 1; coats keep all light."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.materials.graph import MaterialData
from addon.scene import LightKind
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline
from blender_tests.passes.test_reflect import picture, standing, textured


def glass(ior: float = 1.5, roughness: float = 0.0, color: float = 1.0) -> MaterialData:
    return material(
        node("G", "BsdfGlass", Color=(color, color, color, 1.0), Roughness=roughness, IOR=ior), surface="G.BSDF",
        name="glass",
    )  # fmt: skip


def test_glass_of_index_1_is_invisible(gpu: GpuContext) -> None:
    """A box of it in front of a textured wall in the sun: the picture without the box, pixel by pixel."""
    wall = (scenes.plane(2.0), textured(), standing(0.0, 1.0, 0.0))
    box = (scenes.box((-0.6, -0.3, -0.6), (0.6, 0.3, 0.6)), glass(1.0))
    found = []
    for things in ([wall], [wall, box]):
        made = scenes.scene(
            *things, lights=[scenes.light(LightKind.SUN, 3.0, direction=(0.2, 1.0, -0.3))],
            camera=scenes.camera((0.0, -2.0, 0.0), (0.0, 1.0, 0.0), angle=0.47), pixel_filter_width=0.0,
        )  # fmt: skip
        found.append(picture(gpu, made, scenes.settings(12, use_indirect=False, bounces=0), (48, 48), 1))
    assert found[0].std() > 0.05
    assert np.isclose(found[1], found[0], rtol=2e-3, atol=1e-4).all(axis=-1).mean() > 0.99


def at_angle(degrees: float, ior: float, *, inside: bool, radiance: Any, depth: float = 1.0) -> Any:
    """A camera at an angle to a sheet of glass at z = 0, outside (above) or inside (below).

    The other side ends in a plane with ``radiance`` at a distance of ``depth``.
    """
    a, side = np.radians(degrees), -1.0 if inside else 1.0
    eye = np.array([-np.sin(a), 0.0, side * np.cos(a)])
    turned = np.diag([1.0, -1.0, -1.0, 1.0]) if inside else np.eye(4)
    return scenes.scene(
        (scenes.plane(8.0), glass(ior)),
        (scenes.plane(40.0), radiance, scenes.at(0.0, 0.0, -side * depth) @ turned),
        world=scenes.world((0.0, 0.0, 1.0)), camera=scenes.camera(eye, (0.0, 0.0, 0.0), width=1e-4),
    )  # fmt: skip


@pytest.mark.parametrize("degrees", [10.0, 45.0, 75.0])
def test_light_is_bent_by_snells_law(degrees: float, gpu: GpuContext) -> None:
    """Red is where the plane below was met, in metres from the axis; weighed by what was not reflected."""
    place = material(
        node("G", "NewGeometry"), node("S", "SeparateXYZ", Vector="G.Position"),
        node("C", "CombineXYZ", X="S.X", Y=1.0, Z=0.0), node("E", "Emission", Color="C.Vector", Strength=1.0),
        surface="E.Emission",
    )  # fmt: skip
    found = picture(gpu, at_angle(degrees, 1.5, inside=False, radiance=place), scenes.settings(24), (8, 8), 32)
    red, green, _ = found.mean(axis=(0, 1))
    bent = np.arcsin(np.sin(np.radians(degrees)) / 1.5)
    assert red / green == pytest.approx(np.tan(bent), abs=2e-3)


def dielectric(degrees: float, ior: float) -> float:
    """Fresnel's equations."""
    cosine = np.cos(np.radians(degrees))
    squared = 1.0 - (1.0 - cosine**2) / ior**2
    if squared <= 0.0:
        return 1.0
    inside = np.sqrt(squared)
    across, along = (cosine - ior * inside) / (cosine + ior * inside), (ior * cosine - inside) / (ior * cosine + inside)
    return float(0.5 * (across**2 + along**2))


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("degrees", [0.5, 35.0, 40.0, 45.0, 70.0])
def test_fresnel_and_total_reflection(degrees: float, inside: bool, gpu: GpuContext) -> None:
    """Blue is what was reflected (the sky on the viewer's side), red what went through. From inside, nothing
    does beyond 41.8 degrees."""
    made = at_angle(degrees, 1.5, inside=inside, radiance=scenes.emission((1.0, 0.0, 0.0)))
    red, _, blue = picture(gpu, made, scenes.settings(24), (16, 16), 64).mean(axis=(0, 1))
    expected = dielectric(degrees, 1.0 / 1.5 if inside else 1.5)
    assert blue == pytest.approx(expected, abs=0.01)
    assert red == pytest.approx(1.0 - expected, abs=0.01)
    if inside and degrees > 41.9:
        assert red == 0.0


@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.7])
@pytest.mark.parametrize("ior", [1.1, 1.5, 2.2])
def test_a_white_glass_ball_in_a_white_furnace_is_invisible(ior: float, roughness: float, gpu: GpuContext) -> None:
    made = scenes.scene(
        (scenes.sphere(1.0, 32), glass(ior, roughness)), world=scenes.world(1.0), camera=scenes.camera(angle=0.5)
    )
    found = picture(gpu, made, scenes.settings(24, glossy_layers=32), (32, 32), 32)
    assert found.mean() == pytest.approx(1.0, abs=0.015)


@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.6])
@pytest.mark.parametrize("coat", [0.5, 1.0])
def test_a_coated_white_ball_in_a_white_furnace_is_invisible(coat: float, roughness: float, gpu: GpuContext) -> None:
    """What the coat reflects is missing below it, no more and no less."""
    white = scenes.principled(1.0, Roughness=0.5, Coat_Weight=coat, Coat_Roughness=roughness, Coat_IOR=1.8)
    made = scenes.scene((scenes.sphere(1.0, 32), white), world=scenes.world(1.0), camera=scenes.camera(angle=0.3))
    found = picture(gpu, made, scenes.settings(24), (16, 16), 128)
    assert found.mean() == pytest.approx(1.0, abs=0.02)


def test_light_goes_through_a_pane(gpu: GpuContext) -> None:
    """The sun above a pane of index 1.5 lights the floor with what two surfaces let through: about .85 to .92."""
    pane = scenes.box((-3.0, -3.0, 0.9), (3.0, 3.0, 1.0))
    camera = scenes.camera((0.0, -0.8, 0.6), (0.0, 0.0, 0.0), angle=0.3)
    sun = scenes.light(LightKind.SUN, np.pi, direction=(0.0, 0.0, -1.0))
    for things, low, high in (([], 0.99, 1.01), ([(pane, glass())], 0.75, 0.95)):
        made = scenes.scene((scenes.plane(6.0), scenes.diffuse(1.0)), *things, lights=[sun], camera=camera)
        found = picture(gpu, made, scenes.settings(24, use_indirect=False), (16, 16), 64).mean()
        assert low < found < high


def test_glass_alone_needs_its_features(gpu: GpuContext) -> None:
    with pipeline(gpu, scenes.scene((scenes.sphere(), glass()), world=scenes.world(1.0)), scenes.settings(12)) as ready:
        assert ready.features is not None and ready.features.has_transmission and ready.features.follows_glossy
        assert "cell opacities" in ready.statistics()["memory"]
    mirror = scenes.principled(1.0, Metallic=1.0, Roughness=0.1)
    with pipeline(gpu, scenes.scene((scenes.sphere(), mirror), world=scenes.world(1.0)), scenes.settings(12)) as ready:
        assert ready.features is not None and not ready.features.has_transmission
        assert "cell opacities" not in ready.statistics()["memory"]


@pytest.mark.parametrize("roughness", [0.2, 0.8])
def test_a_sun_behind_rough_glass(roughness: float, gpu: GpuContext) -> None:
    """Seen from inside: points on the sun and bent rays together bring what rays alone do, with less noise."""
    sun = scenes.light(LightKind.SUN, 3.0, direction=(0.3, 0.0, -1.0), angle=0.4)
    made = scenes.scene(
        (scenes.plane(0.5), glass(1.5, roughness)), lights=[sun],
        camera=scenes.camera((0.1, 0.0, -1.0), (0.0, 0.0, 0.0), width=0.1),
    )  # fmt: skip
    alone = {"use_reconstruction": False}  # sharing between pixels hides the noise
    both = picture(gpu, made, scenes.settings(12, **alone), (24, 24), 64)
    rays = picture(gpu, made, scenes.settings(12, **alone, use_direct=False), (24, 24), 64)
    assert both.mean() == pytest.approx(rays.mean(), rel=0.02)
    if roughness > 0.5:
        assert both.std() < 0.5 * rays.std()


def test_cones_to_lamps_behind_glass_leave_on_its_far_side(gpu: GpuContext) -> None:
    """A lamp outside of dark, frosted glass, from inside: no shadow of the surface on itself, which took its share."""
    made = scenes.scene(
        (scenes.plane(4.0), glass(1.5, 0.4, 0.3)),
        lights=[scenes.light(LightKind.POINT, 10.0, (0.0, 0.0, 1.5))],
        camera=scenes.camera((0.0, 0.0, -1.0), (0.0, 0.0, 0.0), width=0.1),
    )
    found = [
        picture(gpu, made, scenes.settings(16, use_indirect=False, **shadows), (8, 8), 16).mean()
        for shadows in ({"use_shadows": False}, {"shadow_mode": "CONE"})
    ]
    assert found[0] > 0.0
    assert found[1] == pytest.approx(found[0], rel=0.02)
