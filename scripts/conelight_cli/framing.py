# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera for a scene that has none: around it, or inside it where the scene is a room."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from mathutils import Matrix, Vector

Array = npt.NDArray[np.float64]

LENS_OUTSIDE = 35.0  # millimetres, on Blender's sensor of 36 mm
LENS_INSIDE = 22.0
SENSOR = 36.0
MARGIN = 1.06  # free space around everything, as a factor on its size in the picture
#: From the scene towards the camera: right of the front (-y), a little above.
THREE_QUARTER = np.array([math.sin(math.radians(35.0)), -math.cos(math.radians(35.0)), math.tan(math.radians(20.0))])
ROOM_SHARE = 0.75  # of the directions around a place in a room that see the front of a surface
ROOM_PLACES = 0.4  # of the places that are free, where the scene is a room
GRID = (0.1, 0.3, 0.5, 0.7, 0.9)  # places that are tried, as fractions of the scene's size across
EYE_LEVELS = (0.4, 0.6, 0.75)  # and of its height
SURFACES = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD", "VOLUME"}


@dataclass(frozen=True)
class View:
    """Where the new camera is."""

    position: Array  # (3,) metres, world
    forward: Array  # (3,) unit
    lens: float  # millimetres
    is_inside: bool


def add_camera(scene: Any) -> View | None:
    """Gives the scene a camera that shows everything. None: nothing is there to show, the camera is at the origin."""
    graph = bpy.context.evaluated_depsgraph_get()
    corners = surface_corners(graph)
    view = None
    if len(corners):
        view = inside_view(scene, graph, corners) or outside_view(corners, half_angles(scene.render, LENS_OUTSIDE))
    data = bpy.data.cameras.new("Framing Camera")
    camera = bpy.data.objects.new("Framing Camera", data)
    data.sensor_width = SENSOR
    chosen = view or View(np.zeros(3), np.array([0.0, 1.0, 0.0]), LENS_OUTSIDE, False)
    data.lens = chosen.lens
    if len(corners):
        depths = np.linalg.norm(corners - chosen.position, axis=1)
        size = float(np.linalg.norm(corners.max(0) - corners.min(0))) or 1.0
        data.clip_start = max(size / 1e4, 1e-6)
        data.clip_end = float(np.max(depths)) * 2.0 + size
    axes = np.stack(camera_axes(chosen.forward), axis=1)
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    matrix[:3, 3] = chosen.position
    camera.matrix_world = Matrix(matrix.tolist())
    scene.collection.objects.link(camera)
    scene.camera = camera
    return view


def surface_corners(graph: Any) -> Array:
    """(N, 3) corners of the bounding boxes of everything that can be seen, world space, finite ones only."""
    corners = [np.empty((0, 3))]
    for instance in graph.object_instances:
        thing = instance.object
        if thing.type not in SURFACES or thing.original.hide_render or not instance.show_self:
            continue
        if thing.type == "MESH" and not thing.data.vertices:
            continue
        box = np.array([corner[:] for corner in thing.bound_box], dtype=np.float64)
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        with np.errstate(all="ignore"):
            corners.append(box @ matrix[:3, :3].T + matrix[:3, 3])
    everything = np.concatenate(corners)
    # float32 overflows in squared lengths beyond 1e18: such coordinates are as broken as infinite ones
    return everything[(np.abs(everything) < 1e15).all(axis=1)]


def camera_axes(forward: Array) -> tuple[Array, Array, Array]:
    """Right, up and backward unit vectors of a camera that looks along ``forward`` and is upright."""
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    return right, np.cross(right, forward), -forward


def half_angles(render: Any, lens: float) -> tuple[float, float]:
    """Tangents of half the angle of view, across and up. Blender fits the sensor to the longer side of the picture."""
    width = render.resolution_x * render.pixel_aspect_x
    height = render.resolution_y * render.pixel_aspect_y
    longer = 0.5 * SENSOR / lens
    return longer * min(1.0, width / height), longer * min(1.0, height / width)


def outside_view(corners: Array, tangents: tuple[float, float]) -> View:
    """A view from three quarters in which all ``corners`` (N, 3) just fit."""
    forward = -THREE_QUARTER / np.linalg.norm(THREE_QUARTER)
    right, up, _ = camera_axes(forward)
    middle = 0.5 * (corners.min(0) + corners.max(0))
    if np.max(np.ptp(corners, axis=0)) <= 0.0:  # one point: as if it had a radius of a metre
        corners = middle + np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    offsets = corners - middle
    depth = offsets @ forward
    # A corner at depth d + x appears at right / (d + x); it must stay inside the tangent.
    position = middle
    distance = 0.0
    for axis, tangent in ((right, tangents[0]), (up, tangents[1])):
        across = offsets @ axis
        # Both borders of the picture touch a corner when the camera moves sideways by ``shift``.
        plus = float(np.max(across * MARGIN / tangent - depth))
        minus = float(np.max(-across * MARGIN / tangent - depth))
        shift = 0.5 * (plus - minus) * tangent / MARGIN
        position = position + shift * axis
        distance = max(distance, 0.5 * (plus + minus))
    return View(position - distance * forward, forward, LENS_OUTSIDE, False)


def directions_around(count: int) -> Array:
    """(count, 3) unit vectors, evenly over the sphere (Fibonacci spiral)."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    angle = math.pi * (1.0 + math.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)


def inside_view(scene: Any, graph: Any, corners: Array) -> View | None:
    """A view from inside, from the place that sees most of the room; None where the scene is not a room.

    From a place in a room, nearly all directions see the front of a surface; from inside a solid thing they see backs,
    and in the open many see nothing.
    """
    low, high = corners.min(0), corners.max(0)
    size = float(np.linalg.norm(high - low))
    if not size > 0.0:
        return None

    def seen(origin: Array, direction: Array) -> tuple[float, bool]:
        """Distance to the surface in a direction (infinite: none), and whether its front is seen."""
        hit, place, normal, _, _, _ = scene.ray_cast(graph, Vector(origin), Vector(direction), distance=2.0 * size)
        if not hit:
            return math.inf, False
        return float(np.linalg.norm(np.array(place) - origin)), float(np.dot(np.array(normal), direction)) < 0.0

    around = directions_around(64)
    grid = [low + (high - low) * fractions for fractions in itertools.product(GRID, GRID, EYE_LEVELS)]
    free, room = 0, []
    for place in grid:
        views = [seen(place, direction) for direction in around]
        fronts = sum(is_front for _, is_front in views)
        backs = sum(not is_front and distance < math.inf for distance, is_front in views)
        if backs <= 0.1 * len(around):
            free += 1
            if fronts >= ROOM_SHARE * len(around):
                room.append(place)
    if len(room) < ROOM_PLACES * max(free, 1):
        return None

    tangents = half_angles(scene.render, LENS_INSIDE)
    best: View | None = None
    best_score = -math.inf
    for place, angle in itertools.product(room, np.arange(8) * (math.pi / 4.0) + math.pi / 8.0):
        back = np.array([math.cos(angle), math.sin(angle), 0.0])
        distance, is_front = seen(place, back)
        if not is_front:
            continue
        position = place + back * (0.85 * distance)
        forward = -back + np.array([0.0, 0.0, -0.08])
        forward /= np.linalg.norm(forward)
        right, up, _ = camera_axes(forward)
        score = 0.0
        for x, y in itertools.product(np.linspace(-0.9, 0.9, 5), np.linspace(-0.9, 0.9, 4)):
            ray = forward + right * (x * tangents[0]) + up * (y * tangents[1])
            depth, is_front = seen(position, ray / np.linalg.norm(ray))
            score += (min(depth / size, 1.0) if is_front else -0.5) if depth < math.inf else 0.0
        if score > best_score:
            best, best_score = View(position, forward, LENS_INSIDE, True), score
    return best
