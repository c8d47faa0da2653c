# SPDX-License-Identifier: GPL-3.0-or-later
"""From where a 3D viewport looks, and which part of its region shows the picture.

Blender has already put zoom, shift, lens and sensor fit into the viewport's matrices, in camera views too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...scene import CameraData, CameraKind, DoubleArray
from .transforms import rigid

#: Part of a region or of a frame: x0, y0, x1, y1 in 0..1, origin bottom left.
Border = tuple[float, float, float, float]

WHOLE: Border = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True)
class View:
    """What a viewport shows."""

    camera: CameraData  # its border is that of the box
    box: tuple[int, int, int, int]  # left, bottom, width, height in pixels of the region

    def is_same(self, other: View | None) -> bool:
        """Whether the same is to be seen."""
        return other is not None and self.box == other.box and same_camera(self.camera, other.camera)


def same_camera(a: CameraData, b: CameraData) -> bool:
    """Whether two cameras see the same."""
    return (
        a.border == b.border
        and a.kind is b.kind
        and np.array_equal(a.world_from_camera, b.world_from_camera)
        and np.array_equal(a.clip_from_camera, b.clip_from_camera)
    )


def camera_from_matrices(camera_from_world: DoubleArray, clip_from_camera: DoubleArray, border: Border) -> CameraData:
    """The camera that has these matrices (4, 4).

    Orthographic views see what is behind their eye as well: it is moved back until all is before it.
    """
    world_from_camera = rigid(np.linalg.inv(camera_from_world))
    projection = np.array(clip_from_camera, np.float64)
    is_orthographic = projection[3, 3] == 1.0
    if is_orthographic:
        near = (1.0 + projection[2, 3]) / projection[2, 2]  # where clip z is -1, along the view
        if near < 0.0:
            back = np.eye(4)
            back[2, 3] = -near
            world_from_camera = world_from_camera @ back
            projection = projection @ back
    kind = CameraKind.ORTHOGRAPHIC if is_orthographic else CameraKind.PERSPECTIVE
    return CameraData(world_from_camera, projection, kind, border)


def frame_in_region(corners: DoubleArray, clip_from_camera: DoubleArray) -> Border:
    """Where a camera's frame lies in a region that looks through it; may reach beyond it.

    ``corners``: (4, 3) of the frame, in camera space, any distance before the camera.
    """
    points = np.concatenate([corners, np.ones((4, 1))], axis=1) @ np.asarray(clip_from_camera, np.float64).T
    places = 0.5 + 0.5 * points[:, :2] / points[:, 3:]
    (x0, y0), (x1, y1) = places.min(axis=0), places.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def part_of(frame: Border, part: Border) -> Border:
    """``part`` of ``frame``, in what ``frame`` is given in."""
    width, height = frame[2] - frame[0], frame[3] - frame[1]
    return (
        frame[0] + part[0] * width, frame[1] + part[1] * height, frame[0] + part[2] * width, frame[1] + part[3] * height
    )  # fmt: skip


def pixel_box(border: Border, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Left, bottom, width and height of a border on whole pixels of a region, at least one; all where it is empty."""
    if border[2] <= border[0] or border[3] <= border[1]:
        return (0, 0, *size)
    left, width = _pixel_span(border[0], border[2], size[0])
    bottom, height = _pixel_span(border[1], border[3], size[1])
    return left, bottom, width, height


def _pixel_span(low: float, high: float, count: int) -> tuple[int, int]:
    """First and number of those of ``count`` pixels that lie between two edges in 0..1; the nearest where none does."""
    first = min(max(round(low * count), 0), count - 1)
    return first, max(min(round(high * count), count) - first, 1)


def picture_size(box: tuple[int, int, int, int], pixel_size: int) -> tuple[int, int]:
    """Pixels of a picture in ``box``, each of which covers ``pixel_size`` x ``pixel_size`` of the region."""
    return max(1, math.ceil(box[2] / pixel_size)), max(1, math.ceil(box[3] / pixel_size))


def extract_view(region: Any, region_data: Any, space: Any, scene: Any) -> View:
    """What a 3D view's region shows: ``bpy.types.Region``, ``RegionView3D``, ``SpaceView3D`` and ``Scene``."""
    size = (max(region.width, 1), max(region.height, 1))
    projection = np.array(region_data.window_matrix, np.float64)
    box = pixel_box(_border(region_data, space, scene, projection), size)
    border = (box[0] / size[0], box[1] / size[1], (box[0] + box[2]) / size[0], (box[1] + box[3]) / size[1])
    return View(camera_from_matrices(np.array(region_data.view_matrix, np.float64), projection, border), box)


def _border(region_data: Any, space: Any, scene: Any, projection: DoubleArray) -> Border:
    """The part of the region that is rendered: of a camera view the render region, and its frame where all else is
    hidden; of another the view's own."""
    render = scene.render
    if region_data.view_perspective != "CAMERA":
        if not space.use_render_border:
            return WHOLE
        return (
            space.render_border_min_x, space.render_border_min_y, space.render_border_max_x, space.render_border_max_y
        )  # fmt: skip
    camera = space.camera if space.use_local_camera and space.camera is not None else scene.camera
    lens = camera.data if camera is not None and camera.type == "CAMERA" else None
    hides_surroundings = (
        space.overlay.show_camera_passepartout
        and lens is not None and lens.show_passepartout and lens.passepartout_alpha >= 1.0
    )  # fmt: skip
    if lens is None or not (render.use_border or hides_surroundings):
        return WHOLE
    frame = frame_in_region(np.array(lens.view_frame(scene=scene), np.float64), projection)
    if not render.use_border:
        return frame
    part = render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y
    return part_of(frame, part)
