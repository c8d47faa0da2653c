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
_FLATTENED = "its scale is 0 along an axis"
_NOT_FINITE = "its position, rotation or scale is not a usable number"


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
            if obj.data.is_editmode:  # its data is still with the editor: only a copy has attributes
                extracted = extract_mesh(obj.to_mesh(), slot_count)
                obj.to_mesh_clear()
            else:
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
class _Part:
    """What all instances of one object's mesh share."""

    name: str
    mesh: int | None  # None: it has no triangles
    materials: tuple[int, ...]
    object_index: int


@dataclass(frozen=True)
class _Flags:
    """Who sees an object, or what an instancer makes."""

    visibility: RayVisibility
    is_holdout: bool


def extract_placements(depsgraph: bpy.types.Depsgraph, materials: MaterialTable, warnings: list[str]) -> Placements:
    """All meshes, instances and lights that the depsgraph shows in its mode (render or viewport)."""
    view_layer = depsgraph.view_layer_eval
    meshes = MeshTable()
    instances: list[InstanceData] = []
    lights: list[LightData] = []
    # Evaluated copies have no session_uid and instances have no address that lasts: originals tell objects apart.
    parts: dict[tuple[int, int], _Part] = {}
    flags: dict[tuple[int, bool], _Flags] = {}
    skipped: Counter[tuple[str, str]] = Counter()

    def flags_of(obj: bpy.types.Object, is_placed: bool) -> _Flags:
        key = (obj.original.session_uid, is_placed)
        if key not in flags:
            flags[key] = _flags(obj, view_layer if is_placed else None)
        return flags[key]

    # Matrices and flags of all items at once: one call costs less than a hundred items one by one.
    items = depsgraph.object_instances
    count = len(items)
    matrices, problems = _matrices(items, count)
    shown = np.empty(count, bool)
    items.foreach_get("show_self", shown)
    random_ids = np.empty(count, np.int32)
    items.foreach_get("random_id", random_ids)

    for i, item in enumerate(items):
        if not shown[i]:
            continue
        obj = item.object
        kind = obj.type
        if kind in _UNSUPPORTED:
            _warn_once(warnings, f'object "{obj.name}": {_UNSUPPORTED[kind]} not supported; left out')
        if kind not in ("MESH", "LIGHT"):
            continue
        # An instance is seen by the rays that see both it and its instancer, and held out with either; what counts in
        # the view layer are the collections of the instancer. All as in Cycles.
        parent = item.parent if item.is_instance else None
        own = flags_of(obj, is_placed=parent is None)
        instancer = flags_of(parent, is_placed=True) if parent is not None else own
        visibility = own.visibility & instancer.visibility
        if not visibility:
            continue
        if kind == "LIGHT":
            if problems[i] == _NOT_FINITE:
                skipped[obj.name, problems[i]] += 1
                continue
            light = extract_light(obj, matrices[i], visibility, warnings)
            if light is not None:
                lights.append(light)
            continue
        key = (obj.original.session_uid, obj.data.as_pointer())
        if key not in parts:
            parts[key] = _part(obj, view_layer.material_override, materials, meshes, warnings)
        part = parts[key]
        if part.mesh is None:
            continue
        if problems[i]:
            skipped[part.name, problems[i]] += 1
            continue
        instances.append(
            InstanceData(
                name=part.name,
                mesh=part.mesh,
                world_from_object=matrices[i],
                materials=part.materials,
                visibility=visibility,
                is_holdout=own.is_holdout or instancer.is_holdout,
                object_index=part.object_index,
                random=_fraction(int(random_ids[i])) if parent is not None else name_random(part.name),
            )
        )
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
    return _fraction(c)


def _fraction(word: int) -> float:
    """[0, 1) from 32 bits, signed or not."""
    return min((word & 0xFFFFFFFF) / 0xFFFFFFFF, 1.0 - 2.0**-24)


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
    problems = np.where(usable, np.where(flattened, _FLATTENED, ""), _NOT_FINITE)
    return matrices, problems.tolist()


def _part(
    obj: bpy.types.Object,
    override: bpy.types.Material | None,
    materials: MaterialTable,
    meshes: MeshTable,
    warnings: list[str],
) -> _Part:
    """Mesh and materials of one object."""
    for system in obj.particle_systems:
        if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
            _warn_once(warnings, f'object "{obj.name}": hair is not supported; left out')
    slots = [slot.material for slot in obj.material_slots]
    mesh, used_slots = meshes.add(obj, len(slots), warnings)
    indices = _materials_of(slots, used_slots, override, materials) if mesh is not None else ()
    return _Part(obj.name, mesh, indices, obj.pass_index)


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


def _flags(obj: bpy.types.Object, view_layer: bpy.types.ViewLayer | None) -> _Flags:
    """Flags of an object itself and, with a ``view_layer``, of its collections there."""
    visibility = RayVisibility.ALL
    for flag, is_set in (
        (RayVisibility.CAMERA, obj.visible_camera),
        (RayVisibility.DIFFUSE, obj.visible_diffuse),
        (RayVisibility.GLOSSY, obj.visible_glossy),
        (RayVisibility.TRANSMISSION, obj.visible_transmission),
        (RayVisibility.SHADOW, obj.visible_shadow),
    ):
        if not is_set:
            visibility &= ~flag
    is_holdout = obj.is_holdout
    if view_layer is not None:
        is_holdout = is_holdout or obj.holdout_get(view_layer=view_layer)
        if obj.indirect_only_get(view_layer=view_layer):
            visibility &= ~RayVisibility.CAMERA
    return _Flags(visibility, is_holdout)


def _warn_once(warnings: list[str], text: str) -> None:
    if text not in warnings:
        warnings.append(text)
