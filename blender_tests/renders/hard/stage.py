# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that many hard cases share. Lengths in metres; all lie around the origin."""

from __future__ import annotations

import math
from typing import Any

from blender_tests.scenes import build

ALBEDO = 0.8


def court(lamp: bool = True, world: float = 0.3) -> Any:
    """A corner of three walls with a box and a sphere, open to the sky, under an area lamp."""
    grey, red, green = (
        build.diffuse(name, color)
        for name, color in (("Grey", (0.7, 0.7, 0.7)), ("Red", (0.7, 0.1, 0.1)), ("Green", (0.1, 0.6, 0.1)))
    )
    build.add_quad("Floor", [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], grey)
    build.add_quad("Back", [(-2, 2, 0), (2, 2, 0), (2, 2, 3), (-2, 2, 3)], red)
    build.add_quad("Side", [(-2, -2, 0), (-2, 2, 0), (-2, 2, 3), (-2, -2, 3)], green)
    build.add_box("Box", (1, 1, 1), (0.75, 0.5, 0.5), 0.5, grey)
    build.add_sphere("Ball", 0.5, (-0.75, 0.25, 0.5), grey)
    if lamp:
        build.add_light("AREA", (0.5, -0.5, 3.0), (0, 0.25, 0), name="Lamp", energy=60.0, shape="SQUARE", size=1.0)
    if world:
        build.set_world((world,) * 3)
    return court_camera()


def court_camera() -> Any:
    camera = build.add_camera((3.5, -4.0, 2.5), (-0.25, 0.5, 0.75), lens=35.0)
    camera.data.clip_start, camera.data.clip_end = 0.01, 100.0
    return camera


def white_world(albedo: float = ALBEDO, radiance: float = 1.0) -> Any:
    """A material that reflects ``albedo`` and emits the rest of ``radiance``, under a world of ``radiance``: whatever
    is made of it, all radiance is ``radiance``."""
    build.set_world((radiance,) * 3)
    return build.diffuse_and_emission("Furnace", albedo, (1.0 - albedo) * radiance)


def furnace_room(material: Any, side: float = 2.0, name: str = "Room", centre: Any = (0, 0, 0)) -> Any:
    return build.add_box(name, (side,) * 3, centre, material=material, inward=True)


def camera(position: Any, target: Any, lens: float = 24.0, near: float = 1e-3, far: float = 100.0) -> Any:
    made = build.add_camera(position, target, lens=lens)
    made.data.clip_start, made.data.clip_end = near, far
    return made


def patch_seen(side: float = 0.02, height: float = 3.0, at: Any = (0.0, 0.0)) -> Any:
    """A camera that sees a small square of the plane z = 0, from above."""
    made = build.add_camera((*at, height), (*at, 0), ortho_scale=side)
    made.data.clip_start, made.data.clip_end = 1e-3, 10.0 * height
    return made


def plane(albedo: float = ALBEDO, side: float = 4.0) -> Any:
    return build.add_plane("Plane", side, build.diffuse("Matte", (albedo,) * 3))


def turned(thing: Any, angle: float = 0.4) -> Any:
    thing.rotation_euler = (angle, 0.7 * angle, 1.3 * angle)
    return thing


def fan(count: int) -> list[float]:
    return [2.0 * math.pi * k / count for k in range(count)]
