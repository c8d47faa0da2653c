# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that is placed in the scene: instances of meshes, and lights.

``depsgraph.object_instances`` lists real objects and all instances of collections, vertices, faces, particles and
Geometry Nodes alike. Curves, surfaces, texts and metaballs come twice: as themselves, and as an instance of the mesh
that Blender has made of them; only the mesh is taken. Nothing of Blender's outlives the functions of this file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...materials.graph import MaterialData
from ...scene import DoubleArray, InstanceData, LightData, MeshData, RayVisibility
from .light import extract_light
from .mesh import FARTHEST, extract_mesh

_UNSUPPORTED = {
    "CURVES": "hair curves are",
    "POINTCLOUD": "point clouds are",
    "VOLUME": "volumes are",
    "GREASEPENCIL": "grease pencil strokes are",
    "GPENCIL": "grease pencil strokes are",
}
#: An instance whose axes span less than this fraction of their box is flat: it has no inverse.
_FLAT = 1e-12


class MaterialTable:
    """The materials in use, each converted once, in the order of first use."""

    def __init__(self, convert: Callable[[bpy.types.Material], MaterialData]) -> None:
        self._convert = convert
        self._indices: dict[int, int] = {}
        self.materials: list[MaterialData] = []

    def index_of(self, material: bpy.types.Material | None) -> int:
        """Index of a material; None gives the grey of Blender's empty slots."""
        key = material.original.session_uid if material is not None else 0  # evaluated copies have 0
        if key not in self._indices:
            self._indices[key] = len(self.materials)
            default = MaterialData("Default", graph=None)
            self.materials.append(self._convert(material) if material is not None else default)
        return self._indices[key]


class MeshTable:
    """The meshes in use, each read once.

    They are told apart by their address, which is theirs for as long as the depsgraph is not evaluated again, and by
    the number of material slots, because slot numbers beyond it are clamped.
    """

    def __init__(self) -> None:
        self._entries: dict[tuple[int, int], tuple[int | None, tuple[int, ...]]] = {}
        self.meshes: list[MeshData] = []

    def add(self, obj: bpy.types.Object, slot_count: int, warnings: list[str]) -> tuple[int | None, tuple[int, ...]]:
        """Index of the object's mesh (None: it has no triangles), and the slots that its triangles use."""
        key = (obj.data.as_pointer(), slot_count)
        if key not in self._entries:
            extracted = extract_mesh(obj.data, slot_count)
            if extracted.bad_triangles:
                warnings.append(
                    f'object "{obj.name}": triangles left out because a vertex is not finite or beyond '
                    f"{FARTHEST:g} m: {extracted.bad_triangles}"
                )
            if extracted.data is None:
                self._entries[key] = (None, ())
            else:
                used = np.flatnonzero(np.bincount(extracted.data.triangle_slots))
                self._entries[key] = (len(self.meshes), tuple(used.tolist()))
                self.meshes.append(extracted.data)
        return self._entries[key]


@dataclass(frozen=True)
class Placements:
    """What :func:`extract_placements` collects."""

    meshes: list[MeshData]
    instances: list[InstanceData]
    lights: list[LightData]


@dataclass(frozen=True)
class _Prepared:
    """What all instances of one object's mesh share."""

    name: str
    mesh: int | None
    materials: tuple[int, ...] = ()
    visibility: RayVisibility = RayVisibility.ALL
    is_holdout: bool = False
    object_index: int = 0


def extract_placements(depsgraph: bpy.types.Depsgraph, materials: MaterialTable, warnings: list[str]) -> Placements:
    """All meshes, instances and lights that the depsgraph shows in its mode (render or viewport)."""
    meshes = MeshTable()
    instances: list[InstanceData] = []
    lights: list[LightData] = []
    prepared: dict[tuple[int, int, int], _Prepared] = {}
    skipped: Counter[tuple[str, str]] = Counter()
    # Matrices and flags of all items at once: one call costs less than a hundred items one by one.
    items = depsgraph.object_instances
    count = len(items)
    matrices, problems = _matrices(items, count)
    shown = np.empty(count, bool)
    items.foreach_get("show_self", shown)
    randoms = np.empty(count, np.int32)
    items.foreach_get("random_id", randoms)
    fractions = np.minimum(randoms.view(np.uint32) / 0xFFFFFFFF, np.nextafter(1.0, 0.0)).tolist()

    for i, item in enumerate(items):
        if not shown[i]:
            continue
        obj = item.object
        kind = obj.type
        if kind == "MESH":
            parent = item.parent if item.is_instance else None
            # Evaluated copies have no session_uid, and instances have no address that lasts.
            key = (
                obj.original.session_uid,
                obj.data.as_pointer(),
                parent.original.session_uid if parent is not None else 0,
            )
            entry = prepared.get(key)
            if entry is None:
                entry = prepared[key] = _prepare(obj, parent, depsgraph, materials, meshes, warnings)
            if entry.mesh is None:
                continue
            if problems[i]:
                skipped[entry.name, problems[i]] += 1
                continue
            instances.append(
                InstanceData(
                    name=entry.name,
                    mesh=entry.mesh,
                    world_from_object=matrices[i],
                    materials=entry.materials,
                    visibility=entry.visibility,
                    is_holdout=entry.is_holdout,
                    object_index=entry.object_index,
                    random=fractions[i] if parent is not None else name_random(entry.name),
                )
            )
        elif kind == "LIGHT":
            parent = item.parent if item.is_instance else None
            if problems[i]:
                skipped[obj.name, problems[i]] += 1
                continue
            light = extract_light(obj, matrices[i], _visibility(obj, parent), warnings)
            if light is not None:
                lights.append(light)
        elif kind in _UNSUPPORTED:
            _warn_once(warnings, f'object "{obj.name}": {_UNSUPPORTED[kind]} not supported; left out')
    for (name, problem), times in skipped.items():
        warnings.append(f'object "{name}": {problem}; left out' + (f" ({times} instances)" if times > 1 else ""))
    return Placements(meshes.meshes, instances, lights)


def name_random(name: str) -> float:
    """Object Info > Random of an object that is no instance, in [0, 1): the same hash of the name as Cycles'.

    Bob Jenkins, lookup3 (2006), the final mix of two words; the words are a polynomial hash of the name, and 0.
    """
    word = 0
    for byte in name.encode():
        word = (word * 37 + byte) & 0xFFFFFFFF
    a = b = c = (0xDEADBEEF + (2 << 2) + 13) & 0xFFFFFFFF
    a = (a + word) & 0xFFFFFFFF
    c = _mix(c, b, 14)
    a = _mix(a, c, 11)
    b = _mix(b, a, 25)
    c = _mix(c, b, 16)
    a = _mix(a, c, 4)
    b = _mix(b, a, 14)
    c = _mix(c, b, 24)
    return min(c / 0xFFFFFFFF, float(np.nextafter(1.0, 0.0)))


def _mix(x: int, y: int, bits: int) -> int:
    rotated = (y << bits | y >> (32 - bits)) & 0xFFFFFFFF
    return ((x ^ y) - rotated) & 0xFFFFFFFF


def _matrices(items: Any, count: int) -> tuple[DoubleArray, list[str]]:
    """(N, 4, 4) world from object of all items, and what is wrong with each of them ("" for nothing)."""
    flat = np.empty(count * 16, np.float32)
    items.foreach_get("matrix_world", flat)
    matrices = flat.reshape(count, 4, 4).transpose(0, 2, 1).astype(np.float64)  # Blender stores columns
    usable = (np.abs(matrices) <= FARTHEST).all(axis=(1, 2))  # False for NaN
    axes = np.where(usable[:, None, None], matrices[:, :3, :3], np.eye(3))
    box = np.prod(np.linalg.norm(axes, axis=1), axis=1)
    flattened = np.abs(np.linalg.det(axes)) <= _FLAT * box
    problems = np.where(flattened, "its scale is 0 along an axis", "")
    problems = np.where(usable, problems, "its position, rotation or scale is not a usable number")
    return matrices, problems.tolist()


def _prepare(
    obj: bpy.types.Object,
    parent: bpy.types.Object | None,
    depsgraph: bpy.types.Depsgraph,
    materials: MaterialTable,
    meshes: MeshTable,
    warnings: list[str],
) -> _Prepared:
    """Mesh, materials and flags of one object below one instancer."""
    name = obj.name
    for system in obj.particle_systems:
        if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
            _warn_once(warnings, f'object "{name}": hair is not supported; left out')
    view_layer = depsgraph.view_layer_eval
    instancer = parent if parent is not None else obj
    is_holdout = obj.is_holdout or instancer.holdout_get(view_layer=view_layer)
    visibility = _visibility(obj, parent)
    if instancer.indirect_only_get(view_layer=view_layer):
        visibility &= ~RayVisibility.CAMERA
    if not visibility:
        return _Prepared(name, None)

    slots = [slot.material for slot in obj.material_slots]
    mesh, used_slots = meshes.add(obj, len(slots), warnings)
    if mesh is None:
        return _Prepared(name, None)
    return _Prepared(
        name=name,
        mesh=mesh,
        materials=_materials_of(slots, used_slots, view_layer.material_override, materials),
        visibility=visibility,
        is_holdout=is_holdout,
        object_index=obj.pass_index,
    )


def _materials_of(
    slots: list[bpy.types.Material | None],
    used: tuple[int, ...],
    override: bpy.types.Material | None,
    materials: MaterialTable,
) -> tuple[int, ...]:
    """Material of each slot. Slots that no triangle uses repeat another's, so that unused materials cost nothing."""
    if override is not None:
        return (materials.index_of(override),) * max(len(slots), 1)
    if not slots:
        return (materials.index_of(None),)
    indices = {slot: materials.index_of(slots[slot]) for slot in used}
    return tuple(indices.get(slot, indices[used[0]]) for slot in range(len(slots)))


def _visibility(obj: bpy.types.Object, parent: bpy.types.Object | None) -> RayVisibility:
    """Rays that see an object; an instance is seen by those that see both it and its instancer, as in Cycles."""
    visibility = RayVisibility.ALL
    for each in (obj,) if parent is None else (obj, parent):
        for flag, is_set in (
            (RayVisibility.CAMERA, each.visible_camera),
            (RayVisibility.DIFFUSE, each.visible_diffuse),
            (RayVisibility.GLOSSY, each.visible_glossy),
            (RayVisibility.TRANSMISSION, each.visible_transmission),
            (RayVisibility.SHADOW, each.visible_shadow),
        ):
            if not is_set:
                visibility &= ~flag
    return visibility


def _warn_once(warnings: list[str], text: str) -> None:
    if text not in warnings:
        warnings.append(text)
