# SPDX-License-Identifier: GPL-3.0-or-later
"""Rooms in the sun: two with a door between them, one that is closed, and one with a window, furniture and sky."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from . import stage as parts
from .stage import GREEN, RED, WHITE

SIDE, HEIGHT = 4.0, 2.6  # of a room inside, metres
SUN = 5.0  # irradiance of a surface that faces the sun, W/m2
GROUND = (0.35, 0.3, 0.25)


def thickness(voxels_thick: float, resolution: int, rooms: int) -> float:
    """Metres of a wall that is so many voxels thick, where ``rooms`` rooms in a row, their walls included, have
    ``resolution`` voxels along them: t = k (n s + (n + 1) t) / N."""
    return voxels_thick * rooms * SIDE / (resolution - voxels_thick * (rooms + 1))


def two_rooms(path: Path, *, door_open: bool, voxels_thick: float, resolution: int) -> None:
    """Sun through a window into room A; room B, which the camera sees, has only what comes through the door.

    x goes from A to B. The window is in A's far wall, the door in the wall between; the camera has its back to it.
    """
    t = thickness(voxels_thick, resolution, rooms=2)
    xs = [0.0, t, t + SIDE, 2 * t + SIDE, 2 * t + 2 * SIDE, 3 * t + 2 * SIDE]
    ys = [0.0, t, t + 0.9, t + 1.4, t + 2.3, t + 2.7, t + SIDE, 2 * t + SIDE]
    zs = [0.0, t, t + 0.9, t + 2.1, t + HEIGHT, 2 * t + HEIGHT]
    solid = np.ones((len(xs) - 1, len(ys) - 1, len(zs) - 1), int)
    solid[1, 1:6, 1:4] = 0  # room A
    solid[3, 1:6, 1:4] = 0  # room B
    solid[0, 2:5, 2] = 0  # window, 1.8 x 1.2
    if door_open:
        solid[2, 3, 1:3] = 0  # door, 0.9 x 2.1
    stage = parts.new_stage(path)
    white = parts.matte(stage, "White", WHITE)
    parts.add_solid(stage, "Walls", (xs, ys, zs), solid, [white])
    x = 2 * t + SIDE
    parts.add_box(stage, "Chest", (x + 2.6, t + 2.6, t), (x + 3.5, t + 3.4, t + 0.8),
                  parts.matte(stage, "Red", RED), turn=25.0)
    parts.add_box(stage, "Shelf", (x + 3.3, t + 0.5, t), (x + 3.8, t + 1.3, t + 1.8),
                  parts.matte(stage, "Green", GREEN))
    parts.add_sun(stage, (1.0, 0.15, -0.8), SUN)
    parts.add_camera(stage, (x + 0.25, t + 0.3, t + 1.6), (x + 3.2, t + 2.5, t + 0.95), lens=20.0)
    stage.Save()


def closed_room(path: Path, *, voxels_thick: float, resolution: int) -> None:
    """No opening: what is seen inside is a leak."""
    t = thickness(voxels_thick, resolution, rooms=1)
    xs = [0.0, t, t + SIDE, 2 * t + SIDE]
    zs = [0.0, t, t + HEIGHT, 2 * t + HEIGHT]
    solid = np.ones((3, 3, 3), int)
    solid[1, 1, 1] = 0
    stage = parts.new_stage(path)
    parts.add_solid(stage, "Walls", (xs, xs, zs), solid, [parts.matte(stage, "White", WHITE)])
    parts.add_sun(stage, (0.7, 0.4, -0.8), SUN)
    parts.add_camera(stage, (t + 0.3, t + 0.3, t + 1.9), (t + 3.0, t + 3.2, t + 0.9), lens=18.0)
    stage.Save()


def interior(path: Path) -> None:
    """A furnished room: sun and sky through a wide window, ground outside."""
    t = 0.15
    xs = [0.0, t, t + 1.0, t + 4.2, t + 5.0, 2 * t + 5.0]
    ys = [0.0, t, t + SIDE, 2 * t + SIDE]
    zs = [0.0, t, t + 0.8, t + 2.2, t + HEIGHT, 2 * t + HEIGHT]
    solid = np.ones((5, 3, 5), int)
    solid[1:4, 1, 1:4] = 0
    solid[2, 0, 2] = 0  # window, 3.2 x 1.4, to -y
    solid[0, 1, 1:4] = 2  # one red wall
    stage = parts.new_stage(path)
    red = parts.matte(stage, "Red", RED)
    parts.add_solid(stage, "Walls", (xs, ys, zs), solid, [parts.matte(stage, "White", WHITE), red])
    g = 12.0
    parts.add_quad(stage, "Ground", [(-g, -g, -0.01), (g, -g, -0.01), (g, g, -0.01), (-g, g, -0.01)],
                   parts.matte(stage, "Earth", GROUND))
    wood = parts.matte(stage, "Wood", (0.45, 0.28, 0.14))
    parts.add_box(stage, "TableTop", (1.9, 1.4, t + 0.70), (3.5, 2.3, t + 0.75), wood)
    for i, (x, y) in enumerate(((1.95, 1.45), (3.40, 1.45), (1.95, 2.20), (3.40, 2.20))):
        parts.add_box(stage, f"Leg_{i}", (x, y, t), (x + 0.06, y + 0.06, t + 0.70), wood)
    parts.add_box(stage, "Cupboard", (4.3, 3.2, t), (5.1, 4.1, t + 1.7), parts.matte(stage, "Blue", (0.12, 0.2, 0.5)))
    parts.add_sphere(stage, "Ball", (2.4, 1.8, t + 0.75 + 0.22), 0.22, parts.matte(stage, "Pale", (0.8, 0.75, 0.6)))
    parts.add_sun(stage, (-0.35, 0.8, -0.65), SUN)
    parts.add_sky(stage, (0.5, 0.6, 0.8))
    parts.add_camera(stage, (4.9, 0.35, t + 1.6), (1.2, 3.2, t + 0.85), lens=20.0)
    stage.Save()
