# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene needs, decided from the scene and the settings alone."""

from __future__ import annotations

from typing import Any

import pytest

from addon.features import Features
from addon.scene import LightKind, RayVisibility, SceneData
from addon.settings import Settings
from blender_tests.passes import scenes

PLAIN: dict[str, Any] = {
    "diffuse": True, "emission": False, "transparency": False, "specular": False, "least_roughness": 1.0, "world": False
}  # fmt: skip


def features(made: SceneData, settings: Settings | None = None, **has: Any) -> set[str]:
    return set(Features.from_scene(made, settings or Settings(), **(PLAIN | has)).names)


def room(**more: Any) -> SceneData:
    return scenes.scene((scenes.plane(), scenes.diffuse()), **more)


SUN = scenes.light(LightKind.SUN, 1.0)


def test_nothing_needs_nothing() -> None:
    assert features(scenes.scene()) == set()
    assert features(room()) == {"geometry"}
    assert features(scenes.scene(), world=True) == {"world"}


@pytest.mark.parametrize(
    ("settings", "has", "expected"),
    [
        ({}, {}, {"geometry", "lights", "direct", "diffuse_gather", "reconstruction", "radiance", "bounces"}),
        ({"use_indirect": False}, {}, {"geometry", "lights", "direct"}),
        ({"use_reconstruction": False}, {}, {"geometry", "lights", "direct", "diffuse_gather", "radiance", "bounces"}),
        ({"indirect_amount": 0.0}, {}, {"geometry", "lights", "direct"}),
        ({"use_direct": False}, {}, {"geometry", "lights", "diffuse_gather", "reconstruction", "radiance", "bounces"}),
        ({"bounces": 0}, {}, {"geometry", "lights", "direct", "diffuse_gather", "reconstruction", "radiance"}),
        (
            {}, {"specular": True},
            {"geometry", "lights", "direct", "diffuse_gather", "reconstruction", "radiance", "bounces", "glossy"},
        ),
        (
            {"use_specular": False}, {"specular": True},
            {"geometry", "lights", "direct", "diffuse_gather", "reconstruction", "radiance", "bounces"},
        ),
        (
            {"gather_mode": "OCCLUSION"}, {},
            {"geometry", "lights", "direct", "diffuse_gather", "reconstruction", "gather_occlusion"},
        ),
        (
            {"gather_mode": "CONES"}, {},
            {"geometry", "lights", "direct", "diffuse_gather", "radiance", "bounces", "gather_cones", "cones"},
        ),
        (
            {"shadow_mode": "CONE", "use_indirect": False}, {},
            {"geometry", "lights", "direct", "radiance", "bounces", "shadow_cones", "cones"},
        ),
        ({"shadow_mode": "CONE", "use_indirect": False, "use_shadows": False}, {}, {"geometry", "lights", "direct"}),
    ],
)  # fmt: skip
def test_sun_lit_room(settings: dict[str, Any], has: dict[str, bool], expected: set[str]) -> None:
    assert features(room(lights=[SUN]), Settings(**settings), **has) == expected


def test_only_sharp_reflections_are_followed() -> None:
    def follows(roughness: float, **settings: Any) -> bool:
        return "follows_glossy" in features(
            room(lights=[SUN]), Settings(**settings), specular=True, least_roughness=roughness
        )

    assert follows(0.0) and follows(0.3) and not follows(0.5)
    assert follows(0.5, specular_aperture=0.1)
    assert not follows(0.0, glossy_layers=0) and not follows(0.0, use_specular=False)


def test_light_without_lights() -> None:
    """Emission or a world alone light a room."""
    for name in ("emission", "world"):
        expected = {"geometry", name, "diffuse_gather", "reconstruction", "radiance", "bounces"}
        assert features(room(), **{name: True}) == expected


@pytest.mark.parametrize(
    ("light", "visible"),
    [
        (SUN, False),
        (scenes.light(LightKind.SUN, 1.0, angle=0.1), True),
        (scenes.light(LightKind.POINT, 1.0), False),
        (scenes.light(LightKind.POINT, 1.0, radius=0.1), True),
        (scenes.light(LightKind.AREA, 1.0), True),
        (scenes.light(LightKind.AREA, 1.0, visibility=RayVisibility.ALL & ~RayVisibility.CAMERA), False),
    ],
)
def test_lights_that_are_seen(light: Any, visible: bool) -> None:
    assert ("visible_lights" in features(room(lights=[light]))) is visible
