# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the voxel grid lies and how fine it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .gpu.interface import BRICK
from .scene import DoubleArray, SceneData
from .settings import Settings

#: Cells of margin on each side. Not whole: walls of a box that fills the bounds should not lie between two cells.
MARGIN = 1.37

#: Bytes of an occupied cell: its record and, with five triangles on average, its list.
BYTES_PER_CELL = 16 + 5 * 4
#: Faces of an occupied cell, as counted in architectural scenes, and what each takes: place, reflectance, order,
#: irradiance, radiance twice and sky. Links come on top.
FACES_PER_CELL = 2.5
BYTES_PER_FACE = 16 + 8 + 4 + 16 + 2 * 16 + 16


@dataclass(frozen=True)
class VoxelGrid:
    """A box of cubic cells with the axes of the world.

    ``position_grid = (position_ws - origin) / cell_size``, in float64 on the CPU: the origin can be far away.
    """

    origin: tuple[float, float, float]  # world metres, corner of cell (0, 0, 0)
    cell_size: float  # metres
    size: tuple[int, int, int]  # cells, multiples of BRICK

    @property
    def bricks(self) -> tuple[int, int, int]:
        return (self.size[0] // BRICK, self.size[1] // BRICK, self.size[2] // BRICK)

    @property
    def grid_from_world(self) -> DoubleArray:
        """(4, 4)."""
        matrix = np.eye(4) / self.cell_size
        matrix[:3, 3] = -np.asarray(self.origin) / self.cell_size
        matrix[3, 3] = 1.0
        return matrix

    @classmethod
    def around(cls, bounds: DoubleArray, resolution: int) -> VoxelGrid:
        """The grid over ``bounds`` (2, 3), world metres, with ``resolution`` cells along its longest side."""
        extent = bounds[1] - bounds[0]
        longest = float(extent.max())
        cell_size = max(longest / max(resolution - 2 * MARGIN, 1.0), 1e-9)
        # Far from the origin float64 still resolves a cell, or else the cells grow until it does.
        cell_size = max(cell_size, float(np.abs(bounds).max()) * 1e-12)
        cells = np.maximum(np.ceil(extent / cell_size + 2 * MARGIN - 1e-6), 1)  # rounding must not add a cell
        size = (np.ceil(cells / BRICK) * BRICK).astype(int)
        origin = 0.5 * (bounds[0] + bounds[1]) - 0.5 * cells * cell_size
        return cls(
            (float(origin[0]), float(origin[1]), float(origin[2])),
            cell_size,
            (int(size[0]), int(size[1]), int(size[2])),
        )


def scene_bounds(scene: SceneData) -> DoubleArray | None:
    """(2, 3) world metres around all instances, or None when nothing has a triangle."""
    corners = []
    boxes: dict[int, DoubleArray] = {}
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        if len(mesh.triangle_vertices) == 0:
            continue
        if instance.mesh not in boxes:
            used = mesh.positions[mesh.triangle_vertices.ravel()] if len(mesh.positions) else mesh.positions
            boxes[instance.mesh] = np.array([used.min(axis=0), used.max(axis=0)], np.float64)
        box = boxes[instance.mesh]
        points = np.array([[box[i][0], box[j][1], box[k][2], 1.0] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        corners.append((points @ instance.world_from_object.T)[:, :3])
    if not corners:
        return None
    everything = np.concatenate(corners)
    return np.array([everything.min(axis=0), everything.max(axis=0)])


def surface_area(scene: SceneData) -> float:
    """Area of all surfaces, m2: decides how many cells are occupied."""
    total = 0.0
    areas: dict[int, float] = {}
    for instance in scene.instances:
        if instance.mesh not in areas:
            mesh = scene.meshes[instance.mesh]
            a, b, c = (mesh.positions[mesh.triangle_vertices[:, k]].astype(np.float64) for k in range(3))
            areas[instance.mesh] = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() * 0.5)
        scale = abs(float(np.linalg.det(instance.world_from_object[:3, :3]))) ** (2.0 / 3.0)
        total += areas[instance.mesh] * scale
    return total


def estimate_memory(resolution: int, extent: tuple[float, float, float], area: float, link_count: int) -> int:
    """Bytes that voxels take at ``resolution`` cells along the longest side of a scene with this extent (m), area (m2).

    A surface of area A enters about 1.5 A / h^2 cells when it lies at an angle, and no more than there are.
    """
    longest = max(max(extent), 1e-9)
    cell = longest / resolution
    sides = [max(1.0, side / cell) for side in extent]
    cells = min(1.5 * area / cell**2, sides[0] * sides[1] * sides[2])
    bricks = sides[0] * sides[1] * sides[2] / BRICK**3
    return int(cells * (BYTES_PER_CELL + FACES_PER_CELL * (BYTES_PER_FACE + 4 * link_count)) + bricks * 16)


def choose_resolution(scene: SceneData, settings: Settings) -> int:
    """Cells along the longest side: as set, or the finest (to 512) whose estimated memory is inside the budget."""
    if not settings.voxel_auto:
        return settings.voxel_resolution
    bounds = scene_bounds(scene)
    if bounds is None:
        return 8
    extent = bounds[1] - bounds[0]
    sides = (float(extent[0]), float(extent[1]), float(extent[2]))
    area = surface_area(scene)
    budget = settings.memory_budget * 2**20
    resolution = 512
    while resolution > 16 and estimate_memory(resolution, sides, area, settings.bounce_rays) > budget:
        resolution -= 8 if resolution <= 128 else 16
    return resolution
