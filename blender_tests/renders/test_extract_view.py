# SPDX-License-Identifier: GPL-3.0-or-later
"""What a 3D view shows, from the matrices that Blender gives its region."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from addon.scene import CameraKind

bpy = pytest.importorskip("bpy")

REGION = SimpleNamespace(width=200, height=100)


def orthographic(width: float, height: float, near: float, far: float) -> np.ndarray:
    depth = far - near
    return np.array(
        [[2 / width, 0, 0, 0], [0, 2 / height, 0, 0], [0, 0, -2 / depth, -(far + near) / depth], [0, 0, 0, 1]]
    )


def perspective(near: float = 0.1, far: float = 100.0) -> np.ndarray:
    """Of a region twice as wide as high, 90 degrees across."""
    depth = far - near
    return np.array(
        [[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, -(far + near) / depth, -2 * far * near / depth], [0, 0, -1, 0]]
    )


@pytest.fixture
def scene(empty_scene: Any) -> Any:
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.angle = math.radians(90)
    camera.data.show_passepartout, camera.data.passepartout_alpha = True, 0.5
    empty_scene.collection.objects.link(camera)
    empty_scene.camera = camera
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 100, 100
    return empty_scene


def view(scene: Any, projection: np.ndarray, kind: str = "PERSP", matrix: Any = None, **space: Any) -> Any:
    from addon.host.extract.view import extract_view

    data = SimpleNamespace(
        window_matrix=projection, view_matrix=np.eye(4) if matrix is None else matrix, view_perspective=kind
    )
    none: dict[str, Any] = {"use_render_border": False, "use_local_camera": False, "camera": None}
    none["overlay"] = SimpleNamespace(show_camera_passepartout=True)
    return extract_view(REGION, data, SimpleNamespace(**(none | space)), scene)


def test_a_perspective_view(scene: Any) -> None:
    matrix = np.array([[0, 1, 0, 0], [0, 0, 1, -2], [1, 0, 0, -3], [0, 0, 0, 1.0]])
    found = view(scene, perspective(), matrix=matrix)
    assert found.box == (0, 0, 200, 100) and found.camera.border == (0.0, 0.0, 1.0, 1.0)
    assert found.camera.kind is CameraKind.PERSPECTIVE
    assert np.array_equal(found.camera.clip_from_camera, perspective())
    assert np.allclose(found.camera.world_from_camera @ matrix, np.eye(4))


def test_an_orthographic_view_sees_what_is_behind_its_eye(scene: Any) -> None:
    projection = orthographic(4, 2, -1000, 1000)
    camera = view(scene, projection, "ORTHO").camera
    assert camera.kind is CameraKind.ORTHOGRAPHIC
    assert np.allclose(camera.world_from_camera[:3, 3], (0, 0, 1000)), "the eye looks along -z"
    for point in ((1, 0.5, 400, 1), (-2, 1, -700, 1)):
        there = camera.clip_from_camera @ np.linalg.inv(camera.world_from_camera) @ point
        assert np.allclose(there, projection @ point), "all is seen where it was seen"
    nearest = camera.clip_from_camera @ (0, 0, 0, 1)
    assert np.isclose(nearest[2], -1.0)


def test_the_eye_stays_before_what_is_clipped(scene: Any) -> None:
    assert np.allclose(view(scene, orthographic(4, 2, 1, 9), "ORTHO").camera.world_from_camera, np.eye(4))


def test_a_view_with_a_border(scene: Any) -> None:
    edges = {"min_x": 0.25, "max_x": 0.5, "min_y": 0.1, "max_y": 0.6}
    space = {f"render_border_{name}": value for name, value in edges.items()}
    found = view(scene, perspective(), use_render_border=True, **space)
    assert found.box == (50, 10, 50, 50) and found.camera.border == (0.25, 0.1, 0.5, 0.6)
    assert view(scene, perspective(), use_render_border=False, **space).box == (0, 0, 200, 100)
    assert view(scene, perspective(), "CAMERA", use_render_border=True, **space).box == (0, 0, 200, 100)


def test_a_camera_view_with_a_render_region(scene: Any) -> None:
    render = scene.render
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.0, 0.5, 0.5, 1.0
    assert view(scene, perspective(), "CAMERA").box == (0, 0, 200, 100)
    render.use_border = True
    # The frame is 90 degrees across: all of the width of the region, and half a frame too high for it.
    assert view(scene, perspective(), "CAMERA").box == (0, 50, 100, 50)
    assert view(scene, perspective()).box == (0, 0, 200, 100), "the region is the camera's"
    half = perspective() * np.array([[0.5], [0.5], [1], [1]])  # zoomed out: 100 x 100 pixels in the middle
    assert view(scene, half, "CAMERA").box == (50, 50, 50, 50)


def test_what_a_passepartout_hides_is_not_rendered(scene: Any) -> None:
    half = perspective() * np.array([[0.5], [0.5], [1], [1]])
    lens = scene.camera.data
    lens.passepartout_alpha = 1.0
    assert view(scene, half, "CAMERA").box == (50, 0, 100, 100)
    for shown, box in ((True, (50, 0, 100, 100)), (False, (0, 0, 200, 100))):
        overlay = SimpleNamespace(show_camera_passepartout=shown)
        assert view(scene, half, "CAMERA", overlay=overlay).box == box
    assert "show_camera_passepartout" in bpy.types.View3DOverlay.bl_rna.properties, "Blender calls it so"
    lens.show_passepartout = False
    assert view(scene, half, "CAMERA").box == (0, 0, 200, 100)


@pytest.mark.parametrize(
    ("border", "box"),
    [
        ((-0.5, -0.5, 0.5, 0.5), (0, 0, 100, 50)),
        ((1.2, 0.0, 1.9, 1.0), (199, 0, 1, 100)),
        ((-0.9, -0.9, -0.1, -0.2), (0, 0, 1, 1)),
        ((0.5, 0.5, 0.501, 0.501), (100, 50, 1, 1)),
        ((0.5, 0.2, 0.5, 0.8), (0, 0, 200, 100)),
    ],
    ids=["partly outside", "right of it", "below it, on the left", "less than a pixel", "empty"],
)
def test_a_border_on_the_pixels_of_a_region(border: Any, box: tuple[int, ...]) -> None:
    from addon.host.extract.view import pixel_box

    assert pixel_box(border, (200, 100)) == box


def test_the_frame_follows_shift_and_sensor(scene: Any) -> None:
    """Blender's own projection of a frame shows exactly the frame."""
    from addon.host.extract.view import frame_in_region

    lens = scene.camera.data
    lens.shift_x, lens.shift_y, lens.sensor_fit = 0.3, -0.2, "VERTICAL"
    scene.render.resolution_x, scene.render.pixel_aspect_y = 70, 1.5
    for kind in ("PERSP", "ORTHO"):
        lens.type = kind
        depsgraph = bpy.context.evaluated_depsgraph_get()
        projection = scene.camera.calc_matrix_camera(depsgraph, x=70, y=100, scale_x=1.0, scale_y=1.5)
        frame = frame_in_region(np.array(lens.view_frame(scene=scene)), np.array(projection))
        assert np.allclose(frame, (0, 0, 1, 1), atol=1e-5), kind


def test_a_camera_view_through_something_else(scene: Any) -> None:
    scene.camera = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "SPOT"))
    scene.render.use_border = True
    assert view(scene, perspective(), "CAMERA").box == (0, 0, 200, 100)


def test_size_of_pixels() -> None:
    from addon.host.extract.view import picture_size

    assert picture_size((10, 20, 101, 50), 1) == (101, 50)
    assert picture_size((10, 20, 101, 50), 2) == (51, 25)
    assert picture_size((0, 0, 1, 1), 8) == (1, 1)


def test_the_same_view_is_recognized(scene: Any) -> None:
    one = view(scene, perspective())
    assert view(scene, perspective()).is_same(one) and not one.is_same(None)
    assert not view(scene, perspective(near=0.2)).is_same(one)
    moved = np.eye(4)
    moved[0, 3] = 1.0
    assert not view(scene, perspective(), matrix=moved).is_same(one)
