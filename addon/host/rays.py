# SPDX-License-Identifier: GPL-3.0-or-later
"""The rays that gather light at the pixel under the pointer, drawn into a rendered viewport as lines."""

from __future__ import annotations

from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

#: Where rays are shown: region (as pointer) -> place in it, pixels.
places: dict[int, tuple[int, int]] = {}

#: Lines that a cone is drawn by.
_CONE_SIDES = 12


class CONELIGHT_OT_show_rays(bpy.types.Operator):
    """Show rays that bring light to the surface under the pointer. A click leaves them there, Esc takes them away"""

    bl_idname = "conelight.show_rays"
    bl_label = "Show Rays"

    @classmethod
    def poll(cls, context: Any) -> bool:
        area = context.area
        return area is not None and area.type == "VIEW_3D" and area.spaces.active.shading.type == "RENDERED"

    def invoke(self, context: Any, event: Any) -> set[str]:
        places.clear()
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        if context.area is None or context.area.type != "VIEW_3D":
            places.clear()
            return {"CANCELLED"}
        if event.type == "MOUSEMOVE":
            places.clear()
            for region in context.area.regions:
                place = event.mouse_x - region.x, event.mouse_y - region.y
                if region.type == "WINDOW" and 0 <= place[0] < region.width and 0 <= place[1] < region.height:
                    places[region.as_pointer()] = place
                    region.tag_redraw()
        elif event.type == "LEFTMOUSE":
            return {"FINISHED"}
        elif event.type in ("ESC", "RIGHTMOUSE"):
            places.clear()
            context.area.tag_redraw()
            return {"CANCELLED"}
        return {"PASS_THROUGH"}


def place_in(region: Any) -> tuple[int, int] | None:
    """Where in a region of a 3D view the user asks for rays, pixels; None: nowhere."""
    return places.get(region.as_pointer()) if places else None


def draw_rays(rays: Any, region_data: Any) -> None:
    """Draws them over the picture. ``rays``: ``passes.view.SeenRays``. ``region_data``: ``bpy.types.RegionView3D``."""
    lines, colors = _lines(rays)
    if not len(lines):
        return
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": lines.astype(np.float32), "color": colors.astype(np.float32)})
    with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_matrix(region_data.view_matrix)
        gpu.matrix.load_projection_matrix(region_data.window_matrix)
        gpu.state.depth_test_set("NONE")
        gpu.state.blend_set("ALPHA")
        batch.draw(shader)
        gpu.state.blend_set("NONE")


def _lines(rays: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners (2 L, 3) of lines and their colours (2 L, 4), brighter where a ray brings more."""
    if not len(rays.ends):
        return np.zeros((0, 3)), np.zeros((0, 4))
    brightest = max(float(rays.radiance.max()), 1e-12)
    colors = np.ones((len(rays.ends), 4))
    colors[:, :3] = 0.1 + 0.9 * np.sqrt(np.clip(rays.radiance / brightest, 0.0, 1.0))
    colors[:, 3] = np.where(rays.meets, 1.0, 0.5)
    starts, ends, shown = [rays.start] * len(rays.ends), list(rays.ends), list(colors)
    if rays.tan_half > 0.0:
        for end, color in zip(rays.ends, colors, strict=True):
            rim = _rim(rays.start, end, rays.tan_half)
            starts += [*([rays.start] * len(rim)), *rim]
            ends += [*rim, *np.roll(rim, 1, axis=0)]
            shown += [color] * (2 * len(rim))
    corners = np.stack([starts, ends], axis=1).reshape(-1, 3)
    return corners, np.repeat(shown, 2, axis=0)


def _rim(start: np.ndarray, end: np.ndarray, tan_half: float) -> np.ndarray:
    """(_CONE_SIDES, 3) points around the end of a cone's axis."""
    axis = end - start
    side = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.5 * np.linalg.norm(axis) else [0.0, 1.0, 0.0])
    side *= tan_half * np.linalg.norm(axis) / max(float(np.linalg.norm(side)), 1e-12)
    other = np.cross(axis, side) / max(float(np.linalg.norm(axis)), 1e-12)
    turns = np.linspace(0.0, 2.0 * np.pi, _CONE_SIDES, endpoint=False)[:, None]
    return end + np.cos(turns) * side + np.sin(turns) * other


def register() -> None:
    bpy.utils.register_class(CONELIGHT_OT_show_rays)


def unregister() -> None:
    places.clear()
    if CONELIGHT_OT_show_rays.is_registered:
        bpy.utils.unregister_class(CONELIGHT_OT_show_rays)
