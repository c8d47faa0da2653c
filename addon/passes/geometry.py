# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes, instances and materials on the GPU, and all triangles in grid space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..grid import VoxelGrid
from ..scene import InstanceData, MeshData, RayVisibility, SceneData, box_around
from ..sharing import shares_triangles, triangle_counts
from .materials import MaterialSet


@dataclass
class Geometry:
    """What later passes read. ``meshes``: what is drawn to see which triangle is where."""

    grid: VoxelGrid
    triangle_count: int  # of all instances
    has_smooth_shading: bool  # corner normals differ from the triangles'
    has_instances: bool  # that share the triangles of their mesh
    triangles: moderngl.Texture
    instances: moderngl.Texture
    corners: moderngl.Texture
    attributes: moderngl.Texture
    meshes: list[MeshDraw] = field(default_factory=list)

    @property
    def defines(self) -> dict[str, object]:
        """For lib/triangle.glsl and lib/level.glsl."""
        return {"HAS_INSTANCES": self.has_instances} | self.grid.defines

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/geometry.glsl reads."""
        self.bind_triangles(kernel.gpu)
        kernel.set(cell_size=self.grid.cell_size, grid_origin_ws=self.grid.origin)

    def bind_triangles(self, gpu: GpuContext) -> None:
        """Bind what lib/shading_normal.glsl reads."""
        slot = interface.slot
        gpu.use_source(self.triangles, "TEX_TRIANGLES")
        self.instances.use(slot("TEX_INSTANCES"))
        self.corners.use(slot("TEX_CORNERS"))
        self.attributes.use(slot("TEX_ATTRIBUTES"))


#: As pass visibility reads it: rows of grid_from_object, first triangle.
_PLACED = np.dtype([("x", "<f4", 4), ("y", "<f4", 4), ("z", "<f4", 4), ("first", "<u4")])

#: Rows that are worked on at a time: what a step writes is still near when the next one reads it.
_BLOCK = 1 << 13

#: Thickness over width that a float's digits tell from none.
_FLAT = 1e-6

#: So many instances of a mesh are looked at one by one before they are drawn: those out of view are left out.
LEAST_CULLED = 256


@dataclass
class MeshDraw:
    """One mesh with its instances that the camera sees."""

    positions: moderngl.Buffer
    indices: moderngl.Buffer
    instances: moderngl.Buffer
    members: list[int]  # instances
    box: np.ndarray  # (2, 3) around the mesh, object space
    placed: np.ndarray = field(default_factory=lambda: np.zeros(0, _PLACED))  # (K,) what instances are drawn by
    spheres: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))  # (K, 4) around them, grid space
    vertex_array: Any = None

    def place(self, records: np.ndarray) -> None:
        """``records``: of all instances."""
        chosen = records[self.members]
        self.placed = np.zeros(len(chosen), _PLACED)
        for row in "xyz":
            self.placed[row] = chosen[f"grid_from_object_{row}"]
        self.placed["first"] = chosen["first_triangle"]
        self.instances.write(self.placed)
        if len(chosen) >= LEAST_CULLED:
            rows = np.stack([self.placed[row] for row in "xyz"], axis=1)
            middle, reach = 0.5 * (self.box[0] + self.box[1]), 0.5 * float(np.linalg.norm(self.box[1] - self.box[0]))
            # The length of all entries is no less than the largest stretch.
            stretch = np.linalg.norm(rows[:, :, :3], axis=(1, 2))
            self.spheres = np.column_stack([rows @ np.append(middle, 1.0), reach * stretch])

    def show(self, clip_from_grid: np.ndarray) -> int:
        """Put instances that may be in view first in ``instances``; returns how many there are."""
        if len(self.members) < LEAST_CULLED:
            return len(self.members)
        seen = np.ones(len(self.members), bool)
        for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
            plane = clip_from_grid[3] + sign * clip_from_grid[axis]  # 0 on a side of the view, above 0 in view
            reach = self.spheres[:, 3] * np.linalg.norm(plane[:3]) * (1.0 + 1e-4)
            seen &= self.spheres[:, :3] @ plane[:3] + plane[3] >= -reach
        shown = self.placed[seen]
        if len(shown):
            self.instances.write(shown)
        return len(shown)


def is_smooth(mesh: MeshData) -> bool:
    """Whether some corner's normal is off its triangle's by more than rounding."""
    step = 1 << 12  # the first of these answers for most meshes that are
    for first in range(0, len(mesh.triangle_vertices), step):
        triangles = slice(first, first + step)
        corners = mesh.positions[mesh.triangle_vertices[triangles]]
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        cosines = np.einsum("tk,tck->tc", flat, mesh.corner_normals[mesh.triangle_corners[triangles]])
        if (cosines < interface.FLAT_COSINE * np.linalg.norm(flat, axis=1, keepdims=True)).any():
            return True
    return False


def octahedral_snorm(normals: np.ndarray) -> np.ndarray:
    """(N, 3) unit normals as (N,) uint32: octahedral, two signed 16-bit numbers. See lib/common.glsl."""
    packed = np.empty((len(normals), 2), np.int16)
    for first in range(0, len(normals), _BLOCK):
        part = slice(first, first + _BLOCK)
        x, y, z = np.ascontiguousarray(normals[part].T)
        length = np.abs(x) + np.abs(y) + np.abs(z)
        length[~(length > 0)] = 1
        is_below = z < 0
        x, y = x / length, y / length
        for axis, along, other in ((0, x, y), (1, y, x)):
            folded = np.copysign(1.0 - np.abs(other), along)
            np.copyto(folded, along, where=~is_below)
            packed[part, axis] = np.round(np.clip(np.nan_to_num(folded, copy=False), -1, 1) * 32767)
    return packed.view(np.uint32).ravel()


class _Attributes:
    """One array of 32-bit words with everything that corners carry, and where each part starts."""

    def __init__(self) -> None:
        self.parts: list[np.ndarray] = []
        self.size = 0

    def add(self, words: np.ndarray) -> int:
        first = self.size
        self.parts.append(words)
        self.size += len(words)
        return first

    def array(self) -> np.ndarray:
        return np.concatenate(self.parts) if self.parts else np.zeros(1, np.uint32)


def _mesh_layers(mesh: MeshData, layers: list[tuple[str, str | None]], attributes: _Attributes) -> np.ndarray:
    """Upload the layers that materials read; the table of where each starts (NONE_INDEX: this mesh lacks it)."""
    table = np.full(len(layers), interface.NONE_INDEX, np.uint32)
    for index, (kind, name) in enumerate(layers):
        if kind == "uv":
            values = mesh.uv_layers.get(name or mesh.active_uv or "")
            if values is not None:
                table[index] = attributes.add(np.ascontiguousarray(values, np.float32).view(np.uint32).ravel())
        else:
            values = mesh.color_layers.get(name or mesh.active_color or "")
            if values is not None:
                half = np.ascontiguousarray(np.clip(values, -65504, 65504), np.float16)
                table[index] = attributes.add(half.view(np.uint32).ravel())
    return table


class GeometryPass:
    """Uploads meshes once each, and triangles: those of all instances in grid space, or a mesh's once for all."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.geometry: Geometry | None = None
        self._owned: list[Any] = []

    def run(self, scene: SceneData, grid: VoxelGrid, materials: MaterialSet) -> Geometry:
        """Upload and transform. Raises MemoryError when a list or a buffer exceeds what the driver allows."""
        self.release()
        gpu = self.gpu
        used = sorted({instance.mesh for instance in scene.instances})
        attributes = _Attributes()
        attributes.add(np.zeros(1, np.uint32))
        corners = []
        first_triangle = 0
        mesh_triangle: dict[int, int] = {}
        mesh_normals: dict[int, int] = {}
        mesh_layers: dict[int, int] = {}
        for index in used:
            mesh = scene.meshes[index]
            count = len(mesh.triangle_vertices)
            mesh_triangle[index] = first_triangle
            mesh_normals[index] = attributes.add(octahedral_snorm(mesh.corner_normals))
            table = _mesh_layers(mesh, materials.layers, attributes)
            mesh_layers[index] = attributes.add(table if len(table) else np.zeros(1, np.uint32))
            corners.append(
                np.concatenate([mesh.triangle_corners, mesh.triangle_slots.reshape(-1, 1)], axis=1).astype(np.uint32)
            )
            first_triangle += count

        records = np.zeros(max(len(scene.instances), 1), interface.INSTANCE.dtype)
        slots = np.zeros(0, np.uint32)
        total = 0
        if scene.instances:
            owners = np.array([instance.mesh for instance in scene.instances])
            counts = triangle_counts(scene)
            total = int(counts.sum())
            records["first_slot"], slots = _slots(scene.instances)
            _fill_placement(records, scene.instances, grid)
            _fill_generated(records, scene.meshes, owners)
            records["first_triangle"] = (np.cumsum(counts) - counts) & 0xFFFFFFFF  # too many are refused below
            records["triangle_count"] = counts
            for name, firsts in (
                ("first_mesh_triangle", mesh_triangle), ("first_normal", mesh_normals), ("first_layer", mesh_layers),
            ):  # fmt: skip
                of_mesh = [firsts.get(index, 0) for index in range(len(scene.meshes))]
                records[name] = np.array(of_mesh, np.uint32)[owners]

        words = attributes.array()
        texels = records.view(np.uint32).reshape(-1, 4)
        corner_rows = np.concatenate(corners) if corners else np.zeros((1, 4), np.uint32)
        self._owned = [
            gpu.list_texture("instances", len(texels), 4, "u4", texels),
            gpu.list_texture("corners", len(corner_rows), 4, "u4", corner_rows),
            gpu.list_texture("attributes", len(words), 1, "u4", words),
        ]
        meshes = [scene.meshes[index] for index in used]
        has_instances = shares_triangles(scene)
        if has_instances:
            triangles = self._shared(meshes, records, slots)
        else:
            triangles = self._triangles(total)
        self._owned.append(triangles)
        is_any_smooth = any(is_smooth(mesh) for mesh in meshes)
        geometry = Geometry(grid, total, is_any_smooth, has_instances, triangles, *self._owned[:3])
        if total:
            if not has_instances:
                self._transform(geometry, records, meshes, slots)
            geometry.meshes = self._draws(scene, records, used)
        self.geometry = geometry
        return geometry

    def update(self, scene: SceneData, changed: Sequence[int]) -> bool:
        """Place instances ``changed`` anew, of a scene that has the meshes and materials that were uploaded.

        Returns False where more than that is to be done, and does nothing.
        """
        geometry, gpu = self.geometry, self.gpu
        if geometry is None or geometry.has_instances or not geometry.triangle_count:
            return False
        if not changed:
            return True
        seen = {index for draw in geometry.meshes for index in draw.members}
        counts = [len(scene.meshes[scene.instances[index].mesh].triangle_vertices) for index in changed]
        if any(
            count and _seen_by_camera(scene.instances[index]) != (index in seen)
            for index, count in zip(changed, counts, strict=True)
        ):
            return False
        records = np.frombuffer(geometry.instances.read(), interface.INSTANCE.dtype, len(scene.instances)).copy()
        instances = [scene.instances[index] for index in changed]
        chosen = records[list(changed)]
        _fill_placement(chosen, instances, geometry.grid)
        records[list(changed)] = chosen
        texels = records.view(np.uint32).reshape(-1, 4)
        gpu.write_list(geometry.instances, texels)
        for record, index, instance in zip(chosen, changed, instances, strict=True):
            mesh, slots = scene.meshes[instance.mesh], _slots([instance])[1]
            self._transform(geometry, record.reshape(1), [mesh], slots, instance=index)
        for draw in geometry.meshes:
            if not set(draw.members).isdisjoint(changed):
                draw.place(records)
        return True

    def _triangles(self, count: int) -> moderngl.Texture:
        """Room for so many triangles. Raises MemoryError."""
        rows = max(1, -(-count // interface.TRIANGLES_PER_ROW))
        if rows > 16384:
            raise MemoryError(f"the scene has {count} triangles; at most {16384 * interface.TRIANGLES_PER_ROW} fit")
        return self.gpu.texture("triangles", (3 * interface.TRIANGLES_PER_ROW, rows), 4, "u4")

    def _shared(self, meshes: list[MeshData], records: np.ndarray, slots: np.ndarray) -> moderngl.Texture:
        """What lib/triangle.glsl reads where instances share triangles. ``meshes``: in the order of their triangles."""
        if int(records["triangle_count"].sum(dtype=np.int64)) >= 1 << 31:
            raise MemoryError("instances of the scene have more than 2147483647 triangles together: show fewer of them")
        starts = np.cumsum([4 * len(records), 3 * sum(len(mesh.triangle_vertices) for mesh in meshes)])
        first_triangle = -(-int(starts[0]) // 3)
        first_word = 4 * int(starts[1] + 2)
        texture = self._triangles(-(-(first_word + len(slots)) // 12))
        texels = np.zeros((texture.width * texture.height, 4), np.uint32)

        placements = _placements(records)
        placements[:, 3, 1] += np.uint32(first_triangle)
        placements[:, 3, 2] += np.uint32(first_word)
        texels[: 4 * len(records)] = placements.reshape(-1, 4)

        first = 0
        triangles = texels[3 * first_triangle :]
        for mesh in meshes:
            count = len(mesh.triangle_vertices)
            part = triangles[3 * first : 3 * (first + count)].reshape(-1, 3, 4)
            part[:, :, :3] = mesh.positions.astype(np.float32)[mesh.triangle_vertices].view(np.uint32)
            part[:, 0, 3] = mesh.triangle_slots
            part[:, 1, 3] = np.arange(first, first + count)
            first += count
        texels.reshape(-1)[first_word : first_word + len(slots)] = slots
        texture.write(texels.reshape(-1).view(np.uint8).data, alignment=1)
        return texture

    def _transform(
        self,
        geometry: Geometry,
        records: np.ndarray,
        meshes: list[MeshData],
        slots: np.ndarray,
        *,
        instance: int = 0,
    ) -> None:
        """Of instances ``records``, whose first is number ``instance``; ``meshes``: in the order of their triangles."""
        gpu = self.gpu
        first, mesh_first, slot_first = (
            int(records[name][0]) if len(records) == 1 else 0
            for name in ("first_triangle", "first_mesh_triangle", "first_slot")
        )
        count = int(records["triangle_count"].sum(dtype=np.int64))
        placements = _placements(records)
        placements[:, 3, 2] -= np.uint32(slot_first)
        vertices = np.empty((sum(len(mesh.triangle_vertices) for mesh in meshes), 4), np.uint32)
        positions = np.zeros((sum(len(mesh.positions) for mesh in meshes), 4), np.float32)
        triangle, vertex = 0, 0
        for mesh in meshes:
            part = slice(triangle, triangle + len(mesh.triangle_vertices))
            np.add(mesh.triangle_vertices, np.int64(vertex), out=vertices[part, :3], casting="unsafe")
            vertices[part, 3] = mesh.triangle_slots
            positions[vertex : vertex + len(mesh.positions), :3] = mesh.positions
            triangle, vertex = part.stop, vertex + len(mesh.positions)
        temporary = []
        kernel = gpu.kernel("transform").set(triangle_count=count, instance_count=len(records))
        kernel.set(triangle_first=first, instance_first=instance, mesh_triangle_first=mesh_first)
        for name, rows in (
            ("TEX_PLACEMENTS", placements.reshape(-1, 4)), ("TEX_VERTICES", vertices),
            ("TEX_MESH_POSITIONS", positions.view(np.uint32)),
            ("TEX_SLOTS", slots.reshape(-1, 1)),
        ):  # fmt: skip
            temporary.append(gpu.list_texture("meshes", len(rows), rows.shape[1], "u4", rows))
            gpu.use_source(temporary[-1], name)
        geometry.triangles.bind_to_image(interface.slot("IMG_0"), read=False, write=True)
        kernel.run_list(count)
        gpu.barrier()  # every later pass reads the triangles as a texture
        gpu.free(*temporary)

    def _draws(self, scene: SceneData, records: np.ndarray, used: list[int]) -> list[MeshDraw]:
        by_mesh: dict[int, list[int]] = {index: [] for index in used}
        for index, instance in enumerate(scene.instances):
            if _seen_by_camera(instance):
                by_mesh[instance.mesh].append(index)
        draws = []
        for mesh_index, members in by_mesh.items():
            mesh = scene.meshes[mesh_index]
            if not members or not len(mesh.triangle_vertices):
                continue
            draw = MeshDraw(
                self.gpu.buffer("vertex positions", mesh.positions.astype(np.float32)),
                self.gpu.buffer("vertex indices", mesh.triangle_vertices.astype(np.uint32)),
                self.gpu.buffer("draw instances", size=_PLACED.itemsize * len(members)),
                members,
                mesh.bounds,
            )
            draw.place(records)
            self._owned += [draw.positions, draw.indices, draw.instances]
            draws.append(draw)
        return draws

    def put_away(self) -> None:
        """Free what ties meshes to the program that draws them: it is made again when they are drawn."""
        for draw in self.geometry.meshes if self.geometry else ():
            self.gpu.free(draw.vertex_array)
            draw.vertex_array = None

    def release(self) -> None:
        """Free everything."""
        self.put_away()
        self.gpu.free(*self._owned)
        self._owned = []
        self.geometry = None


def _seen_by_camera(instance: InstanceData) -> bool:
    return bool(instance.visibility & RayVisibility.CAMERA)


def _placements(records: np.ndarray) -> np.ndarray:
    """(I, 4, 4) uint32: rows of grid_from_object; first triangle, the mesh's, first slot, number of instances."""
    placements = np.empty((len(records), 4, 4), np.uint32)
    for row, name in enumerate("xyz"):
        placements[:, row] = records[f"grid_from_object_{name}"].view(np.uint32)
    for column, name in enumerate(("first_triangle", "first_mesh_triangle", "first_slot")):
        placements[:, 3, column] = records[name]
    placements[:, 3, 3] = len(records)
    return placements


def _fill_placement(records: np.ndarray, instances: Sequence[InstanceData], grid: VoxelGrid) -> None:
    """Where ``instances`` stand, and what tells them apart."""
    worlds = np.array([instance.world_from_object for instance in instances])
    _fill_matrices(records, grid.grid_from_world @ worlds)
    records["random"] = [instance.random for instance in instances]
    records["object_index"] = [instance.object_index for instance in instances]
    records["mirrored"] = np.linalg.det(worlds[:, :3, :3]) < 0


def _slots(instances: Sequence[InstanceData]) -> tuple[np.ndarray, np.ndarray]:
    """(I,) where each instance's material slots start, and (S,) uint32, all slots: material | flags << 24.

    Instances that look alike have them in common.
    """
    firsts: dict[tuple[tuple[int, ...], int], int] = {}
    starts: list[int] = []
    slots: list[int] = []
    for instance in instances:
        flags = int(instance.visibility) | (interface.TRIANGLE_HOLDOUT if instance.is_holdout else 0)
        key = instance.materials, flags
        if key not in firsts:
            firsts[key] = len(slots)
            slots += [material | flags << 24 for material in instance.materials]
        starts.append(firsts[key])
    return np.array(starts, np.int64), np.array(slots, np.uint32)


def _fill_matrices(records: np.ndarray, grid_from_object: np.ndarray) -> None:
    """``grid_from_object``: (N, 4, 4). What is flat has no inverse and gets the closest thing to it."""
    axes = grid_from_object[:, :3, :3]
    longest = np.linalg.norm(axes, axis=1).max(axis=1)
    regular = np.abs(np.linalg.det(axes)) > _FLAT * longest**3
    inverse = np.empty_like(grid_from_object)
    inverse[regular] = np.linalg.inv(grid_from_object[regular])
    flat = np.linalg.pinv(axes[~regular], rcond=_FLAT)
    inverse[~regular] = np.eye(4)
    inverse[~regular, :3, :3] = flat
    inverse[~regular, :3, 3] = -np.einsum("nij,nj->ni", flat, grid_from_object[~regular, :3, 3])
    for row, name in enumerate("xyz"):
        records[f"grid_from_object_{name}"] = grid_from_object[:, row]
        records[f"object_from_grid_{name}"] = inverse[:, row]


def _fill_generated(records: np.ndarray, meshes: Sequence[MeshData], owners: np.ndarray) -> None:
    """``owners``: (N,) index of each record's mesh."""
    bounds = np.zeros((len(meshes), 2, 3))
    for index in np.unique(owners):
        mesh = meshes[index]
        if mesh.generated_bounds is not None:
            bounds[index] = mesh.generated_bounds
        elif len(mesh.positions):
            bounds[index] = box_around(mesh.positions)
        else:
            bounds[index] = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    lo, hi = bounds[:, 0], bounds[:, 1]
    scale = 1.0 / np.where(hi > lo, hi - lo, 1.0)
    records["generated_scale"] = scale[owners]
    records["generated_offset"] = (-lo * scale)[owners]
