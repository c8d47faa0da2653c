# SPDX-License-Identifier: GPL-3.0-or-later
"""Things that are recognised by their colour, for tests of what the film shows: every object only emits.

A red, a green and a blue square of 1 m at x = -2, 0, 2 in the plane z = 0, seen from above; black between them.
"""

from __future__ import annotations

from typing import Any

from . import build

COLORS = {"Red": (1.0, 0.0, 0.0), "Green": (0.0, 1.0, 0.0), "Blue": (0.0, 0.0, 1.0)}
METRES_ACROSS = 8.0
SIZE = (64, 48)


def scene() -> Any:
    result = build.empty_scene()
    for i, (name, color) in enumerate(COLORS.items()):
        x, h = 2.0 * (i - 1), 0.5
        corners = [(x - h, -h, 0), (x + h, -h, 0), (x + h, h, 0), (x - h, h, 0)]
        build.add_quad(name, corners, build.emission(name, color))
    camera = build.add_camera((0, 0, 5), (0, 0, 0), ortho_scale=METRES_ACROSS)
    camera.rotation_euler = (0, 0, 0)
    result.render.resolution_x, result.render.resolution_y = SIZE
    return result
