# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes written by hand: meshes, materials, lights, cameras."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from addon.materials.graph import MaterialData, WorldData
from addon.scene import CameraData, CameraKind, InstanceData, LightData, LightKind, MeshData, SceneData
from addon.settings import Settings
from blender_tests.material_shader import material, node

Color = tuple[float, float, float]


# Meshes ---------------------------------------------------------------------------------------------------------


def mesh(positions: Any, triangles: Any, name: str = "mesh", **more: Any) -> MeshData:
    """Flat-shaded triangles: every corner has its triangle's normal."""
    positions = np.asarray(positions, np.float32).reshape(-1, 3)
    triangles = np.asarray(triangles, np.int32).reshape(-1, 3)
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0, normals / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
    corners = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    more.setdefault("triangle_slots", np.zeros(len(triangles), np.int32))
    return MeshData(
        name=name, positions=positions, triangle_vertices=triangles, triangle_corners=corners,
        corner_normals=np.repeat(normals, 3, axis=0).astype(np.float32), **more,
    )  # fmt: skip


def soup(corners: Any) -> MeshData:
    """Separate triangles, (T, 3, 3)."""
    corners = np.asarray(corners, np.float32)
    return mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), "soup")


def plane(size: float = 2.0, z: float = 0.0) -> MeshData:
    """A square around the z axis, facing +z, with UV layer "UVMap"."""
    h = 0.5 * size
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]], np.float32)
    return mesh(
        [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]], [[0, 1, 2], [0, 2, 3]], "plane",
        uv_layers={"UVMap": uv}, active_uv="UVMap",
    )  # fmt: skip


def bent(shape: MeshData, normal: Any) -> MeshData:
    """The same with other normals at its corners: (3,) or (C, 3), made unit."""
    normals = np.broadcast_to(np.asarray(normal, np.float64), shape.corner_normals.shape)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return dataclasses.replace(shape, corner_normals=normals.astype(np.float32))


def box(lo: Any = (-1.0, -1.0, -1.0), hi: Any = (1.0, 1.0, 1.0), *, inside_out: bool = False) -> MeshData:
    """A closed box; its triangles face outwards, or inwards."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64)
    lo, hi = np.asarray(lo, np.float64), np.asarray(hi, np.float64)
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    triangles = [[q[0], q[1], q[2]] for q in quads] + [[q[0], q[2], q[3]] for q in quads]
    if inside_out:
        triangles = [[a, c, b] for a, b, c in triangles]
    return mesh(lo + corners * (hi - lo), triangles, "box")


def sphere(radius: float = 1.0, rings: int = 24) -> MeshData:
    """A sphere with smooth normals."""
    theta = np.linspace(0.0, np.pi, rings + 1)
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * rings, endpoint=False)
    points = np.array([[np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)] for t in theta for p in phi])
    n = len(phi)
    triangles = []
    for i in range(rings):
        for j in range(n):
            a, b, c, d = i * n + j, i * n + (j + 1) % n, (i + 1) * n + (j + 1) % n, (i + 1) * n + j
            triangles += [[a, d, c]] * (i < rings - 1) + [[a, c, b]] * (i > 0)
    made = mesh(points * radius, triangles, "sphere")
    made.corner_normals[:] = points[made.triangle_vertices.ravel()]
    return made


# Materials ------------------------------------------------------------------------------------------------------


def _rgba(color: float | Sequence[float]) -> tuple[float, ...]:
    return (*np.broadcast_to(np.asarray(color, float), 3).tolist(), 1.0)


def diffuse(albedo: float | Color = 0.8) -> MaterialData:
    return material(node("D", "BsdfDiffuse", Color=_rgba(albedo)), surface="D.BSDF", name="diffuse")


def emission(radiance: float | Color = 1.0) -> MaterialData:
    return material(node("E", "Emission", Color=_rgba(radiance), Strength=1.0), surface="E.Emission", name="emission")


def glowing(albedo: float | Color, radiance: float | Color) -> MaterialData:
    """Diffuse and emitting."""
    return material(
        node("D", "BsdfDiffuse", Color=_rgba(albedo)), node("E", "Emission", Color=_rgba(radiance), Strength=1.0),
        node("A", "AddShader", Shader="D.BSDF", Shader_001="E.Emission"), surface="A.Shader", name="glowing",
    )  # fmt: skip


def principled(color: float | Color = 0.8, **inputs: Any) -> MaterialData:
    return material(node("P", "BsdfPrincipled", Base_Color=_rgba(color), **inputs), surface="P.BSDF", name="principled")


def world(radiance: float | Color) -> WorldData:
    return WorldData("world", None, tuple(np.broadcast_to(np.asarray(radiance, float), 3).tolist()))  # type: ignore[arg-type]


# Lights and cameras ---------------------------------------------------------------------------------------------


def axes_along(direction: Any) -> np.ndarray:
    """(3, 3) rows x, y, z of something that looks along ``direction`` (its -z)."""
    z = -np.asarray(direction, np.float64)
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z])


def light(
    kind: LightKind,
    intensity: float | Color,
    position: Any = (0.0, 0.0, 0.0),
    direction: Any = (0.0, 0.0, -1.0),
    **more: Any,
) -> LightData:
    """A light at ``position`` that shines along ``direction``."""
    strength = np.broadcast_to(np.asarray(intensity, np.float32), 3).copy()
    return LightData(kind.name, kind, strength, np.asarray(position, np.float64), axes_along(direction), **more)


def camera(
    position: Any = (0.0, 0.0, 3.0),
    target: Any = (0.0, 0.0, 0.0),
    *,
    width: float | None = None,
    angle: float = 0.9,
    aspect: float = 1.0,
    near: float = 0.01,
    far: float = 100.0,
) -> CameraData:
    """Perspective with a full horizontal angle, or orthographic with a width in metres."""
    position, target = np.asarray(position, np.float64), np.asarray(target, np.float64)
    matrix = np.eye(4)
    matrix[:3, :3] = axes_along(target - position).T
    matrix[:3, 3] = position
    clip = np.zeros((4, 4))
    if width is None:
        clip[0, 0] = 1.0 / np.tan(0.5 * angle)
        clip[1, 1] = clip[0, 0] * aspect
        clip[2, 2], clip[2, 3], clip[3, 2] = -(far + near) / (far - near), -2.0 * far * near / (far - near), -1.0
        return CameraData(matrix, clip)
    clip[0, 0], clip[1, 1] = 2.0 / width, 2.0 * aspect / width
    clip[2, 2], clip[2, 3], clip[3, 3] = -2.0 / (far - near), -(far + near) / (far - near), 1.0
    return CameraData(matrix, clip, CameraKind.ORTHOGRAPHIC)


# Scenes ---------------------------------------------------------------------------------------------------------


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, scale: Any = 1.0) -> np.ndarray:
    """A matrix that scales, then moves."""
    matrix = np.diag([*np.broadcast_to(np.asarray(scale, float), 3), 1.0])
    matrix[:3, 3] = (x, y, z)
    return matrix


def scene(
    *objects: tuple[Any, ...],
    lights: Sequence[LightData] = (),
    world: WorldData | None = None,
    camera: CameraData | None = None,
    **more: Any,
) -> SceneData:
    """``objects``: (mesh, material[, matrix[, visibility]]). Meshes and materials given twice are shared."""
    meshes: list[MeshData] = []
    materials: list[MaterialData] = []
    instances = []

    def index(things: list[Any], thing: Any) -> int:
        found = next((i for i, other in enumerate(things) if other is thing), None)
        if found is None:
            things.append(thing)
            found = len(things) - 1
        return found

    for number, (shape, surface, *rest) in enumerate(objects):
        matrix = rest[0] if rest else np.eye(4)
        options = {"visibility": rest[1]} if len(rest) > 1 else {}
        instances.append(
            InstanceData(f"object {number}", index(meshes, shape), matrix, (index(materials, surface),), **options)
        )
    made = camera if camera is not None else globals()["camera"]()
    return SceneData(tuple(meshes), tuple(instances), tuple(materials), tuple(lights), world, made, **more)


def settings(resolution: int = 16, **values: Any) -> Settings:
    """Settings with a fixed resolution of the grid."""
    return Settings(voxel_auto=False, voxel_resolution=resolution, **values)


def cornell() -> SceneData:
    """Five matte walls, two boxes and a lamp under the ceiling; the camera looks in through the open side."""
    white, red, green = diffuse(0.73), diffuse((0.6, 0.06, 0.05)), diffuse((0.12, 0.45, 0.09))
    wall, turned = plane(2.0), box((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3))
    floor = at(z=-1.0)
    ceiling = np.diag([1.0, -1.0, -1.0, 1.0]) + at(z=1.0) - np.eye(4)
    back = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 1.0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
    left = np.array([[0.0, 0, 1.0, -1.0], [0, 1.0, 0, 0], [-1.0, 0, 0, 0], [0, 0, 0, 1.0]])
    right = np.array([[0.0, 0, -1.0, 1.0], [0, 1.0, 0, 0], [1.0, 0, 0, 0], [0, 0, 0, 1.0]])
    return scene(
        (wall, white, floor), (wall, white, ceiling), (wall, white, back), (wall, red, left), (wall, green, right),
        (turned, white, at(-0.35, 0.3, -0.7)), (turned, white, at(0.35, -0.3, -0.7)),
        lights=[light(LightKind.AREA, 8.0, (0.0, 0.0, 0.98), size=(0.5, 0.5))],
        camera=camera((0.0, -4.0, 0.0), (0.0, 0.0, 0.0), angle=0.75),
    )  # fmt: skip
