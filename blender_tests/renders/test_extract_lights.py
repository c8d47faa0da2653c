# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights as read from Blender, against numbers worked out on paper."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from addon.scene import AreaShape, LightData, LightKind, RayVisibility, SceneData

bpy = pytest.importorskip("bpy")

Extract = Callable[[], SceneData]


@pytest.fixture(autouse=True)
def _scene(empty_scene: Any) -> None:
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    empty_scene.collection.objects.link(camera)
    empty_scene.camera = camera
    empty_scene.render.resolution_x = empty_scene.render.resolution_y = 8


def add_light(kind: str, **properties: Any) -> Any:
    light = bpy.data.lights.new("light", kind)
    for name, value in properties.items():
        setattr(light, name, value)
    obj = bpy.data.objects.new("light", light)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def only(scene: SceneData) -> LightData:
    (light,) = scene.lights
    return light


def test_point(extract: Extract) -> None:
    obj = add_light("POINT", energy=100.0, shadow_soft_size=0.25, color=(1.0, 0.5, 0.0), use_soft_falloff=False)
    obj.location, obj.scale = (1.0, 2.0, 3.0), (4.0, 4.0, 4.0)
    light = only(extract())
    assert light.kind is LightKind.POINT
    assert np.allclose(light.intensity, (7.957747, 3.978874, 0.0), rtol=1e-5)
    assert light.position.tolist() == [1.0, 2.0, 3.0]
    assert light.radius == 0.25  # the scale of the object does not count
    assert not light.soft_falloff and light.casts_shadow


def test_point_without_normalize(extract: Extract) -> None:
    add_light("POINT", energy=100.0, shadow_soft_size=0.5, normalize=False)
    assert np.allclose(only(extract()).intensity, 25.0)


def test_exposure_and_temperature(extract: Extract) -> None:
    add_light("POINT", energy=4.0 * math.pi, exposure=1.0, use_temperature=True, temperature=3000.0)
    assert np.allclose(only(extract()).intensity, (2 * 1.7708, 2 * 0.8443, 2 * 0.2722), rtol=1e-3)


def test_spot(extract: Extract) -> None:
    obj = add_light("SPOT", energy=100.0, spot_size=math.radians(50), spot_blend=0.25, shadow_soft_size=0.0)
    obj.rotation_euler, obj.scale = (0.0, math.pi / 2, 0.0), (1.0, 2.0, 3.0)
    light = only(extract())
    assert light.kind is LightKind.SPOT
    assert np.allclose(light.intensity, 7.957747, rtol=1e-5)
    assert light.spot_angle == pytest.approx(math.radians(50)) and light.spot_blend == 0.25
    assert np.allclose(light.spot_scale, (1.0, 2.0, 3.0))
    assert np.allclose(light.axes, ((0, 0, -1), (0, 1, 0), (1, 0, 0)), atol=1e-6)  # z points along world x


def test_sun(extract: Extract) -> None:
    add_light("SUN", energy=3.0, angle=math.radians(10))
    light = only(extract())
    assert light.kind is LightKind.SUN
    assert np.allclose(light.intensity, 3.0)
    assert light.angle == pytest.approx(math.radians(10))


def test_sun_without_normalize(extract: Extract) -> None:
    add_light("SUN", energy=2.0, angle=math.radians(60), normalize=False)
    assert np.allclose(only(extract()).intensity, 1.5707963, rtol=1e-5)


@pytest.mark.parametrize(
    ("shape", "expected_shape", "expected_size", "radiance"),
    [
        # size 1 x 2, object scale 2 x 3; 10 W / (pi A)
        ("SQUARE", AreaShape.RECTANGLE, (2.0, 3.0), 10 / math.pi / 6),
        ("RECTANGLE", AreaShape.RECTANGLE, (2.0, 6.0), 10 / math.pi / 12),
        ("DISK", AreaShape.ELLIPSE, (2.0, 3.0), 10 / math.pi / (1.5 * math.pi)),
        ("ELLIPSE", AreaShape.ELLIPSE, (2.0, 6.0), 10 / math.pi / (3 * math.pi)),
    ],
)
def test_area_shapes(
    extract: Extract, shape: str, expected_shape: AreaShape, expected_size: tuple[float, float], radiance: float
) -> None:
    obj = add_light("AREA", energy=10.0, shape=shape, size=1.0, size_y=2.0)
    obj.scale = (2.0, 3.0, 5.0)
    bpy.context.view_layer.update()
    light = only(extract())
    assert light.kind is LightKind.AREA and light.shape is expected_shape
    assert light.size == pytest.approx(expected_size)
    assert np.allclose(light.intensity, radiance, rtol=1e-5)
    blender_area = obj.data.area(matrix_world=obj.matrix_world)
    assert np.allclose(light.intensity * math.pi * blender_area, 10.0, rtol=1e-5)


def test_area_without_normalize_and_with_spread(extract: Extract) -> None:
    add_light("AREA", energy=math.pi, size=0.1, spread=math.pi / 2, normalize=False)
    light = only(extract())
    assert np.allclose(light.intensity, 4.6597924, rtol=1e-5)
    assert light.spread == pytest.approx(math.pi / 2)


def test_portals_give_no_light(extract: Extract) -> None:
    obj = add_light("AREA", energy=10.0)
    if not hasattr(obj.data, "cycles"):
        pytest.skip("portals belong to Cycles, which this Blender lacks")
    obj.data.cycles.is_portal = True
    scene = extract()
    assert scene.lights == () and scene.warnings == ()


def test_shadow_and_ray_visibility(extract: Extract) -> None:
    obj = add_light("POINT", energy=10.0, use_shadow=False)
    obj.visible_camera, obj.visible_glossy = True, False  # Blender hides new lights from the camera
    light = only(extract())
    assert not light.casts_shadow
    assert light.visibility == RayVisibility.ALL & ~RayVisibility.GLOSSY


def test_instanced_and_hidden_lights(extract: Extract) -> None:
    collection = bpy.data.collections.new("lamps")
    obj = add_light("POINT", energy=10.0)
    bpy.context.scene.collection.objects.unlink(obj)
    collection.objects.link(obj)
    for x in (1.0, 2.0):
        empty = bpy.data.objects.new("empty", None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (x, 0.0, 0.0)
        bpy.context.scene.collection.objects.link(empty)
    add_light("POINT", energy=10.0).hide_render = True
    assert sorted(light.position[0] for light in extract().lights) == [1.0, 2.0]


def test_flat_scale_does_not_matter_to_lights(extract: Extract) -> None:
    add_light("POINT", energy=4.0 * math.pi).scale = (0.0, 0.0, 0.0)
    add_light("AREA", energy=math.pi, size=1.0).scale = (1.0, 1.0, 0.0)
    lights = extract().lights
    assert len(lights) == 2
    for light in lights:
        assert np.allclose(light.intensity, 1.0)
        assert np.allclose(light.axes, np.eye(3))


def test_unusable_lights_are_named(extract: Extract) -> None:
    for name, properties in {
        "negative": {"energy": -5.0},
        "not a number": {"energy": float("nan")},
        "infinite": {"energy": float("inf")},
    }.items():
        add_light("POINT", **properties).name = name
    add_light("AREA", energy=5.0, size=0.0).name = "no area"
    add_light("POINT", energy=0.0).name = "off"
    scene = extract()
    assert scene.lights == ()
    for name in ("negative", "not a number", "no area"):
        assert sum(f'"{name}"' in w for w in scene.warnings) == 1, (name, scene.warnings)
    assert not any('"off"' in w for w in scene.warnings)


def use_nodes(light: Any) -> Any:
    """The light's node tree, with an Emission at the output, in any version."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        light.use_nodes = True
    return light.node_tree


def test_nodes_multiply(extract: Extract) -> None:
    obj = add_light("SUN", energy=2.0, color=(1.0, 1.0, 0.5))
    tree = use_nodes(obj.data)
    emission = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    emission.inputs["Color"].default_value = (0.5, 1.0, 1.0, 1.0)
    value, reroute = tree.nodes.new("ShaderNodeValue"), tree.nodes.new("NodeReroute")
    value.outputs[0].default_value = 3.0
    tree.links.new(value.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], emission.inputs["Strength"])
    scene = extract()
    assert np.allclose(only(scene).intensity, (3.0, 6.0, 3.0))
    assert scene.warnings == ()


def test_textures_in_lights_are_named(extract: Extract) -> None:
    obj = add_light("POINT", energy=4.0 * math.pi)
    tree = use_nodes(obj.data)
    emission = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], emission.inputs["Color"])
    scene = extract()
    assert np.allclose(only(scene).intensity, 1.0)
    assert len(scene.warnings) == 1 and '"light"' in scene.warnings[0] and noise.name in scene.warnings[0]


def test_unconnected_light_nodes_give_no_light(extract: Extract) -> None:
    obj = add_light("POINT", energy=10.0)
    use_nodes(obj.data).links.clear()
    scene = extract()
    assert scene.lights == () and len(scene.warnings) == 1


def test_a_viewport_may_leave_lights_out() -> None:
    """As "Scene Lights" says in its shading; and it says that it has no studio light in the world's place."""
    from addon.host.extract.scene import SceneReader

    bpy.ops.wm.read_homefile(use_factory_startup=True)
    spaces = [area.spaces[0] for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
    shading = spaces[0].shading
    reader = SceneReader()

    def read() -> Any:
        return reader.read(bpy.context.evaluated_depsgraph_get(), (64, 36), viewport=spaces[0])

    shading.use_scene_lights_render = shading.use_scene_world_render = True
    assert len(read().lights) == 1 and not read().warnings
    shading.use_scene_lights_render = shading.use_scene_world_render = False
    found = read()
    assert not found.lights and any("studio light" in text for text in found.warnings) and found.world is not None
    shading.use_scene_lights_render = shading.use_scene_world_render = True
    assert len(read().lights) == 1 and not read().warnings
