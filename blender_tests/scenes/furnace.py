# SPDX-License-Identifier: GPL-3.0-or-later
"""The furnace: closed, seen from inside, with walls that emit 1 - r and reflect r. Its radiance is 1 everywhere."""

from __future__ import annotations

from typing import Any

from . import build


def scene(albedo: float, size: float = 2.0, *, shape: str = "box", centre: build.Point = (0.0, 0.0, 0.0)) -> Any:
    """``shape``: ``box`` or ``sphere``, ``size`` metres across, around ``centre``."""
    result = build.empty_scene()
    wall = build.diffuse_and_emission("Wall", albedo, 1.0 - albedo)
    if shape == "box":
        build.add_box("Furnace", (size, size, size), centre, material=wall, inward=True)
    else:
        build.add_sphere("Furnace", size / 2, centre, wall, segments=64).data.flip_normals()
    x, y, z = centre
    camera = build.add_camera(
        (x - 0.2 * size, y - 0.25 * size, z - 0.1 * size), (x + 0.5 * size, y + 0.5 * size, z + 0.1 * size), lens=18.0
    )
    camera.data.clip_start, camera.data.clip_end = 1e-3 * size, 10.0 * size
    result.render.resolution_x = result.render.resolution_y = 32
    return result
