# SPDX-License-Identifier: GPL-3.0-or-later
"""A sphere on a plane under a sky of one colour: contact shadow and ambient light only."""

from __future__ import annotations

from typing import Any

from . import build


def scene() -> Any:
    result = build.empty_scene()
    build.add_plane("Ground", 6.0, build.diffuse("Ground", (0.6, 0.5, 0.4)))
    build.add_sphere("Sphere", 1.0, (0, 0, 1), build.diffuse("Sphere", (0.8, 0.8, 0.8)), segments=48)
    build.set_world((0.6, 0.8, 1.0))
    build.add_camera((0, -7, 2.5), (0, 0, 0.8), lens=50.0)
    return result
