# SPDX-License-Identifier: GPL-3.0-or-later
"""Many copies of one object, as instances and as one mesh that holds them all."""

from __future__ import annotations

import math
from typing import Any

import bpy
from mathutils import Matrix

from . import build

COUNT = 200


def transforms() -> list[Matrix]:
    """Places of the copies: a spiral, each turned and scaled otherwise."""
    result = []
    for i in range(COUNT):
        angle, radius = 2.4 * i, 0.22 * math.sqrt(i + 0.5)
        place = Matrix.Translation((radius * math.cos(angle), radius * math.sin(angle), 0.15))
        result.append(place @ Matrix.Rotation(angle, 4, "Z") @ Matrix.Diagonal((1, 1, 0.6 + 0.01 * (i % 100), 1)))
    return result


def _thing() -> Any:
    paint = build.diffuse("Paint", (0.7, 0.4, 0.2))
    return build.new_mesh("Thing", build.box_vertices((-0.1, -0.1, -0.15), (0.1, 0.1, 0.15)), build.box_faces(), paint)


def _surroundings() -> Any:
    result = bpy.context.scene
    build.add_plane("Ground", 8.0, build.diffuse("Ground", (0.6, 0.6, 0.6)))
    build.add_light("SUN", (2, -2, 4), energy=2.0, angle=0.05)
    build.set_world((0.4, 0.5, 0.6))
    build.add_camera((0, -7, 5), (0, 0, 0), lens=45.0)
    result.render.resolution_x, result.render.resolution_y = 64, 48
    return result


def scene(how: str) -> Any:
    """``how``: ``objects`` (sharing one mesh), ``collections`` (empties that instance one), ``nodes`` (Instance on
    Points), ``realised`` (one mesh)."""
    build.empty_scene()
    mesh = _thing()
    if how == "objects":
        for i, matrix in enumerate(transforms()):
            build.add_object(f"Copy {i}", mesh).matrix_world = matrix
    elif how == "realised":
        vertices, faces = [], []
        for matrix in transforms():
            first = len(vertices)
            vertices += [matrix @ vertex.co for vertex in mesh.vertices]
            faces += [[first + index for index in face.vertices] for face in mesh.polygons]
        build.add_object("All", build.new_mesh("All", vertices, faces, mesh.materials[0]))
    elif how == "collections":
        kept = bpy.data.collections.new("Kept")
        kept.objects.link(bpy.data.objects.new("Thing", mesh))
        for i, matrix in enumerate(transforms()):
            empty = build.add_object(f"Copy {i}", None)
            empty.instance_type, empty.instance_collection = "COLLECTION", kept
            empty.matrix_world = matrix
    elif how == "nodes":
        _instance_on_points(mesh)
    else:
        raise ValueError(how)
    return _surroundings()


def _instance_on_points(mesh: Any) -> None:
    """Points with rotation and scale as attributes, and nodes that put the object on each."""
    points = bpy.data.meshes.new("Points")
    points.from_pydata([matrix.translation for matrix in transforms()], [], [])
    rotation = points.attributes.new("turn", "FLOAT_VECTOR", "POINT")
    scale = points.attributes.new("size", "FLOAT_VECTOR", "POINT")
    for i, matrix in enumerate(transforms()):
        rotation.data[i].vector = matrix.to_euler()
        scale.data[i].vector = matrix.to_scale()
    hidden = build.add_object("Thing", mesh)
    hidden.hide_render = True

    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    put = tree.nodes.new("GeometryNodeInstanceOnPoints")
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = hidden
    info.inputs["As Instance"].default_value = True
    tree.links.new(start.outputs[0], put.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], put.inputs["Instance"])
    for name, target in (("turn", "Rotation"), ("size", "Scale")):
        attribute = tree.nodes.new("GeometryNodeInputNamedAttribute")
        attribute.data_type = "FLOAT_VECTOR"
        attribute.inputs["Name"].default_value = name
        tree.links.new(attribute.outputs["Attribute"], put.inputs[target])
    tree.links.new(put.outputs[0], end.inputs[0])
    build.add_object("Scatter", points).modifiers.new("Scatter", "NODES").node_group = tree
