# SPDX-License-Identifier: GPL-3.0-or-later
"""A diffuse plane under one light, seen by a camera that shows one point of it only: its radiance is one number."""

from __future__ import annotations

import math
from typing import Any

from . import build

ALBEDO = 0.8
#: Metres across what the camera sees. The light is the same all over it.
SPOT_SEEN = 0.004


def scene(seen: tuple[float, float] = (0.0, 0.0)) -> Any:
    """The plane z = 0 and the camera, without light. ``seen``: the point, metres."""
    result = build.empty_scene()
    build.add_plane("Plane", 3.0, build.diffuse("Paper", (ALBEDO,) * 3))
    x, y = seen
    # From the side and low, so that no light below 60 degrees is between the camera and the point.
    build.add_camera((x, y - 3.0 * math.cos(0.4), 3.0 * math.sin(0.4)), (x, y, 0.0), ortho_scale=SPOT_SEEN)
    result.render.resolution_x = result.render.resolution_y = 16
    return result
