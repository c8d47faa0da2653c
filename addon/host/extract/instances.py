# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that is placed in the scene: instances of meshes, and lights.

``depsgraph.object_instances`` lists real objects and all instances of collections, vertices, faces, particles and
Geometry Nodes alike. Curves, surfaces, texts and metaballs come twice: as themselves, and as an instance of the mesh
that Blender has made of them; only the mesh is taken. Nothing of Blender's outlives the functions of this file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ...materials.graph import MaterialData
from ...scene import DoubleArray, InstanceData, LightData, MeshData, RayVisibility
from .camera import ExtractionError
from .keep import kept, says_the_same
from .light import extract_light
from .mesh import FARTHEST, ExtractedMesh, extract_mesh

_UNSUPPORTED = {
    "CURVES": "hair curves are",
    "POINTCLOUD": "point clouds are",
    "VOLUME": "volumes are",
    "GREASEPENCIL": "grease pencil strokes are",
    "GPENCIL": "grease pencil strokes are",
}
#: Objects and instances that are shown, lights and empties included: each takes about a kilobyte while they are read.
MOST_INSTANCES = 1 << 22

#: Instances between two looks at whether to go on.
_CHECK_INTERVAL = 1024

#: An instance no wider than this fraction of its length is a line, or a point.
_NARROW = 1e-12
_NO_SURFACE = "its scale leaves it no surface"
_NOT_FINITE = "its position, rotation or scale is not a usable number"


class MaterialTable:
    """The materials in use, each converted once, in the order of first use.

    ``convert`` gets a material and the list for its warnings.
    """

    def __init__(self, convert: Callable[[bpy.types.Material, list[str]], MaterialData]) -> None:
        self._convert = convert
        self._read: dict[int, tuple[MaterialData, list[str]]] = {}
        self._before: dict[int, tuple[MaterialData, list[str]]] = {}
        self._is_current = False
        self._check: Callable[[], None] = lambda: None
        self._indices: dict[int, int] = {}
        self.materials: list[MaterialData] = []
        self.warnings: list[str] = []

    def begin(self, is_current: bool, check: Callable[[], None]) -> None:
        """Begins anew. ``is_current``: the materials that were read are still as they were.

        ``check`` is called before each that is read, and may raise.
        """
        self._check = check
        self._before, self._read = self._read, {}
        self._is_current = is_current
        self._indices, self.materials, self.warnings = {}, [], []

    def index_of(self, material: bpy.types.Material | None) -> int:
        """Index of a material; None gives the grey of Blender's empty slots."""
        key = material.original.session_uid if material is not None else 0  # evaluated copies have 0
        if key not in self._indices:
            self._indices[key] = len(self.materials)
            before = self._before.get(key)
            if before is None or not self._is_current:
                self._check()
                warnings: list[str] = []
                default = MaterialData("Default", graph=None)
                data = self._convert(material, warnings) if material is not None else default
                self._read[key] = (kept(data, before and before[0]), warnings)
            else:
                self._read[key] = before
            self.materials.append(self._read[key][0])
            self.warnings += self._read[key][1]
        return self._indices[key]


@dataclass(frozen=True)
class _Mesh:
    """What was read of one evaluated mesh, and the session_uids of the object that had it and of that one's data."""

    extracted: ExtractedMesh
    used_slots: tuple[int, ...]
    owners: frozenset[int]


class MeshTable:
    """The meshes in use, each read once, and not again where it is known not to have changed.

    They are told apart by their address, which is theirs for as long as nothing is evaluated again, and by the number
    of material slots, because slot numbers beyond it are clamped.
    """

    def __init__(self) -> None:
        self._read: dict[tuple[int, int], _Mesh] = {}
        self._before: dict[tuple[int, int], _Mesh] = {}
        self._before_by_name: dict[str, list[MeshData]] = {}
        self._changed: frozenset[int] | None = None
        self._indices: dict[tuple[int, int], int | None] = {}
        self.meshes: list[MeshData] = []

    def begin(self, changed: frozenset[int] | None) -> None:
        """Begins anew.

        ``changed``: session_uids of the objects and data whose geometry was evaluated since, by the same depsgraph;
        None: nothing is known, and all meshes are read.
        """
        self._before, self._read, self._changed = self._read, {}, changed
        self._before_by_name = {}
        for mesh in self.meshes:
            self._before_by_name.setdefault(mesh.name, []).append(mesh)
        self._indices, self.meshes = {}, []

    def add(self, obj: bpy.types.Object, slot_count: int, warnings: list[str]) -> tuple[int | None, tuple[int, ...]]:
        """Index of the object's mesh (None: it has no triangles), and the slots that its triangles use."""
        key = (obj.data.as_pointer(), slot_count)
        if key not in self._read:
            owners = frozenset((obj.original.session_uid, obj.original.data.session_uid))
            found = self._before.get(key)
            if found is None or found.owners != owners or self._changed is None or self._changed & owners:
                found = self._extract(obj, slot_count, owners)
            self._read[key] = found
            if found.extracted.bad_triangles:
                warnings.append(
                    f'object "{obj.name}": triangles left out because a vertex is missing, not finite or beyond '
                    f"{FARTHEST:g} m: {found.extracted.bad_triangles}"
                )
            self._indices[key] = len(self.meshes) if found.extracted.data is not None else None
            if found.extracted.data is not None:
                self.meshes.append(found.extracted.data)
        return self._indices[key], self._read[key].used_slots

    def _extract(self, obj: bpy.types.Object, slot_count: int, owners: frozenset[int]) -> _Mesh:
        if obj.data.is_editmode:  # its data is still with the editor: only a copy has attributes
            extracted = extract_mesh(obj.to_mesh(), slot_count)
            obj.to_mesh_clear()
        else:
            extracted = extract_mesh(obj.data, slot_count)
        data = extracted.data
        if data is None:
            return _Mesh(extracted, (), owners)
        used = np.flatnonzero(np.bincount(data.triangle_slots))
        same = next((mesh for mesh in self._before_by_name.get(data.name, ()) if says_the_same(data, mesh)), data)
        return _Mesh(replace(extracted, data=same), tuple(used.tolist()), owners)

    def end(self) -> None:
        """Lets go of what is not in use any more."""
        self._before, self._before_by_name = {}, {}


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


class _FlagTable:
    """Who sees objects, each object looked at once."""

    def __init__(self, depsgraph: bpy.types.Depsgraph, viewport: bpy.types.SpaceView3D | None) -> None:
        self._view_layer = depsgraph.view_layer_eval
        self._viewport = viewport
        # Evaluated copies have no session_uid and instances have no address that lasts: originals tell objects apart.
        self._flags: dict[tuple[int, bool], _Flags] = {}

    def of_item(self, obj: bpy.types.Object, parent: bpy.types.Object | None) -> _Flags:
        """Of an object, or of an instance of it that ``parent`` makes.

        An instance is seen by the rays that see both it and its instancer, and held out with either; what counts in
        the view layer are the collections of the instancer. All as in Cycles.
        """
        own = self._of(obj, is_placed=parent is None)
        if parent is None:
            return own
        instancer = self._of(parent, is_placed=True)
        return _Flags(own.visibility & instancer.visibility, own.is_holdout or instancer.is_holdout)

    def _of(self, obj: bpy.types.Object, is_placed: bool) -> _Flags:
        key = (obj.original.session_uid, is_placed)
        if key not in self._flags:
            flags = _flags(obj, self._view_layer if is_placed else None)
            if is_placed and self._viewport is not None and not obj.visible_in_viewport_get(self._viewport):
                flags = replace(flags, visibility=RayVisibility(0))
            self._flags[key] = flags
        return self._flags[key]


def extract_lights(
    depsgraph: bpy.types.Depsgraph, warnings: list[str], viewport: bpy.types.SpaceView3D | None = None
) -> list[LightData]:
    """All lights that the depsgraph shows in its mode (render or viewport), and the ``viewport`` if there is one."""
    flags = _FlagTable(depsgraph, viewport)
    lights: list[LightData] = []
    skipped: Counter[tuple[str, str]] = Counter()
    for item in depsgraph.object_instances:
        obj = item.object
        if obj.type != "LIGHT" or not item.show_self:
            continue
        visibility = flags.of_item(obj, item.parent if item.is_instance else None).visibility
        if not visibility:
            continue
        matrix = np.array(item.matrix_world, np.float64)
        if not _is_usable(matrix):
            skipped[obj.name, _NOT_FINITE] += 1
            continue
        light = extract_light(obj, matrix, visibility, warnings)
        if light is not None:
            lights.append(light)
    _warn_skipped(skipped, warnings)
    return lights


def extract_instances(
    depsgraph: bpy.types.Depsgraph,
    materials: MaterialTable,
    meshes: MeshTable,
    warnings: list[str],
    check: Callable[[], None],
    viewport: bpy.types.SpaceView3D | None = None,
) -> list[InstanceData]:
    """All placements of meshes that the depsgraph shows in its mode (render or viewport); fills both tables.

    ``viewport``: only what it shows. ``check`` is called now and then, and may raise.
    """
    override = depsgraph.view_layer_eval.material_override
    flags = _FlagTable(depsgraph, viewport)
    instances: list[InstanceData] = []
    parts: dict[tuple[int, int], _Part] = {}
    skipped: Counter[tuple[str, str]] = Counter()

    # Matrices and flags of all items at once: one call costs less than a hundred items one by one.
    items = depsgraph.object_instances
    count = len(items)
    if count > MOST_INSTANCES:
        raise ExtractionError(
            f"The scene shows {count} objects and instances, and at most {MOST_INSTANCES} can be rendered: hide some, "
            "or lower the density or count of what makes them."
        )
    matrices, problems = _matrices(items, count)
    shown = np.empty(count, bool)
    items.foreach_get("show_self", shown)
    random_ids = np.empty(count, np.int32)
    items.foreach_get("random_id", random_ids)

    for i, item in enumerate(items):
        if i % _CHECK_INTERVAL == 0:
            check()
        if not shown[i]:
            continue
        obj = item.object
        kind = obj.type
        if kind in _UNSUPPORTED:
            _warn_once(warnings, f'object "{obj.name}": {_UNSUPPORTED[kind]} not supported; left out')
        if kind != "MESH":
            continue
        parent = item.parent if item.is_instance else None
        seen = flags.of_item(obj, parent)
        if not seen.visibility:
            continue
        key = (obj.original.session_uid, obj.data.as_pointer())
        if key not in parts:
            check()
            parts[key] = _part(obj, override, materials, meshes, warnings)
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
                visibility=seen.visibility,
                is_holdout=seen.is_holdout,
                object_index=part.object_index,
                random=_fraction(int(random_ids[i])) if parent is not None else name_random(part.name),
            )
        )
    _warn_skipped(skipped, warnings)
    return instances


def _warn_skipped(skipped: Counter[tuple[str, str]], warnings: list[str]) -> None:
    for (name, problem), times in skipped.items():
        warnings.append(f'object "{name}": {problem}; left out' + (f" ({times} instances)" if times > 1 else ""))


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
    usable = _is_usable(matrices)
    axes = np.where(usable[:, None, None], matrices[:, :3, :3], np.eye(3))
    x, y, z = (axes[:, :, k] for k in range(3))
    sides = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)])
    widest = np.linalg.norm(sides, axis=2).max(axis=0)
    has_surface = widest > _NARROW * np.square(np.linalg.norm(axes, axis=1).max(axis=1))
    problems = np.where(usable, np.where(has_surface, "", _NO_SURFACE), _NOT_FINITE)
    return matrices, problems.tolist()


def _is_usable(matrices: DoubleArray) -> Any:
    """Whether each of (..., 4, 4) matrices has nothing but numbers that can be computed with."""
    return (np.abs(matrices) <= FARTHEST).all(axis=(-2, -1))  # False for NaN


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
