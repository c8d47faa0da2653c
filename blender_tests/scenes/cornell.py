# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cornell box: proportions of the room measured at Cornell (5.5 m here), two boxes, and one of three lamps.

x goes right, y away from the camera, z up. The left wall is red, the right one green.
"""

from __future__ import annotations

import math
from typing import Any

from . import build

WIDTH, DEPTH, HEIGHT = 5.528, 5.592, 5.488
WHITE, RED, GREEN = (0.74, 0.73, 0.70), (0.61, 0.055, 0.06), (0.115, 0.44, 0.10)

#: Lamp -> what hangs below the ceiling.
LAMPS = ("area", "point", "emitter")


def scene(lamp: str = "area") -> Any:
    """``lamp``: ``area`` (an area light at the ceiling), ``point``, ``emitter`` (a small glowing quad, unseen).

    Raises ValueError for another one.
    """
    result = build.empty_scene()
    white, red, green = build.diffuse("White", WHITE), build.diffuse("Red", RED), build.diffuse("Green", GREEN)
    w, d, h = WIDTH, DEPTH, HEIGHT
    build.add_quad("Floor", [(0, 0, 0), (w, 0, 0), (w, d, 0), (0, d, 0)], white)
    build.add_quad("Ceiling", [(0, d, h), (w, d, h), (w, 0, h), (0, 0, h)], white)
    build.add_quad("Back", [(0, d, 0), (w, d, 0), (w, d, h), (0, d, h)], white)
    build.add_quad("Left", [(0, 0, 0), (0, d, 0), (0, d, h), (0, 0, h)], red)
    build.add_quad("Right", [(w, d, 0), (w, 0, 0), (w, 0, h), (w, d, h)], green)
    build.add_box("Short Box", (1.65, 1.65, 1.65), (3.69, 1.69, 0.825), math.radians(-17), white)
    build.add_box("Tall Box", (1.65, 1.65, 3.30), (1.86, 3.51, 1.65), math.radians(17), white)

    centre = (w / 2, d / 2)
    if lamp == "area":
        build.add_light("AREA", (*centre, h - 0.01), (*centre, 0), shape="RECTANGLE", size=1.3, size_y=1.05, energy=160)
    elif lamp == "point":
        build.add_light("POINT", (centre[0], centre[1], h - 1.0), energy=160, shadow_soft_size=0.1)
    elif lamp == "emitter":
        glow = build.emission("Lamp", (1.0, 0.85, 0.6), 150.0)
        x, y, z, r = *centre, h - 0.3, 0.15
        corners = [(x - r, y + r, z), (x + r, y + r, z), (x + r, y - r, z), (x - r, y - r, z)]
        build.add_quad("Lamp", corners, glow).visible_camera = False
    else:
        raise ValueError(f"lamp '{lamp}' is not one of {', '.join(LAMPS)}")
    build.add_camera((w / 2, -8.0, h / 2), (w / 2, 0, h / 2), lens=50.0)
    result.render.resolution_x = result.render.resolution_y = 96
    return result
