# SPDX-License-Identifier: GPL-3.0-or-later
"""The furnace: a closed box, seen from inside, whose walls emit 1 - r and reflect r. Its radiance is 1 everywhere."""

from __future__ import annotations

from typing import Any

from . import build


def scene(albedo: float, size: float = 2.0) -> Any:
    result = build.empty_scene()
    wall = build.diffuse_and_emission("Wall", albedo, 1.0 - albedo)
    build.add_box("Furnace", (size, size, size), (0, 0, 0), material=wall, inward=True)
    build.add_camera((-0.3 * size, -0.35 * size, -0.1 * size), (0.5 * size, 0.5 * size, 0.1 * size), lens=18.0)
    result.render.resolution_x = result.render.resolution_y = 32
    return result
