# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles and attributes of one evaluated mesh, copied into numpy.

Everything is read with ``foreach_get`` into arrays of the attribute's own type (any other type makes Blender convert
number by number), and from attributes rather than from vertices, loops and polygons, which cost 10 to 100 times more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ...scene import FloatArray, IntArray, MeshData

#: Metres. Coordinates beyond it overflow float32 once they are multiplied with each other.
FARTHEST = 1e15


@dataclass(frozen=True)
class ExtractedMesh:
    data: MeshData | None  # None: no triangle is left
    bad_triangles: int  # how many were dropped because a vertex is not there, NaN, infinite or beyond FARTHEST


def extract_mesh(mesh: bpy.types.Mesh, slot_count: int) -> ExtractedMesh:
    """The triangles of an evaluated mesh. ``slot_count`` is the number of material slots of the object that has it.

    Triangles without area, and those with an impossible vertex, are left out.
    """
    lost = _drop_damaged_faces(mesh)
    mesh.calc_loop_triangles()
    if len(mesh.loop_triangles) == 0:
        return ExtractedMesh(None, lost)
    positions = _positions(mesh)
    corner_vertices = _corner_vertices(mesh)
    triangle_corners = _read(mesh.loop_triangles, "loops", np.int32, 3)
    triangle_vertices = corner_vertices[triangle_corners]
    slots = _triangle_slots(mesh, slot_count)

    good_vertex = (np.abs(positions) <= FARTHEST).all(axis=1)  # False for NaN
    bad_triangles = lost
    if not good_vertex.all():
        # A good place for the bad vertices, lest they spoil the bounds.
        positions[~good_vertex] = positions[int(np.argmax(good_vertex))] if good_vertex.any() else 0.0
        good = good_vertex[triangle_vertices].all(axis=1)
        bad_triangles += len(good) - int(good.sum())
        triangle_corners, triangle_vertices, slots = triangle_corners[good], triangle_vertices[good], slots[good]
    sound = _has_area(positions, triangle_vertices)
    if not sound.all():
        triangle_corners, triangle_vertices, slots = triangle_corners[sound], triangle_vertices[sound], slots[sound]
    if len(triangle_vertices) == 0:
        return ExtractedMesh(None, bad_triangles)

    uv_layers = _uv_layers(mesh, corner_vertices)
    color_layers = _color_layers(mesh, corner_vertices)
    data = MeshData(
        name=mesh.name,
        positions=positions,
        triangle_vertices=triangle_vertices,
        triangle_corners=triangle_corners,
        corner_normals=_corner_normals(mesh, positions, triangle_vertices, triangle_corners),
        triangle_slots=slots,
        uv_layers=uv_layers,
        color_layers=color_layers,
        active_uv=next((layer.name for layer in mesh.uv_layers if layer.active_render), next(iter(uv_layers), None)),
        active_color=_active_color(mesh, color_layers),
        generated_bounds=_generated_bounds(mesh),
    )
    return ExtractedMesh(data, bad_triangles)


def _read(collection: Any, name: str, dtype: type, width: int = 1) -> npt.NDArray[Any]:
    """Property ``name`` of every item: (N,) for width 1, else (N, width)."""
    values: npt.NDArray[Any] = np.empty(len(collection) * width, dtype)
    collection.foreach_get(name, values)
    return values if width == 1 else values.reshape(-1, width)


def _positions(mesh: bpy.types.Mesh) -> FloatArray:
    attribute = mesh.attributes.get("position")
    if attribute is not None:
        return _read(attribute.data, "vector", np.float32, 3)
    return _read(mesh.vertices, "co", np.float32, 3)


def _corner_vertices(mesh: bpy.types.Mesh) -> IntArray:
    attribute = mesh.attributes.get(".corner_vert")
    if attribute is not None:
        return _read(attribute.data, "value", np.int32)
    return _read(mesh.loops, "vertex_index", np.int32)


def _drop_damaged_faces(mesh: bpy.types.Mesh) -> int:
    """Faces of a damaged file or a careless script may refer to corners or vertices that are not there, and Blender
    would read beyond its arrays.

    Returns how many triangles went, about.
    """
    corner_vertices, starts = _corner_vertices(mesh), _read(mesh.polygons, "loop_start", np.int32)
    has_corners = len(starts) == 0 or (
        starts[0] == 0 and bool((np.diff(starts) >= 3).all()) and starts[-1] <= len(corner_vertices) - 3
    )
    has_vertices = ((corner_vertices >= 0) & (corner_vertices < len(mesh.vertices))).all()
    if has_corners and has_vertices:
        return 0
    before = len(mesh.polygons)
    mesh.validate()
    return max(before - len(mesh.polygons), 1)


def _triangle_slots(mesh: bpy.types.Mesh, slot_count: int) -> IntArray:
    """(T,) material slot of each triangle. No attribute means slot 0; a slot that does not exist means the last one."""
    attribute = mesh.attributes.get("material_index")
    if slot_count < 2 or attribute is None or attribute.domain != "FACE" or attribute.data_type != "INT":
        return np.zeros(len(mesh.loop_triangles), np.int32)
    faces = _read(mesh.loop_triangle_polygons, "value", np.int32)
    slots: IntArray = np.clip(_read(attribute.data, "value", np.int32), 0, slot_count - 1)[faces]
    return slots


def _has_area(positions: FloatArray, triangles: IntArray) -> npt.NDArray[np.bool_]:
    """(T,) whether the cross product of two edges has any component that is not 0."""
    first = positions[triangles[:, 0]]
    a = positions[triangles[:, 1]] - first
    b = positions[triangles[:, 2]] - first
    result: npt.NDArray[np.bool_] = a[:, 1] * b[:, 2] != a[:, 2] * b[:, 1]
    result |= a[:, 2] * b[:, 0] != a[:, 0] * b[:, 2]
    result |= a[:, 0] * b[:, 1] != a[:, 1] * b[:, 0]
    return result


def _corner_normals(
    mesh: bpy.types.Mesh, positions: FloatArray, triangle_vertices: IntArray, triangle_corners: IntArray
) -> FloatArray:
    """(C, 3) unit. Where Blender has no normal (next to bad vertices), that of a triangle that uses the corner."""
    normals: FloatArray = _read(mesh.corner_normals, "vector", np.float32, 3)
    length = np.einsum("ij,ij->i", normals, normals)
    bad = ~((length > 0.5) & (length < 2.0))
    if bad.any():
        normals[bad] = (0.0, 0.0, 1.0)
        affected = bad[triangle_corners].any(axis=1)
        first, second, third = (positions[triangle_vertices[affected, k]].astype(np.float64) for k in range(3))
        flat = np.cross(second - first, third - first)
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        corners = triangle_corners[affected]
        for k in range(3):
            lacking = bad[corners[:, k]]
            normals[corners[lacking, k]] = flat[lacking]
    return normals


def _per_corner(values: FloatArray, domain: str, mesh: bpy.types.Mesh, corner_vertices: IntArray) -> FloatArray:
    """Values of a POINT, FACE or CORNER attribute, repeated for each corner; NaN and infinities become 0."""
    if not np.isfinite(values).all():
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    if domain == "POINT":
        return values[corner_vertices]
    if domain == "FACE":
        return np.repeat(values, _read(mesh.polygons, "loop_total", np.int32), axis=0)
    return values


def _uv_layers(mesh: bpy.types.Mesh, corner_vertices: IntArray) -> dict[str, FloatArray]:
    """name -> (C, 2). UV maps, and 2D vectors on points or faces: nodes read those under the same names."""
    layers = {
        layer.name: _per_corner(_read(layer.uv, "vector", np.float32, 2), "CORNER", mesh, corner_vertices)
        for layer in mesh.uv_layers
        if len(layer.uv) == len(corner_vertices)
    }
    for attribute in mesh.attributes:
        if attribute.data_type == "FLOAT2" and attribute.domain in ("POINT", "FACE"):
            values = _read(attribute.data, "vector", np.float32, 2)
            layers[attribute.name] = _per_corner(values, attribute.domain, mesh, corner_vertices)
    return layers


def _color_layers(mesh: bpy.types.Mesh, corner_vertices: IntArray) -> dict[str, FloatArray]:
    """name -> (C, 4) linear: Blender's ``color`` is linear for byte colours too."""
    layers = {}
    for attribute in mesh.attributes:
        if attribute.data_type in ("FLOAT_COLOR", "BYTE_COLOR") and attribute.domain in ("POINT", "FACE", "CORNER"):
            values = _read(attribute.data, "color", np.float32, 4)
            layers[attribute.name] = _per_corner(values, attribute.domain, mesh, corner_vertices)
    return layers


def _active_color(mesh: bpy.types.Mesh, layers: dict[str, FloatArray]) -> str | None:
    """The colour attribute that renders by default."""
    index = mesh.color_attributes.render_color_index
    if 0 <= index < len(mesh.color_attributes):
        name: str = mesh.color_attributes[index].name
        if name in layers:
            return name
    return next(iter(layers), None)


def _generated_bounds(mesh: bpy.types.Mesh) -> FloatArray | None:
    """(2, 3) the texture space, where the user has set one; None: it is the bounds."""
    if mesh.use_auto_texspace:
        return None
    centre = np.array(mesh.texspace_location, np.float32)
    half = np.array(mesh.texspace_size, np.float32)
    return np.stack([centre - half, centre + half])
