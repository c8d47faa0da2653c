# SPDX-License-Identifier: GPL-3.0-or-later
"""What differs between a scene and the one before it, where that is little: then the rest need not be made again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .gpu.interface import BRICK, CHANGED_BOXES
from .grid import VoxelGrid
from .scene import DoubleArray, InstanceData, MeshData, SceneData

#: Around triangles, cells: more than rounding moves them.
MARGIN = 0.01
#: So many cells inside a level's border on, no ray looks up the wider cells beyond it: ends of rays are at most two of
#: those, four of these, from the cells that they look up, and places are asked half a wide cell from where they are.
NEAR_BORDER = 6
#: Instances that are transformed one by one, at most.
MAX_INSTANCES = 256


@dataclass(frozen=True, eq=False)
class Edit:
    """Instances that were moved or look different now. Triangles keep their numbers."""

    instances: tuple[int, ...]
    has_meshes: bool  # meshes were edited too
    boxes: DoubleArray  # (K, 2, 3) grid space: where triangles of these instances were and are; all else is as it was
    grid: VoxelGrid
    bricks: np.ndarray  # (z, y, x) bool: the same, by bricks

    @property
    def share(self) -> float:
        """Of all bricks."""
        return float(self.bricks.mean())

    @property
    def ray_boxes(self) -> DoubleArray:
        """(up to CHANGED_BOXES, 2, 3): rays that cross none of these meet what they met before."""
        return united(self.boxes, CHANGED_BOXES)

    @property
    def cell_boxes(self) -> DoubleArray:
        """(up to CHANGED_BOXES, 2, 3) grid space: whole cells, outside which voxels are what they were, and those up to
        two beside them, from where rays may look these up or ask what hides them."""
        boxes = united(self.boxes, CHANGED_BOXES)
        sides = np.array([widest_cell(box, self.grid) for box in boxes]).reshape(-1, 1)
        low, high = (np.floor(boxes[:, k] / sides) for k in (0, 1))
        return np.stack([(low - 2.0) * sides, (high + 3.0) * sides], axis=1)


def edit_between(old: SceneData, new: SceneData, grid: VoxelGrid) -> Edit | None:
    """What was edited; None: too much, or triangles have other numbers.

    ``grid``: of both scenes, which have the same materials.
    """
    if len(old.instances) != len(new.instances):
        return None
    edited = set(range(len(old.meshes), len(new.meshes)))
    edited |= {index for index, (a, b) in enumerate(zip(old.meshes, new.meshes, strict=False)) if a is not b}
    changed = [
        index
        for index, (a, b) in enumerate(zip(old.instances, new.instances, strict=True))
        if a is not b or b.mesh in edited
    ]
    for index in changed:
        a, b = old.instances[index], new.instances[index]
        if len(old.meshes[a.mesh].triangle_vertices) != len(new.meshes[b.mesh].triangle_vertices):
            return None
    boxes = [
        box
        for scene in (old, new)
        for index in changed
        if (box := _box(scene.meshes[scene.instances[index].mesh], scene.instances[index], grid)) is not None
    ]
    has_meshes = len(old.meshes) != len(new.meshes) or any(
        old.instances[index].mesh != new.instances[index].mesh or new.instances[index].mesh in edited
        for index in changed
    )
    found = np.array(boxes, np.float64).reshape(-1, 2, 3)
    return Edit(tuple(changed), has_meshes, found, grid, bricks_in(found, grid))


def _box(mesh: MeshData, instance: InstanceData, grid: VoxelGrid) -> DoubleArray | None:
    """(2, 3) grid space, around the triangles of an instance; None: there are none."""
    if not len(mesh.triangle_vertices):
        return None
    matrix = grid.grid_from_world @ instance.world_from_object
    points = mesh.positions[mesh.triangle_vertices.ravel()] @ matrix[:3, :3].T + matrix[:3, 3]
    margin = MARGIN + 1e-5 * float(np.abs(points).max())
    return np.array([points.min(axis=0) - margin, points.max(axis=0) + margin])


def bricks_in(boxes: DoubleArray, grid: VoxelGrid) -> np.ndarray:
    """(z, y, x) bool: bricks that one of ``boxes`` (K, 2, 3), grid space, has a part of."""
    marks = np.zeros(grid.bricks[::-1], bool)
    for k, level in enumerate(grid.parts):
        part, side = marks[level.bricks], 1 << k
        more = MARGIN * (1.0 - 1.0 / side)  # boxes have that of the finest cells
        for low, high in boxes / side - level.first:
            first = np.clip(np.floor((low - more) / BRICK), 0, part.shape[::-1]).astype(int)
            end = np.clip(np.floor((high + more) / BRICK) + 1, 0, part.shape[::-1]).astype(int)
            part[first[2] : end[2], first[1] : end[1], first[0] : end[0]] = True
    return marks


def bricks_beside(marked: np.ndarray, grid: VoxelGrid) -> np.ndarray:
    """(z, y, x) bool: ``marked`` bricks, likewise, and all that touch them, those of other levels among them."""
    found = np.zeros_like(marked)
    for k, level in enumerate(grid.parts):
        here = marked[level.bricks].copy()
        if k:  # one of its bricks holds two of the finer level's along each axis, which begin at even ones
            finer = grid.levels[k - 1]
            fine = marked[finer.bricks]
            z, y, x = (length // 2 for length in fine.shape)
            halved = fine.reshape(z, 2, y, 2, x, 2).any(axis=(1, 3, 5))
            here[finer.inside(level)] |= halved
        if k + 1 < len(grid.levels):
            coarser = grid.levels[k + 1]
            coarse = marked[coarser.bricks][level.inside(coarser)]
            here |= coarse.repeat(2, 0).repeat(2, 1).repeat(2, 2)
        here = np.pad(here, 1)
        for axis in range(3):
            here = here | np.roll(here, 1, axis) | np.roll(here, -1, axis)
        found[level.bricks] = here[1:-1, 1:-1, 1:-1]
    return found


def around_bricks(marked: np.ndarray, grid: VoxelGrid) -> DoubleArray:
    """(2, 3) grid space: a box around ``marked`` bricks, with a margin of a tenth of a cell."""
    boxes = []
    for k, level in enumerate(grid.parts):
        places = np.argwhere(marked[level.bricks])[:, ::-1] * BRICK + level.first
        if len(places):
            boxes.append(np.array([places.min(axis=0) - 0.1, places.max(axis=0) + BRICK + 0.1]) * (1 << k))
    return _around(np.array(boxes)) if boxes else np.zeros((2, 3))


def widest_cell(box: DoubleArray, grid: VoxelGrid) -> int:
    """Side of the widest cells that lie in or within a few cells of ``box`` (2, 3), grid space."""
    for k, level in enumerate(grid.parts):
        side = 1 << k
        low, high = np.array([level.first, level.end]) * side
        if (box[0] - NEAR_BORDER * side >= low).all() and (box[1] + NEAR_BORDER * side <= high).all():
            break
    return side


def united(boxes: DoubleArray, count: int) -> DoubleArray:
    """At most ``count`` boxes (K, 2, 3) that hold all of ``boxes``: those that lie together share one."""
    if len(boxes) == 2 and _surface(_around(boxes)) <= _surface(boxes[0]) + _surface(boxes[1]):
        return _around(boxes)[None]  # rays meet the one less often than one of the two
    if len(boxes) <= 1 or count <= 1:
        return _around(boxes)[None] if len(boxes) else boxes
    if len(boxes) <= count:
        return boxes
    centres = boxes.mean(axis=1)
    order = np.argsort(centres[:, int(np.argmax(np.ptp(centres, axis=0)))], kind="stable")
    half = len(boxes) // 2
    parts = [united(boxes[part], count // 2) for part in (order[:half], order[half:])]
    return np.concatenate(parts)


def _around(boxes: DoubleArray) -> DoubleArray:
    """(2, 3)."""
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _surface(box: DoubleArray) -> float:
    """Half the surface of a box (2, 3)."""
    x, y, z = box[1] - box[0]
    return float(x * y + y * z + z * x)
