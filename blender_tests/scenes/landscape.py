# SPDX-License-Identifier: GPL-3.0-or-later
"""Two kilometres of hills with a village, seen from a porch where things of a few centimetres lie on a table: under sun
and sky, most of the light near the camera has come off the ground, the walls and the table."""

from __future__ import annotations

import math
from typing import Any

from . import build

EXTENT = 2000.0  # metres
STEPS = 100  # quads of the ground along a side
VILLAGE = 90.0  # metres around the middle that are flat


def height(x: float, y: float) -> float:
    """Of the ground, metres."""
    away = max(math.hypot(x, y) - VILLAGE, 0.0) / 300.0
    return min(away, 1.0) * (35.0 + 25.0 * math.sin(x / 170.0) + 20.0 * math.cos(y / 130.0 + x / 400.0))


def scene() -> Any:
    result = build.empty_scene()
    ground = build.diffuse("Ground", (0.35, 0.42, 0.2))
    plaster = build.diffuse("Plaster", (0.75, 0.7, 0.6))
    brick = build.diffuse("Brick", (0.55, 0.25, 0.18))
    roof = build.diffuse("Roof", (0.4, 0.2, 0.15))
    wood = build.diffuse("Wood", (0.5, 0.33, 0.18))
    paper = build.diffuse("Paper", (0.8, 0.8, 0.78))

    at = [EXTENT * (k / STEPS - 0.5) for k in range(STEPS + 1)]
    vertices = [(x, y, height(x, y)) for y in at for x in at]
    row = STEPS + 1
    faces = [(i + j * row, i + 1 + j * row, i + 1 + (j + 1) * row, i + (j + 1) * row)
             for j in range(STEPS) for i in range(STEPS)]  # fmt: skip
    build.add_object("Hills", build.new_mesh("Hills", vertices, faces, ground))

    for k in range(24):  # houses around
        angle, away = 2.4 * k, 22.0 + 2.6 * k
        place = (away * math.cos(angle), away * math.sin(angle))
        tall = 4.0 + k % 3
        build.add_box(f"House {k}", (9.0, 7.0, tall), (*place, tall / 2), angle, plaster if k % 2 else brick)
        build.add_box(f"Roof {k}", (10.0, 8.0, 0.4), (*place, tall + 0.2), angle, roof)

    # The porch: floor, back, a side, and a roof that keeps the sun off.
    build.add_box("Floor", (6.0, 4.0, 0.2), (0.0, 1.0, 0.1), 0.0, wood)
    build.add_box("Back", (6.0, 0.2, 3.0), (0.0, 3.1, 1.5), 0.0, plaster)
    build.add_box("Side", (0.2, 4.0, 3.0), (-3.1, 1.0, 1.5), 0.0, brick)
    build.add_box("Shade", (6.6, 4.0, 0.1), (0.0, 1.4, 3.05), 0.0, wood)
    build.add_box("Table", (1.4, 0.8, 0.05), (0.0, 1.6, 0.925), 0.0, wood)
    for k in range(4):
        build.add_box(f"Leg {k}", (0.06, 0.06, 0.7), ((k % 2 - 0.5) * 1.2, 1.6 + (k // 2 - 0.5) * 0.6, 0.55), 0.0, wood)
    for k in range(14):  # what lies on it
        x, y = -0.6 + 0.093 * k, 1.45 + 0.11 * (k % 4)
        side = (0.05, 0.05 + 0.02 * (k % 3), 0.05 + 0.03 * (k % 4))
        build.add_box(f"Thing {k}", side, (x, y, 0.95 + side[2] / 2), 0.3 * k, paper if k % 2 else brick)

    build.add_light("SUN", (0.0, 0.0, 0.0), (0.5, 0.75, -0.9), "Sun", energy=4.0, angle=0.01)
    build.set_world((0.35, 0.5, 0.8))
    build.add_camera((-1.5, 2.8, 1.75), (0.7, 0.4, 0.9), lens=24.0)
    result.camera.data.clip_end = 2.0 * EXTENT
    return result
