# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures of a scene that changes each time, as F12 makes them, in one Blender."""

from __future__ import annotations

import random
from typing import Any

import bpy
import numpy as np

from addon.gpu.context import GpuContext
from blender_tests.scenes import build, rendering

from .measure import Record, gl_objects, resident_bytes


def run(count: int, seed: int = 0) -> Record:
    """Renders ``count`` pictures."""
    record, release = Record(), GpuContext.release
    objects: dict[str, int] = {}

    def counted(self: GpuContext) -> None:
        release(self)
        objects.update(gl_objects())

    rendering.register()
    GpuContext.release = counted  # type: ignore[method-assign]
    chance = random.Random(seed)
    try:
        scene = room()
        for _ in range(count):
            change(scene, chance)
            picture = rendering.conelight((16, 12), voxels=chance.choice((16, 24)), samples=2, bounces=2)
            assert np.isfinite(picture).all()
            record.memory.append(resident_bytes())
            record.objects.append(dict(objects))
    finally:
        GpuContext.release = release  # type: ignore[method-assign]
    return record


def room() -> Any:
    scene = build.empty_scene()
    build.add_plane("Floor", 4.0, build.diffuse("Floor", (0.5, 0.5, 0.5)))
    build.add_box("Box", (0.5, 0.5, 0.5), (0, 0, 0.3), material=build.diffuse("Red", (0.8, 0.2, 0.2)))
    build.add_sphere("Lamp", 0.2, (0.8, 0, 1), build.emission("Glow", (3, 2, 1)), segments=12)
    build.add_light("POINT", (1, -1, 2), name="Point", energy=50.0)
    build.set_world((0.2, 0.3, 0.4))
    build.add_camera((0, -4, 3), (0, 0, 0), lens=35.0)
    return scene


def change(scene: Any, chance: random.Random) -> None:
    """Something of each kind: place, light, material, geometry, camera, an object more or less."""
    things = bpy.data.objects
    things["Box"].location.x = chance.uniform(-1.0, 1.0)
    things["Point"].data.energy = chance.uniform(0.0, 100.0)
    for vertex in things["Floor"].data.vertices:
        vertex.co.z = chance.uniform(-0.1, 0.1)
    scene.camera.location.x = chance.uniform(-1.0, 1.0)
    if "Extra" in things:
        mesh = things["Extra"].data
        bpy.data.objects.remove(things["Extra"])
        bpy.data.meshes.remove(mesh)
    elif chance.random() < 0.5:
        build.add_box("Extra", (0.3, 0.3, 0.3), (-0.8, 0, 0.2))
