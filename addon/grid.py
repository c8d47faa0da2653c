# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the voxel grid lies and how fine it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .gpu.interface import BRICK
from .links import link_count
from .scene import DoubleArray, MeshData, SceneData
from .settings import Settings
from .sharing import shares_triangles

#: Cells of margin on each side. Not whole: walls of a box that fills the bounds should not lie between two cells.
MARGIN = 1.37

#: Bytes of a brick, of an occupied cell, of a triangle in a cell, of a face: place, reflectance, order.
BYTES_PER_BRICK = 16
BYTES_PER_CELL = 16
BYTES_PER_PAIR = 4
#: More of it where instances share triangles: which instance it is.
BYTES_PER_INSTANCE_PAIR = 4
BYTES_PER_FACE = 16 + 8 + 8
#: What comes on top when light bounces: straight light, irradiance, radiance twice, a share of the guides of its brick
#: (before there are guides, with whom it shares light). Links are four bytes each. Not in it: what stays where somebody
#: edits the scene, another tenth.
LIGHTING_A_FACE = 8 + 8 + 2 * 8 + 6
#: Faces of an occupied cell, as counted in architectural scenes.
FACES_PER_CELL = 2.25
#: Finest grid that is chosen automatically.
FINEST = 1024


@dataclass(frozen=True)
class Level:
    """A box of a nested grid, in cells of its own, which are 2^k times as wide as those of level 0."""

    first: tuple[int, int, int]  # its lowest cell, counted from the origin of grid space; multiples of 2 BRICK
    end: tuple[int, int, int]  # beyond its highest; multiples of 2 BRICK
    layer: int  # of the stack of all levels' cells: z of its lowest

    @property
    def size(self) -> tuple[int, int, int]:
        x, y, z = (end - first for first, end in zip(self.first, self.end, strict=True))
        return x, y, z

    @property
    def bricks(self) -> tuple[slice, slice, slice]:
        """Where its bricks are among those of the stack, [z, y, x]."""
        x, y, z = (side // BRICK for side in self.size)
        layer = self.layer // BRICK
        return slice(layer, layer + z), slice(y), slice(x)

    def inside(self, coarser: Level) -> tuple[slice, slice, slice]:
        """Where it lies among the bricks of the next coarser level, [z, y, x]."""
        low, high = (
            [(place // 2 - first) // BRICK for place, first in zip(corner, coarser.first, strict=True)]
            for corner in (self.first, self.end)
        )
        return slice(low[2], high[2]), slice(low[1], high[1]), slice(low[0], high[0])


@dataclass(frozen=True)
class VoxelGrid:
    """A box of cubic cells with the axes of the world.

    ``position_grid = (position_ws - origin) / cell_size``, in float64 on the CPU: the origin can be far away.

    Or nested levels (lib/level.glsl), finest first: boxes of cells twice as wide as those before, each around the one
    before, that are stacked along z. A place belongs to the finest level whose box holds it.
    """

    origin: tuple[float, float, float]  # world metres, corner of cell (0, 0, 0); of levels: what they lie around
    cell_size: float  # metres; of levels: of the finest
    size: tuple[int, int, int]  # cells, multiples of BRICK; of levels: of the stack
    levels: tuple[Level, ...] = ()  # none: a single grid

    @property
    def bricks(self) -> tuple[int, int, int]:
        return (self.size[0] // BRICK, self.size[1] // BRICK, self.size[2] // BRICK)

    @property
    def parts(self) -> tuple[Level, ...]:
        """The levels; a single grid is one."""
        return self.levels or (Level((0, 0, 0), self.size, 0),)

    @property
    def grid_from_world(self) -> DoubleArray:
        """(4, 4)."""
        matrix = np.eye(4) / self.cell_size
        matrix[:3, 3] = -np.asarray(self.origin) / self.cell_size
        matrix[3, 3] = 1.0
        return matrix

    @property
    def box(self) -> DoubleArray:
        """(2, 3) what the grid covers, grid space."""
        side = 1 << (len(self.parts) - 1)
        return np.array([self.parts[-1].first, self.parts[-1].end], np.float64) * side

    @property
    def defines(self) -> dict[str, object]:
        """For lib/level.glsl."""
        return {"LEVELS": len(self.levels)}

    @property
    def uniforms(self) -> dict[str, Any]:
        """For lib/grid.glsl."""
        return {"grid_size": self.size} | self.level_uniforms

    @property
    def level_uniforms(self) -> dict[str, Any]:
        """For lib/level.glsl."""
        if not self.levels:
            return {}
        return {
            "level_first": [(*level.first, level.layer) for level in self.levels],
            "level_end": [level.end for level in self.levels],
        }

    @property
    def position_bits(self) -> tuple[int, int]:
        """Bits of x and y where positions of cells are packed (lib/part.glsl); the rest is for z."""
        return (9, 9) if self.levels else (11, 11)

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


def instances_by_mesh(scene: SceneData) -> Iterator[tuple[MeshData, DoubleArray]]:
    """Each mesh that has triangles, with (K, 4, 4) world_from_object of its instances."""
    if not scene.instances:
        return
    owners = np.array([instance.mesh for instance in scene.instances])
    matrices = np.array([instance.world_from_object for instance in scene.instances])
    order = np.argsort(owners, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(owners[order])) + 1):
        mesh = scene.meshes[owners[members[0]]]
        if len(mesh.triangle_vertices):
            yield mesh, matrices[members]


def placed_boxes(mesh: MeshData, matrices: DoubleArray) -> DoubleArray:
    """(K, 2, 3) world metres around each instance of a mesh. ``matrices``: (K, 4, 4) world_from_object."""
    box = mesh.bounds
    corners = np.array([[box[i][0], box[j][1], box[k][2], 1.0] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    points = (corners @ matrices.transpose(0, 2, 1))[:, :, :3]
    return np.stack([points.min(axis=1), points.max(axis=1)], axis=1)


def scene_bounds(scene: SceneData) -> DoubleArray | None:
    """(2, 3) world metres around all instances, or None when nothing has a triangle."""
    boxes = [placed_boxes(mesh, matrices) for mesh, matrices in instances_by_mesh(scene)]
    if not boxes:
        return None
    everything = np.concatenate(boxes)
    return np.array([everything[:, 0].min(axis=0), everything[:, 1].max(axis=0)])


@dataclass(frozen=True)
class SurfaceMeasure:
    """How much there is of the triangles of all instances."""

    area: float  # m2
    perimeter: float = 0.0  # m, of each triangle
    triangles: int = 0
    is_shared: bool = False  # by instances

    @property
    def bytes_per_pair(self) -> int:
        """Of a triangle in a cell's list."""
        return BYTES_PER_PAIR + (BYTES_PER_INSTANCE_PAIR if self.is_shared else 0)


def mean_scales(matrices: DoubleArray) -> DoubleArray:
    """(K,) by how much each of ``matrices`` (K, 4, 4) scales lengths, on average."""
    axes = matrices[:, :3, :3]
    volumes = np.abs(np.linalg.det(axes))
    # A scale of 0 leaves no volume: what is turned all ways keeps half of its surface in the plane.
    sides = np.linalg.norm(np.cross(axes[:, [1, 2, 0]], axes[:, [2, 0, 1]]), axis=(1, 2))
    return np.where(volumes > 1e-6 * sides**1.5, volumes ** (1.0 / 3.0), np.sqrt(0.5 * sides))


def measure_surfaces(scene: SceneData) -> SurfaceMeasure:
    """Decides how many cells are occupied, and how long their lists are."""
    area, perimeter, triangles = 0.0, 0.0, 0
    for mesh, matrices in instances_by_mesh(scene):
        scales = mean_scales(matrices)
        area += mesh.area_and_perimeter[0] * float(np.square(scales).sum())
        perimeter += mesh.area_and_perimeter[1] * float(scales.sum())
        triangles += len(mesh.triangle_vertices) * len(matrices)
    return SurfaceMeasure(area, perimeter, triangles, shares_triangles(scene))


def estimate_memory(
    resolution: int, extent: tuple[float, float, float], surfaces: SurfaceMeasure, bounce_rays: int
) -> int:
    """Bytes that voxels and their light take at ``resolution`` cells along the longest side of a scene.

    ``extent``: its sides, m. ``bounce_rays``: as in the settings. While voxels are made, lists of what triangles bring
    may take more, for a moment.

    How many cells a triangle enters is, on average over where it lies and how it is turned, the volume of its Minkowski
    sum with a cell (Steiner's formula): 1 + 3/4 perimeter / h + 3/2 area / h^2. Triangles of one surface share cells:
    of these there are as many as its area says, and no more than fit.
    """
    longest = max(max(extent), 1e-9)
    cell = longest / resolution
    sides = [max(1.0, side / cell) for side in extent]
    dense = sides[0] * sides[1] * sides[2]
    cells, pairs = cells_and_pairs(surfaces, cell, dense)
    return bytes_of(dense / BRICK**3, cells, pairs * surfaces.bytes_per_pair, bounce_rays)


def cells_and_pairs(surfaces: SurfaceMeasure, cell: float, dense: float) -> tuple[float, float]:
    """How many of ``dense`` cells, ``cell`` metres wide, are occupied, and how long their lists are in all."""
    covered = 1.5 * surfaces.area / cell**2
    return min(covered, dense), surfaces.triangles + 0.75 * surfaces.perimeter / cell + covered


def bytes_of(bricks: float, cells: float, listed: float, bounce_rays: int) -> int:
    """Bytes of voxels and their light. ``cells``: that are occupied, ``listed``: bytes of their lists."""
    faces = FACES_PER_CELL * cells
    of_face = BYTES_PER_FACE + LIGHTING_A_FACE + 4 * link_count(bounce_rays, faces)
    return int(bricks * BYTES_PER_BRICK + cells * BYTES_PER_CELL + listed + faces * of_face)


def budget_for(surfaces: SurfaceMeasure, settings: Settings) -> int:
    """Bytes that voxels and their light may take.

    Every triangle is in some cell's list, however coarse cells are. Where that takes more than half of the budget, the
    other half is for the rest: coarser cells would save nothing, and rays would have more triangles to look at.
    """
    budget = settings.memory_budget * 2**20
    return max(budget, surfaces.triangles * surfaces.bytes_per_pair + budget // 2)


def choose_resolution(scene: SceneData, settings: Settings) -> int:
    """Cells along the longest side: as set, or the finest whose estimated memory is inside the budget."""
    if not settings.voxel_auto:
        return settings.voxel_resolution
    bounds = scene_bounds(scene)
    if bounds is None:
        return 8
    extent = bounds[1] - bounds[0]
    sides = (float(extent[0]), float(extent[1]), float(extent[2]))
    surfaces = measure_surfaces(scene)
    budget = budget_for(surfaces, settings)
    resolution = FINEST
    while resolution > 16 and estimate_memory(resolution, sides, surfaces, settings.bounce_rays) > budget:
        resolution -= 8 if resolution <= 128 else 16
    return resolution
