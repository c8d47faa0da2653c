# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras and pictures at the ends of their ranges; scenes of nothing and of very much."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from blender_tests.scenes import build

from . import stage
from .case import Case
from .shapes import ALL_ONE, LIT, SUNLIT, sunlit

CLOSED = "closed, walls reflect 0.8 and emit 0.2"


def in_ball() -> None:
    """The camera stands in the court's ball, which is closed."""
    stage.court(world=0.3)
    stage.camera((-0.75, 0.25, 0.5), (0.5, 0.0, 0.5), lens=18)


def near_wall(distance: float) -> None:
    """In a closed room, nearer to a wall than a voxel is wide, along it."""
    stage.furnace_room(build.diffuse_and_emission("Wall", 0.8, 0.2))
    stage.camera((1.0 - distance, 0.0, 0.0), (0.98 - distance, 1.0, 0.1), lens=18, near=1e-5)


def clipped(near: float, far: float) -> None:
    data = stage.court().data
    data.clip_start, data.clip_end = near, far


def through_lens(lens: float, distance: float) -> None:
    """The court from another distance, through another lens."""
    stage.court()
    stage.camera(tuple(distance * c for c in (3.5, -4.0, 2.5)), (-0.25, 0.5, 0.75), lens, 0.01, 1e5)


def nothing() -> None:
    build.set_world((0.3, 0.3, 0.3))
    stage.court_camera()


def one_point() -> None:
    nothing()
    build.add_object("Point", build.new_mesh("Point", [(0, 0, 0)] * 3, [(0, 1, 2)], build.diffuse("Grey", (0.5,) * 3)))


def one_small_triangle() -> None:
    """A triangle a micrometre wide fills the picture."""
    side = 1e-6
    corners = [(-3 * side, -side, 0), (3 * side, -side, 0), (0, 4 * side, 0)]
    build.add_object("Speck", build.new_mesh("Speck", corners, [(0, 1, 2)], stage.white_world()))
    made = build.add_camera((0, 0, 10 * side), (0, 0, 0), ortho_scale=side)
    made.data.clip_start, made.data.clip_end = 1e-7, 1.0


def furnace() -> None:
    stage.furnace_room(build.diffuse_and_emission("Wall", 0.8, 0.2))
    stage.camera((-0.4, -0.5, -0.2), (1.0, 1.0, 0.2), lens=18)


def many_objects(count: int) -> None:
    """Boxes on the vertices of a mesh, ``count`` of them."""
    box = build.add_box("Grain", (0.05,) * 3, (0, 0, 0), material=stage.white_world())
    side = round(count ** (1 / 3))
    places = np.stack(np.meshgrid(*[np.arange(side) * 0.1] * 3), axis=-1).reshape(-1, 3)[:count] - 0.05 * side
    places += np.random.default_rng(1).uniform(-0.02, 0.02, places.shape)
    field = build.add_object("Field", build.new_mesh("Field", [tuple(p) for p in places], []))
    field.instance_type = "VERTS"
    field.show_instancer_for_render = field.show_instancer_for_viewport = False
    box.parent = field
    stage.camera((0.09 * side, -0.12 * side, 0.07 * side), (0, 0, 0), lens=35)


def one_object() -> None:
    build.add_box("Box", (1, 1, 1), (0, 0, 0), 0.3, stage.white_world())
    stage.camera((2, -3, 1.5), (0, 0, 0), lens=35)


def flat() -> Any:
    return sunlit()



CASES = (
    Case("camera_in_ball", "the camera in a closed ball", in_ball, exact=0.0, formula="no light gets in",
         skipped={"parts": "all is black"}),
    Case("camera_in_voxel", "the camera 1 mm from a wall, of voxels of 7 cm", partial(near_wall, 1e-3), exact=1.0,
         formula=CLOSED),
    Case("camera_on_wall", "the camera 10 micrometres from a wall", partial(near_wall, 1e-5), exact=1.0,
         formula=CLOSED),
    Case("clip_range", "a camera that clips at 1e-5 and 1e7 m", partial(clipped, 1e-5, 1e7), same_as="court",
         formula="as the court"),
    Case("clip_cuts", "a camera that clips in the midst of the court", partial(clipped, 4.9, 6.0)),
    Case("lens_1_mm", "a lens of 1 mm from near", partial(through_lens, 1.0, 0.3)),
    Case("lens_5_m", "a lens of 5 m from 880 m away", partial(through_lens, 5000.0, 150.0)),
    Case("empty", "a world and nothing in it", nothing, exact=0.3, formula="the world's radiance"),
    Case("one_point", "a mesh with all vertices at one point", one_point, exact=0.3, formula="the world's radiance"),
    Case("one_speck", "a triangle of 6 micrometres fills the picture", one_small_triangle, exact=1.0, formula=ALL_ONE),
    Case("flat", "one plane", flat, exact=LIT, formula=SUNLIT),
    Case("picture_8x1", "a picture of 8 x 1 pixels", furnace, exact=1.0, formula=CLOSED, size=(8, 1)),
    Case("picture_1x8", "a picture of 1 x 8 pixels", furnace, exact=1.0, formula=CLOSED, size=(1, 8)),
    Case("picture_16384", "a picture 16384 pixels wide and one high", furnace, exact=1.0, formula=CLOSED,
         size=(16384, 1), samples=4),
    Case("one_object", "one box", one_object, exact=1.0, formula=ALL_ONE),
    Case("many_objects", "100,000 boxes", partial(many_objects, 100_000), exact=1.0, formula=ALL_ONE, samples=4,
         skipped=dict.fromkeys(("repeat", "translation", "rotation", "scale"), "so many objects take their time")),
)
