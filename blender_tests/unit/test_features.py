# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene needs, decided from the scene and the settings alone."""

from __future__ import annotations

from typing import Any

import pytest

from addon.features import Features
from addon.scene import LightKind, RayVisibility, SceneData
from addon.settings import Settings
from blender_tests.passes import scenes

PLAIN: dict[str, Any] = dict.fromkeys(
    (
        "smooth_shading", "emission", "small_emitters", "transparency", "specular", "transmission", "world",
        "concentrated_world",
    ),
    False,
) | {"diffuse": True, "least_roughness": 1.0}


def features(made: SceneData, settings: Settings | None = None, **has: Any) -> set[str]:
    """Names of the features; sharing between pixels, which follows gathering, has a test of its own."""
    return all_features(made, settings, **has) - {"reconstruction"}


def all_features(made: SceneData, settings: Settings | None = None, **has: Any) -> set[str]:
    return set(Features.from_scene(made, settings or Settings(), **(PLAIN | has)).names)


def test_what_is_gathered_or_reflected_is_shared() -> None:
    lit = room(lights=[SUN])
    assert "reconstruction" in all_features(lit)
    assert "reconstruction" in all_features(lit, Settings(use_indirect=False), specular=True)
    for settings in (Settings(use_reconstruction=False), Settings(use_indirect=False), Settings(gather_mode="CONES")):
        assert "reconstruction" not in all_features(lit, settings)


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
        ({}, {}, {"geometry", "lights", "direct", "diffuse_gather", "radiance", "links", "guides", "bounces"}),
        ({"use_indirect": False}, {}, {"geometry", "lights", "direct"}),
        ({"indirect_amount": 0.0}, {}, {"geometry", "lights", "direct"}),
        ({"use_direct": False}, {}, {"geometry", "lights", "diffuse_gather", "radiance", "links", "guides", "bounces"}),
        ({"bounces": 0}, {}, {"geometry", "lights", "direct", "diffuse_gather", "radiance"}),
        (
            {}, {"specular": True},
            {"geometry", "lights", "direct", "diffuse_gather", "radiance", "links", "guides", "bounces", "glossy"},
        ),
        (
            {"use_specular": False}, {"specular": True},
            {"geometry", "lights", "direct", "diffuse_gather", "radiance", "links", "guides", "bounces"},
        ),
        (
            {"gather_mode": "CONES"}, {},
            {"geometry", "lights", "direct", "diffuse_gather", "radiance", "links", "bounces", "gather_cones", "cones"},
        ),
        (
            {"shadow_mode": "CONE", "use_indirect": False}, {},
            {"geometry", "lights", "direct", "radiance", "links", "bounces", "shadow_cones", "cones"},
        ),
        ({"shadow_mode": "CONE", "use_indirect": False, "use_shadows": False}, {}, {"geometry", "lights", "direct"}),
    ],
)  # fmt: skip
def test_sun_lit_room(settings: dict[str, Any], has: dict[str, bool], expected: set[str]) -> None:
    assert features(room(lights=[SUN]), Settings(**settings), **has) == expected


def test_light_is_kept_where_something_takes_it_over() -> None:
    lit = room(lights=[SUN])
    assert "keeps_light" in features(lit, Settings(gather_interval=2)) & features(lit, Settings(reuse_frames=True))
    assert "keeps_light" not in features(lit)
    assert "keeps_reflections" not in features(lit, Settings(gather_interval=2))  # there are none
    assert "keeps_reflections" in features(lit, Settings(gather_interval=2, use_indirect=False), specular=True)
    assert "keeps_reflections" not in features(lit, specular=True)
    assert "keeps_light" not in features(lit, Settings(gather_interval=2, reuse_frames=True, use_indirect=False))


def test_only_sharp_reflections_are_followed() -> None:
    def follows(roughness: float, **settings: Any) -> bool:
        return "follows_glossy" in features(
            room(lights=[SUN]), Settings(**settings), specular=True, least_roughness=roughness
        )

    assert follows(0.0) and follows(0.3) and not follows(0.5)
    assert follows(0.5, specular_aperture=0.1)
    assert not follows(0.0, glossy_layers=0) and not follows(0.0, use_specular=False)


def test_light_without_lights() -> None:
    """A world alone lights a room."""
    expected = {"geometry", "world", "diffuse_gather", "radiance", "links", "guides", "bounces"}
    assert features(room(), world=True) == expected
    assert "links" in features(room(), Settings(bounces=0), world=True)


@pytest.mark.parametrize(
    ("settings", "added"),
    [
        ({}, {"draws_world_at_pixels", "draws_world_at_faces", "direct"}),
        ({"use_direct": False}, {"draws_world_at_faces"}),
        ({"gather_mode": "CONES"}, {"draws_world_at_faces"}),
        ({"gather_mode": "OCCLUSION"}, set()),
        ({"use_indirect": False}, set()),
    ],
)
def test_concentrated_world(settings: dict[str, Any], added: set[str]) -> None:
    before = features(room(), Settings(**settings), world=True)
    after = features(room(), Settings(**settings), world=True, concentrated_world=True)
    assert after - before == added
    assert "guides" not in after or "draws_world_at_pixels" not in added  # what rays still find of it is even
    assert "draws_world_at_pixels" not in features(scenes.scene(), world=True, concentrated_world=True)


GATHERED = {"geometry", "emission", "diffuse_gather", "radiance", "links", "bounces", "gathers_emission"}
DRAWN = {"direct", "draws_emitters_at_pixels"}


@pytest.mark.parametrize(
    ("settings", "has", "expected"),
    [
        ({}, {}, GATHERED),
        ({}, {"small_emitters": True}, GATHERED | DRAWN | {"draws_emitters_at_faces", "guides"}),
        # Rays alone do not find all of it: they end early, are cones, or are not sent.
        ({"max_distance": 1.0}, {}, GATHERED | DRAWN | {"guides"}),
        (
            {"gather_mode": "CONES"}, {},
            (GATHERED - {"gathers_emission"}) | DRAWN | {"gather_cones", "cones"},
        ),
        (
            {"gather_mode": "OCCLUSION"}, {},
            (GATHERED - {"gathers_emission", "radiance", "links", "bounces"}) | DRAWN | {"gather_occlusion"},
        ),
        ({"use_indirect": False}, {}, {"geometry", "emission"} | DRAWN),
        ({"bounces": 0}, {}, GATHERED - {"bounces"}),
        # Light straight from emitters is direct light.
        (
            {"use_direct": False}, {"small_emitters": True},
            (GATHERED - {"gathers_emission"}) | {"draws_emitters_at_faces", "guides"},
        ),
        ({}, {"specular": True}, GATHERED | {"glossy", "reflects_emission"}),
        ({}, {"specular": True, "diffuse": False}, (GATHERED - {"diffuse_gather", "gathers_emission"})
         | {"glossy", "reflects_emission"}),
    ],
)  # fmt: skip
def test_room_with_emitters(settings: dict[str, Any], has: dict[str, bool], expected: set[str]) -> None:
    assert features(room(), Settings(**settings), emission=True, **has) == expected


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
