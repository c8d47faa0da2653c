# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that are files beside the checkout; the living room gets the camera, sun and sky that its file lacks."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy

from blender_tests.scenes import build

from ..catalogue import SCENES


def _open(name: str) -> Any:
    file = SCENES[name].needs
    assert isinstance(file, Path)
    bpy.ops.wm.open_mainfile(filepath=str(file), load_ui=False, use_scripts=False)
    return bpy.context.scene


def atrium() -> Any:
    return _open("atrium")


def living_room() -> Any:
    result = _open("living_room")
    sun = build.add_light("SUN", (0, 0, 0), energy=5.0, name="Sun")
    sun.rotation_euler = (math.radians(50), 0, math.radians(10))
    build.set_world((0.5, 0.6, 0.8))
    build.add_camera((-3.6, 1.7, 2.6), (2.5, -1.2, 1.5), lens=24.0)
    return result
