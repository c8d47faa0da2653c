# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that are hard on a renderer: thin, doubled, broken, huge, tiny, turned inside out."""

from __future__ import annotations

import math
import random
from functools import partial
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from blender_tests.scenes import build

from . import stage
from .case import Case

ALL_ONE = "all surfaces reflect 0.8 and emit 0.2 under a world of 1: radiance is 1 everywhere"
SUN = 3.0
SUNLIT = "a plane of albedo 0.8 under a sun of 3 W/m2: 3 x 0.8 / pi"
LIT = SUN * stage.ALBEDO / math.pi



def two_rooms(thickness: float, bright: float, dim: float, look_at: str) -> None:
    """Two closed rooms beside each other, a wall between them; in each all radiance is one number."""
    for name, radiance, side in (("bright", bright, -1.0), ("dim", dim, 1.0)):
        material = build.diffuse_and_emission(name, 0.5, 0.5 * radiance)
        centre = side * (1.0 + 0.5 * thickness)
        stage.furnace_room(material, 2.0, name, (centre, 0, 0))
        if name == look_at:
            stage.camera((centre + 0.6 * side, -0.6, 0.1), (centre - side, 0.4, -0.1))


def sheet_between() -> None:
    """Two rooms with a wall of no thickness at all, whose sides emit 0.5 and 0.05."""
    material, tree, surface = build.bare_material("Sheet")
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mix.inputs[0])
    for socket, radiance in ((1, 0.1), (2, 1.0)):
        both = tree.nodes.new("ShaderNodeAddShader")
        matte = build.new_node(tree, "BsdfDiffuse", Color=(0.5, 0.5, 0.5))
        glow = build.new_node(tree, "Emission", Color=build.WHITE, Strength=0.5 * radiance)
        tree.links.new(matte.outputs[0], both.inputs[0])
        tree.links.new(glow.outputs[0], both.inputs[1])
        tree.links.new(both.outputs[0], mix.inputs[socket])
    tree.links.new(mix.outputs[0], surface)
    build.add_quad("Sheet", [(0, -1, -1), (0, 1, -1), (0, 1, 1), (0, -1, 1)], material)
    for name, radiance, side in (("bright", 1.0, -1), ("dim", 0.1, 1)):
        walls = build.diffuse_and_emission(name, 0.5, 0.5 * radiance)
        low, high = ((0, -1, -1), (2, 1, 1)) if side > 0 else ((-2, -1, -1), (0, 1, 1))
        faces = [f for k, f in enumerate(build.box_faces(True)) if k != (4 if side > 0 else 5)]
        build.add_object(name, build.new_mesh(name, build.box_vertices(low, high), faces, walls))
    stage.camera((1.6, -0.6, 0.1), (0, 0.4, -0.1))


def needles(material: Any, count: int = 400, width: float = 0.004) -> None:
    """Triangles two metres long and a few millimetres wide, in all directions."""
    numbers = np.random.default_rng(1)
    corners = []
    for _ in range(count):
        middle, along = numbers.uniform(-1, 1, 3), numbers.normal(size=3)
        along /= np.linalg.norm(along)
        across = np.cross(along, numbers.normal(size=3))
        across *= width / np.linalg.norm(across)
        corners += [middle - along, middle + along, middle + along + across]
    faces = [(3 * k, 3 * k + 1, 3 * k + 2) for k in range(count)]
    build.add_object("Needles", build.new_mesh("Needles", [tuple(c) for c in corners], faces, material))
    stage.camera((3, -2, 1), (0, 0, 0), lens=35)


def fence() -> None:
    """A fence of needles before the court's walls."""
    stage.court()
    metal = build.diffuse("Fence", (0.6, 0.6, 0.6))
    corners = [(x, -1.0, z) for k in range(80) for x, z in ((-2 + k / 20, 0), (-1.98 + k / 20, 0), (-1.99 + k / 20, 2))]
    corners += [(x, -1.0, z) for k in range(40) for x, z in ((-2, k / 20), (-2, k / 20 + 0.02), (2, k / 20 + 0.01))]
    faces = [(3 * k, 3 * k + 1, 3 * k + 2) for k in range(120)]
    build.add_object("Fence", build.new_mesh("Fence", corners, faces, metal))


def sunlit(extra: Any = None, angle: float = 0.0, side: float = 4.0) -> None:
    stage.plane(side=side)
    if extra is not None:
        extra()
    build.add_light("SUN", (0, 0, 5), energy=SUN, angle=angle)
    stage.patch_seen(1.0)


def doubles() -> None:
    for z in (0.0, 0.0):
        build.add_plane("Double", 4.0, build.diffuse("Matte", (stage.ALBEDO,) * 3), z)


def cards() -> None:
    """Planes so near each other that depth buffers and rays take turns."""
    for z in (1e-7, 1e-6, -1e-6, -1e-7):
        build.add_plane("Card", 4.0, build.diffuse("Matte", (stage.ALBEDO,) * 3), z)


def doubled_court() -> None:
    stage.court()
    for thing in [t for t in bpy.context.scene.objects if t.type == "MESH"]:
        twin = build.add_object(thing.name + " twin", thing.data)
        twin.matrix_world = thing.matrix_world


def without_area() -> None:
    """Triangles that are points and lines, in one mesh with a sound one far under the plane."""
    points = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (-1, 0, 1), (0, 0, 1), (1, 0, 1), (1, 1, 1), (1, 1, 1), (0.5, 0.5, 1)]
    points += [(-1, -1, -1), (1, -1, -1), (0, 1, -1), (0, 0, 0.5), (1e-20, 0, 0.5), (0, 1e-20, 0.5)]
    faces = [(3 * k, 3 * k + 1, 3 * k + 2) for k in range(5)]
    build.add_object("Degenerate", build.new_mesh("Degenerate", points, faces, build.diffuse("Grey", (0.5,) * 3)))


def huge_triangle(side: float) -> None:
    """One triangle is the ground of a small box and ball, under sun and sky."""
    grey = build.diffuse("Ground", (0.5, 0.5, 0.5))
    corners = [(side * math.cos(a), side * math.sin(a), 0.0) for a in stage.fan(3)]
    build.add_object("Ground", build.new_mesh("Ground", corners, [(0, 1, 2)], grey))
    build.add_box("Box", (1, 1, 1), (0.6, 0, 0.5), 0.3, build.diffuse("Red", (0.7, 0.2, 0.1)))
    build.add_sphere("Ball", 0.5, (-0.7, 0, 0.5), build.diffuse("White", (0.8, 0.8, 0.8)))
    build.add_light("SUN", (1, -1, 2), energy=SUN, angle=0.05)
    build.set_world((0.3, 0.4, 0.6))
    stage.camera((2.5, -3.0, 2.0), (0, 0, 0.3), lens=35)


def crowd(triangles: int) -> None:
    """The court, and a pebble of many triangles on its floor, smaller than a voxel."""
    stage.court()
    side = math.isqrt(triangles // 2)
    u, v = np.meshgrid(np.linspace(0, 2 * math.pi, side + 1), np.linspace(0, math.pi, side + 1))
    ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
    # Off the lines between voxels of any grid that surrounds the court, as far as can be.
    ball = ball * 0.04 + (0.3, -1.0, 0.06)
    row = np.arange(side)
    first = (row[:, None] * (side + 1) + row).ravel()
    quads = np.stack([first, first + side + 1, first + side + 2, first + 1], axis=1).astype(np.int32)
    mesh = bpy.data.meshes.new("Pebble")
    mesh.vertices.add(len(ball))
    mesh.vertices.foreach_set("co", ball.astype(np.float32).ravel())
    mesh.loops.add(4 * len(quads))
    mesh.loops.foreach_set("vertex_index", quads.ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * len(quads), 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.materials.append(build.diffuse("Pebble", (0.4, 0.4, 0.4)))
    build.add_object("Pebble", mesh)


def flipped_faces(mesh: Any, share: float) -> None:
    """Turns some faces round, one here and one there."""
    numbers = random.Random(7)
    vertices = [tuple(v.co) for v in mesh.vertices]
    faces = [tuple(p.vertices) for p in mesh.polygons]
    faces = [face[::-1] if numbers.random() < share else face for face in faces]
    mesh.clear_geometry()
    mesh.from_pydata(vertices, [], faces)
    mesh.update()


def flipped_furnace() -> None:
    room = build.add_sphere("Room", 1.0, (0, 0, 0), build.diffuse_and_emission("Wall", 0.8, 0.2), segments=24)
    flipped_faces(room.data, 0.5)
    stage.camera((-0.4, -0.5, -0.1), (0.5, 0.5, 0.1), lens=18)


def flipped_court(share: float) -> None:
    stage.court()
    for thing in bpy.context.scene.objects:
        if thing.type == "MESH" and thing.name != "Ball":  # flat shading: corner normals are those of faces
            flipped_faces(thing.data, share)


def odd_meshes(material: Any) -> None:
    """An open bowl, a Moebius strip, three sheets on one edge, two cones that share a point."""
    bowl = build.sphere_mesh("Bowl", 0.6, material, segments=16)
    sides = [tuple(p.vertices) for p in bowl.polygons if p.center.z < 0.1]
    points = [tuple(v.co) for v in bowl.vertices]
    build.add_object("Bowl", build.new_mesh("Open", points, sides, material), (-0.9, 0.6, 0.7))
    strip = []
    for k in range(24):
        turn, twist = 2 * math.pi * k / 24, math.pi * k / 24
        for side in (-0.2, 0.2):
            r = 0.5 + side * math.cos(twist)
            strip.append((r * math.cos(turn), r * math.sin(turn), side * math.sin(twist)))
    faces = [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(23)] + [(46, 47, 0, 1)]
    build.add_object("Strip", build.new_mesh("Strip", strip, faces, material), (0.8, 0.6, 0.7))
    edge = [(0, 0, 0), (0, 0, 1)] + [(0.6 * math.cos(a), 0.6 * math.sin(a), z) for a in stage.fan(3) for z in (0, 1)]
    sheets = [(0, 1, 3 + 2 * k, 2 + 2 * k) for k in range(3)]
    build.add_object("Sheets", build.new_mesh("Sheets", edge, sheets, material), (0, -0.8, 0.05))
    rim = [(0, 0, 0)] + [(0.3 * math.cos(a), 0.3 * math.sin(a), z) for z in (-0.4, 0.4) for a in stage.fan(8)]
    cones = [(0, 1 + k + 8 * h, 1 + (k + 1) % 8 + 8 * h) for h in (0, 1) for k in range(8)]
    build.add_object("Cones", build.new_mesh("Cones", rim, cones, material), (1.0, -0.8, 0.5))


def odd_furnace() -> None:
    odd_meshes(stage.white_world())
    stage.court_camera()


def odd_court() -> None:
    stage.court()
    for name in ("Box", "Ball"):
        bpy.data.objects.remove(bpy.data.objects[name])
    odd_meshes(build.diffuse("Odd", (0.6, 0.6, 0.7)))


def crossing_boxes(material: Any) -> None:
    numbers = random.Random(3)
    for k in range(8):
        place = [numbers.uniform(-0.5, 0.5) for _ in range(2)] + [numbers.uniform(0.3, 1.0)]
        box = build.add_box(f"Box {k}", (1.2, 0.5, 0.4), place, 0.0, material)
        box.rotation_euler = [numbers.uniform(0, 3) for _ in range(3)]


def crossing_furnace() -> None:
    crossing_boxes(stage.white_world())
    stage.court_camera()


def crossing_court() -> None:
    stage.court()
    for name in ("Box", "Ball"):
        bpy.data.objects.remove(bpy.data.objects[name])
    crossing_boxes(build.diffuse("Crossing", (0.6, 0.6, 0.7)))


def placed_court(box: Matrix, ball: Matrix) -> None:
    """The court with other matrices on its box and its ball, as only a chain of parents can have them."""
    stage.court()
    for name, matrix in (("Box", box), ("Ball", ball)):
        thing = bpy.data.objects[name]
        parent = build.add_object(f"{name} parent", None, thing.location)
        _, turn, size = matrix.decompose()
        parent.scale = size
        parent.rotation_euler = turn.to_euler()
        thing.location = (0, 0, 0)
        thing.parent = parent


def sheared_court() -> None:
    """Turned inside parents that are scaled unevenly: shear, which no object has by itself."""
    squash = Matrix.Diagonal((1.5, 0.6, 1.0, 1.0))
    placed_court(squash, squash)
    bpy.data.objects["Ball"].rotation_euler = (0.5, 0.6, 0.7)


def flat_scale_court() -> None:
    """The ball has no height: a disk."""
    stage.court()
    bpy.data.objects["Ball"].scale = (1.0, 1.0, 0.0)


def disk_court() -> None:
    """A disk of the ball's outline in its place."""
    stage.court()
    ball = bpy.data.objects["Ball"]
    points = np.array([vertex.co for vertex in ball.data.vertices])[:, :2]
    reach = np.hypot(*points.T)
    ring = points[reach > 0.999 * reach.max()]
    ring = ring[np.argsort(np.arctan2(ring[:, 1], ring[:, 0]))]
    disk = build.new_mesh("Disk", [(x, y, 0.0) for x, y in ring.tolist()], [tuple(range(len(ring)))],
                          ball.data.materials[0])
    build.add_object("Disk", disk, ball.location)
    bpy.data.objects.remove(ball)


def no_scale_court() -> None:
    """An object of no size at all stands in the court."""
    stage.court()
    build.add_sphere("Nothing", 0.5, (0.2, -0.8, 0.5), build.diffuse("Nothing", (0.9, 0.1, 0.1))).scale = (0, 0, 0)


CASES = (
    Case("wall_one_voxel", "a dim closed room behind a wall one voxel thick, a room 100 times as bright beyond",
         partial(two_rooms, 0.14, 1.0, 0.01, "dim"), exact=0.01, formula="closed, emission half of the radiance"),
    Case("wall_quarter_voxel", "the same behind a wall a quarter of a voxel thick",
         partial(two_rooms, 0.034, 1.0, 0.01, "dim"), exact=0.01, formula="as before"),
    Case("wall_paper", "the same behind paper, 0.1 mm",
         partial(two_rooms, 1e-4, 1.0, 0.01, "dim"), exact=0.01, formula="as before"),
    Case("wall_paper_bright", "the bright room behind the paper",
         partial(two_rooms, 1e-4, 1.0, 0.01, "bright"), exact=1.0, formula="as before"),
    Case("wall_sheet", "two rooms of radiance 1 and 0.1, between them one sheet whose two sides differ", sheet_between,
         exact=0.1, formula="as before"),
    Case("bright_neighbour", "a room of radiance 0.001 beside one of a million, behind a wall two voxels thick",
         partial(two_rooms, 0.28, 1e6, 1e-3, "dim"), exact=1e-3, formula="as before"),
    Case("needles", "400 triangles 2 m long and 4 mm wide", lambda: needles(stage.white_world()), exact=1.0,
         formula=ALL_ONE),
    Case("needle_fence", "a grid of needles before the court", fence),
    Case("coplanar_doubles", "a plane three times at the same place", lambda: sunlit(doubles), exact=LIT,
         formula=SUNLIT),
    Case("doubled_court", "all of the court twice at the same place", doubled_court, same_as="court",
         formula="as the court"),
    Case("z_fighting", "five planes within 2 micrometres", lambda: sunlit(cards), exact=LIT, formula=SUNLIT),
    Case("no_area", "triangles that are points and lines above a plane", lambda: sunlit(without_area), exact=LIT,
         formula=SUNLIT),
    Case("huge_triangle", "one triangle 200 m wide covers the scene", partial(huge_triangle, 100.0)),
    Case("horizon_triangle", "one triangle 20 km wide under a box of 1 m", partial(huge_triangle, 1e4)),
    Case("crowded_voxel", "a pebble of a million triangles inside one voxel", partial(crowd, 1_000_000),
         same_as="crowded_voxel_few", formula="as the pebble of 200 triangles",
         skipped=dict.fromkeys(("translation", "scale"), "a million triangles take their time")),
    Case("crowded_voxel_few", "a pebble of 200 triangles", partial(crowd, 200)),
    Case("flipped_furnace", "a closed sphere, every second face turned round", flipped_furnace, exact=1.0,
         formula="closed, walls reflect 0.8 and emit 0.2"),
    Case("flipped_court", "the court, all faces of walls and box turned round", partial(flipped_court, 1.0),
         same_as="court", formula="as the court"),
    Case("odd_furnace", "open and non-manifold meshes", odd_furnace, exact=1.0, formula=ALL_ONE),
    Case("odd_court", "open and non-manifold meshes in the court", odd_court),
    Case("crossing_furnace", "eight boxes through each other", crossing_furnace, exact=1.0, formula=ALL_ONE),
    Case("crossing_court", "eight boxes through each other in the court", crossing_court),
    Case("negative_scale", "box and ball mirrored",
         partial(placed_court, Matrix.Diagonal((-1, 1, 1, 1)), Matrix.Diagonal((-1, -1, -1, 1)))),
    Case("uneven_scale", "box and ball 4 times as wide as high",
         partial(placed_court, Matrix.Diagonal((1.2, 0.3, 1, 1)), Matrix.Diagonal((0.25, 1, 1, 1)))),
    Case("shear", "box and ball sheared", sheared_court),
    Case("flat_scale", "a ball with a scale of 0 along z", flat_scale_court, same_as="flat_disk",
         formula="as the disk (of the ball's two sides, at one place, each shades the other in Cycles)"),
    Case("flat_disk", "a disk in its place", disk_court),
    Case("no_scale", "a ball with a scale of 0", no_scale_court, same_as="court", formula="as the court"),
)
