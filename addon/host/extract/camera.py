# SPDX-License-Identifier: GPL-3.0-or-later
"""The active camera. Blender computes the projection: sensor fit, shift and pixel aspect follow its own rules."""

from __future__ import annotations

import bpy
import numpy as np

from ...scene import CameraData, CameraKind
from .transforms import rigid


class ExtractionError(Exception):
    """The scene cannot be rendered at all; the message says what to do."""


def extract_camera(depsgraph: bpy.types.Depsgraph, resolution: tuple[int, int], warnings: list[str]) -> CameraData:
    """The camera of the depsgraph's scene, for a frame of ``resolution`` pixels (width, height) before cropping.

    Raises ExtractionError without a camera, or when it has no usable projection or position.
    """
    scene = depsgraph.scene_eval
    camera = scene.camera
    if camera is None:
        raise ExtractionError(
            "the scene has no camera: add one, or make one active with Scene properties > Scene > Camera"
        )
    camera = camera.evaluated_get(depsgraph)
    lens = camera.data if camera.type == "CAMERA" else None
    if lens is not None and lens.type not in ("PERSP", "ORTHO"):
        warnings.append(f'camera "{camera.name}": panoramic lenses are not supported; rendered in perspective')
    render = scene.render
    projection = np.array(
        camera.calc_matrix_camera(
            depsgraph,
            x=resolution[0],
            y=resolution[1],
            scale_x=render.pixel_aspect_x,
            scale_y=render.pixel_aspect_y,
        ),
        np.float64,
    )
    if not np.isfinite(projection).all() or abs(np.linalg.det(projection)) < 1e-30:
        raise ExtractionError(
            f'camera "{camera.name}" cannot project anything: its clip end must be beyond its clip start, '
            "and its focal length or scale above 0"
        )
    world = np.array(camera.matrix_world, np.float64)
    if not np.isfinite(world).all():
        raise ExtractionError(f'camera "{camera.name}": its position or rotation is not a number; set it anew')
    return CameraData(
        world_from_camera=rigid(world),
        clip_from_camera=projection,
        kind=CameraKind.ORTHOGRAPHIC if projection[3, 3] == 1.0 else CameraKind.PERSPECTIVE,
        border=_border(render),
    )


def _border(render: bpy.types.RenderSettings) -> tuple[float, float, float, float]:
    """Render region in 0..1, origin bottom left; the whole frame when there is none or it is empty."""
    if not render.use_border:
        return (0.0, 0.0, 1.0, 1.0)
    x0, x1 = sorted((render.border_min_x, render.border_max_x))
    y0, y1 = sorted((render.border_min_y, render.border_max_y))
    if x1 <= x0 or y1 <= y0:
        return (0.0, 0.0, 1.0, 1.0)
    return (x0, y0, x1, y1)
