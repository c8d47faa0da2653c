# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera, world and film as read from Blender."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from addon.scene import CameraKind, SceneData

bpy = pytest.importorskip("bpy")

Extract = Callable[[], SceneData]


@pytest.fixture
def camera(empty_scene: Any) -> Any:
    obj = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    empty_scene.collection.objects.link(obj)
    empty_scene.camera = obj
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 8, 4
    return obj


def test_orthographic(camera: Any, extract: Extract) -> None:
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    camera.data.clip_start, camera.data.clip_end = 1.0, 11.0
    result = extract().camera
    assert result.kind is CameraKind.ORTHOGRAPHIC
    # 4 m across, 2 m high; depth 1..11 to -1..1
    expected = [[0.5, 0, 0, 0], [0, 1, 0, 0], [0, 0, -0.2, -1.2], [0, 0, 0, 1]]
    assert np.allclose(result.clip_from_camera, expected, atol=1e-6)


def test_perspective_with_shift_and_clip(camera: Any, extract: Extract) -> None:
    camera.data.angle, camera.data.shift_x, camera.data.shift_y = math.radians(90), 0.25, -0.125
    camera.data.clip_start, camera.data.clip_end = 1.0, 3.0
    result = extract().camera
    assert result.kind is CameraKind.PERSPECTIVE
    # A shift of 1 is the longer side of the frame: 2 in clip space across, 4 up.
    expected = [[1, 0, 0.5, 0], [0, 2, -0.5, 0], [0, 0, -2, -3], [0, 0, -1, 0]]
    assert np.allclose(result.clip_from_camera, expected, atol=1e-5)


def test_pixel_aspect_and_sensor_fit(camera: Any, extract: Extract) -> None:
    camera.data.angle = math.radians(90)
    bpy.context.scene.render.pixel_aspect_y = 2.0  # 8 x 4 pixels of 1 x 2: a square frame
    assert np.allclose(np.diag(extract().camera.clip_from_camera)[:2], (1.0, 1.0), atol=1e-5)
    bpy.context.scene.render.pixel_aspect_y = 1.0
    camera.data.sensor_fit, camera.data.sensor_height = "VERTICAL", camera.data.sensor_width
    assert np.allclose(np.diag(extract().camera.clip_from_camera)[:2], (0.5, 1.0), atol=1e-5)


def test_panorama_becomes_perspective(camera: Any, extract: Extract) -> None:
    camera.data.type = "PANO"
    scene = extract()
    assert scene.camera.kind is CameraKind.PERSPECTIVE
    assert len(scene.warnings) == 1 and '"camera"' in scene.warnings[0]


def test_scale_of_the_camera_does_not_count(camera: Any, extract: Extract) -> None:
    camera.location, camera.rotation_euler = (1.0, 2.0, 3.0), (math.pi / 2, 0.0, 0.0)
    camera.scale = (2.0, 3.0, 4.0)
    expected = [[1, 0, 0, 1], [0, 0, -1, 2], [0, 1, 0, 3], [0, 0, 0, 1]]  # looks along world y
    assert np.allclose(extract().camera.world_from_camera, expected, atol=1e-6)
    camera.scale = (0.0, 0.0, 0.0)
    matrix = extract().camera.world_from_camera
    assert np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3))


def test_render_region(camera: Any, extract: Extract) -> None:
    render = bpy.context.scene.render
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1.0
    assert extract().camera.border == (0.0, 0.0, 1.0, 1.0)
    render.use_border = True
    assert extract().camera.border == (0.25, 0.5, 0.75, 1.0)


def test_without_a_camera(camera: Any) -> None:
    from addon.host.extract.scene import ExtractionError, SceneReader

    bpy.context.scene.camera = None
    with pytest.raises(ExtractionError, match=r"no camera.*add one"):
        SceneReader().read(bpy.context.evaluated_depsgraph_get(), (8, 4))


def test_film(camera: Any, extract: Extract) -> None:
    render = bpy.context.scene.render
    render.film_transparent, render.filter_size = True, 2.5
    scene = extract()
    assert scene.film_transparent and scene.pixel_filter_width == 2.5 and scene.exposure == 1.0
    if hasattr(bpy.context.scene, "cycles"):
        bpy.context.scene.cycles.film_exposure = 3.0
        assert extract().exposure == 3.0


def test_world(camera: Any, extract: Extract) -> None:
    assert extract().world is None
    bpy.context.scene.world = bpy.data.worlds.new("day")
    world = extract().world
    assert world is not None and world.name == "day"
    bpy.context.view_layer.world_override = bpy.data.worlds.new("night")
    world = extract().world
    assert world is not None and world.name == "night"


def test_an_empty_scene(camera: Any, extract: Extract) -> None:
    scene = extract()
    assert scene.meshes == scene.instances == scene.materials == scene.lights == scene.warnings == ()
