# SPDX-License-Identifier: GPL-3.0-or-later
"""Strips that glow: long, thin, of several colours, the only light in a room."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from . import stage as parts
from .stage import WHITE

WIDTH = 0.03  # metres


def strips(path: Path) -> None:
    """A room open towards the camera, a pillar, and four strips: two below the ceiling, one up a corner, one low."""
    stage = parts.new_stage(path)
    white = parts.matte(stage, "White", WHITE)
    t, side, height = 0.1, 3.0, 2.4
    solid = np.ones((3, 2, 3), int)
    solid[1, 0, 1] = 0
    across = [-t, 0.0, side, side + t]
    parts.add_solid(stage, "Walls", (across, [0.0, side, side + t], [-t, 0.0, height, height + t]), solid, [white])
    parts.add_box(stage, "Pillar", (1.7, 1.5, 0.0), (2.1, 1.9, 1.4), white, turn=30.0)
    w, z = WIDTH, height - 0.02
    for i, x in enumerate((0.8, 2.2)):
        lamp = parts.glowing(stage, f"Day_{i}", (40.0, 38.0, 34.0))
        parts.add_quad(stage, f"Strip_{i}", [(x, 2.8, z), (x + w, 2.8, z), (x + w, 0.4, z), (x, 0.4, z)], lamp)
    warm = parts.glowing(stage, "Warm", (60.0, 25.0, 5.0))
    parts.add_quad(stage, "Upright", [(0.3, 2.97, 0.3), (0.3 + w, 2.97, 0.3), (0.3 + w, 2.97, 2.0), (0.3, 2.97, 2.0)],
                   warm)
    cold = parts.glowing(stage, "Cold", (5.0, 20.0, 60.0))
    parts.add_quad(stage, "Low", [(2.97, 2.6, 0.15), (2.97, 1.0, 0.15), (2.97, 1.0, 0.15 + w), (2.97, 2.6, 0.15 + w)],
                   cold)
    parts.add_camera(stage, (1.5, -3.6, 1.3), (1.5, 1.5, 1.1), lens=38.0)
    stage.Save()
