# SPDX-License-Identifier: GPL-3.0-or-later
"""Nested levels around the camera: when there are some, where they lie, and how large they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .gpu.interface import BRICK
from .grid import (
    MARGIN,
    Level,
    SurfaceMeasure,
    VoxelGrid,
    budget_for,
    bytes_of,
    cells_and_pairs,
    choose_resolution,
    instances_by_mesh,
    mean_scales,
    measure_surfaces,
    placed_boxes,
    scene_bounds,
)
from .scene import CameraData, CameraKind, DoubleArray, SceneData
from .settings import Settings

#: Cells along the sides of levels, at most (positions of cells have nine bits for x and y) and at least.
MOST_CELLS = 512
LEAST_CELLS = 96
#: Levels, at most: whole numbers in shaders are not larger. In scenes for which these are too few, the finest cells are
#: wider than asked.
MOST_LEVELS = 24
#: Cells of the stack of all levels along z, at most: what GL 4.3 promises of a 3D texture of bricks.
MOST_LAYERS = 2048 * BRICK
#: Levels are made smaller in steps of so many cells; each covers whole bricks of the next, around the same middle.
SIDE_STEP = 32
#: Automatically, there are levels where cells of one size would be so many times as wide as the detail that is asked
#: for ...
COARSE = 5.0
#: ... and the camera stands nearer to the scene than so many of them, where it sees how wide they are.
NEAR = 128.0
#: For want of memory, cells of one size do not become fewer than this along the longest side.
LEAST_RESOLUTION = 16
#: The middle of the levels lies at multiples of so many of the finest cells, or of a quarter of the finest level's
#: side, near the camera; ...
STEP = 32
#: ... and so many beside them. In binary 101.0101..., so that what lies at round numbers, as floors do, lies well
#: inside the cells of all levels, not between them.
BESIDE = 16.0 / 3.0
#: While somebody looks on, it stays until the camera is so far from it, in sides of the finest level.
SLACK = 0.2


@dataclass(frozen=True)
class Plan:
    """What is known of a scene's grid before it is known where the camera is."""

    low: tuple[float, ...]  # of what is around everything, world metres
    high: tuple[float, ...]
    resolution: int  # of a grid of one level
    may_nest: bool
    detail: float  # width of the finest cells, metres

    @classmethod
    def of(cls, scene: SceneData, settings: Settings) -> Plan:
        bounds = scene_bounds(scene)
        resolution = choose_resolution(scene, settings)
        if bounds is None:
            return cls((-1.0,) * 3, (1.0,) * 3, resolution, False, settings.voxel_detail)
        longest = float((bounds[1] - bounds[0]).max())
        cell_size = longest / resolution
        # Far from the origin float64 still resolves a cell.
        least = max(longest / (SIDE_STEP << (MOST_LEVELS - 3)), float(np.abs(bounds).max()) * 1e-12)
        detail = max(settings.voxel_detail, least)
        is_coarse = settings.voxel_auto and cell_size > COARSE * detail
        uses_cones = settings.gather_mode == "CONES" or settings.shadow_mode == "CONE"
        may_nest = (settings.voxel_levels == "ON" or (settings.voxel_levels == "AUTO" and is_coarse)) and not uses_cones
        low, high = bounds.tolist()
        return cls(tuple(low), tuple(high), resolution, may_nest and cell_size > detail, detail)

    @property
    def bounds(self) -> DoubleArray:
        """(2, 3)."""
        return np.array([self.low, self.high])

    def middle(
        self, camera: CameraData, settings: Settings, before: tuple[float, ...], grid: VoxelGrid | None
    ) -> tuple[float, ...]:
        """World metres: what levels lie around; (): there are none.

        ``before``: what they lie around in ``grid``, if that may stay though the camera has moved.
        """
        if not self.may_nest:
            return ()
        eye = camera.world_from_camera[:3, 3]
        nearest = np.clip(eye, *self.bounds)
        if settings.voxel_levels == "AUTO":
            reach = NEAR * float((self.bounds[1] - self.bounds[0]).max()) / self.resolution
            if camera.kind is not CameraKind.PERSPECTIVE or float(np.linalg.norm(eye - nearest)) > reach:
                return ()
        if before and grid is not None and grid.levels:
            slack = SLACK * max(grid.levels[0].size) * grid.cell_size
            if (np.abs(nearest - before) <= slack).all():
                return before
        step = (STEP if settings.voxel_auto else min(STEP, _side_as_set(settings) // 4)) * self.detail
        found = np.round(nearest / step) * step + BESIDE * self.detail
        return float(found[0]), float(found[1]), float(found[2])

    def grid(self, scene: SceneData, settings: Settings, middle: tuple[float, ...]) -> VoxelGrid:
        """``middle``: as told above."""
        found = choose_nested(scene, settings, self, np.array(middle)) if middle else None
        return VoxelGrid.around(self.bounds, self.resolution) if found is None else found


def coarsened(plan: Plan | None, grid: VoxelGrid | None) -> dict[str, object]:
    """Settings that give voxels half as many along each side as ``grid``; none: there are no coarser ones."""
    if plan is None or grid is None:
        return {}
    tried, least = plan.resolution, LEAST_RESOLUTION
    if grid.levels:
        tried, least = max(max(level.size) for level in grid.levels), SIDE_STEP
    if tried <= least:
        return {}
    values = {"voxel_auto": False, "voxel_resolution": max(tried // 2, least)}
    if grid.levels:
        return values | {"voxel_levels": "ON", "voxel_detail": grid.cell_size}
    return values | {"voxel_levels": "OFF"}


def nested(bounds: DoubleArray, middle: DoubleArray, side: int, cell_size: float) -> VoxelGrid:
    """The grid over ``bounds`` (2, 3), world metres, of as many levels as it takes around ``middle`` (3,), which lies
    in it or near it. Each is ``side`` cells wide, a multiple of 4 BRICK, and ends where the bounds do.

    ``cell_size``: of the finest cells, metres.
    """
    low, high = (bounds - middle) / cell_size + np.array([[-MARGIN], [MARGIN]])
    half, step = side // 2, 2 * BRICK
    levels: list[Level] = []
    layer, covers = 0, False
    while not covers:
        scale = 1 << len(levels)
        first = np.maximum(np.floor(low / (step * scale)) * step, -half).astype(int).tolist()
        end = np.minimum(np.ceil(high / (step * scale)) * step, half).astype(int).tolist()
        levels.append(Level((first[0], first[1], first[2]), (end[0], end[1], end[2]), layer))
        layer += end[2] - first[2]
        covers = bool((low >= -half * scale).all() and (high <= half * scale).all())
    width, depth = (max(level.size[axis] for level in levels) for axis in (0, 1))
    origin = (float(middle[0]), float(middle[1]), float(middle[2]))
    return VoxelGrid(origin, cell_size, (width, depth, layer), tuple(levels))


def choose_nested(scene: SceneData, settings: Settings, plan: Plan, middle: DoubleArray) -> VoxelGrid | None:
    """The largest levels of the finest cells whose estimated memory is inside the budget; None: cells of one size are
    no wider."""
    if not settings.voxel_auto:
        side = _side_as_set(settings)
        while nested(plan.bounds, middle, side, plan.detail).size[2] > MOST_LAYERS:
            side -= SIDE_STEP
        return nested(plan.bounds, middle, side, plan.detail)
    surfaces = measure_surfaces(scene)
    parts = Parts.of(scene)
    budget = budget_for(surfaces, settings)
    single = float((plan.bounds[1] - plan.bounds[0]).max()) / plan.resolution
    sides = range(LEAST_CELLS, MOST_CELLS + 1, SIDE_STEP)
    cell_size = plan.detail
    while cell_size < single:
        fit, too_large = -1, len(sides)  # sides[fit] fits, sides[too_large] does not
        while too_large - fit > 1:
            tried = (fit + too_large) // 2
            grid = nested(plan.bounds, middle, sides[tried], cell_size)
            memory = parts.estimate_memory(grid, surfaces.bytes_per_pair, settings.bounce_rays)
            fits = memory <= budget and grid.size[2] <= MOST_LAYERS
            fit, too_large = (tried, too_large) if fits else (fit, tried)
        if fit >= 0:
            return nested(plan.bounds, middle, sides[fit], cell_size)
        cell_size *= 2.0
    return None


def _side_as_set(settings: Settings) -> int:
    """Cells along the sides of levels where the resolution is not automatic."""
    return min(-(-settings.voxel_resolution // SIDE_STEP) * SIDE_STEP, MOST_CELLS)


@dataclass(frozen=True)
class Parts:
    """Where a scene's surfaces are: of each instance, a box around it and how much there is inside."""

    boxes: DoubleArray  # (N, 2, 3) world metres
    areas: DoubleArray  # (N,) m2
    perimeters: DoubleArray  # (N,) m, of all triangles
    triangles: DoubleArray  # (N,)

    @classmethod
    def of(cls, scene: SceneData) -> Parts:
        boxes, areas, perimeters, triangles = [], [], [], []
        for mesh, matrices in instances_by_mesh(scene):
            scales = mean_scales(matrices)
            area, perimeter = mesh.area_and_perimeter
            boxes.append(placed_boxes(mesh, matrices))
            areas.append(area * np.square(scales))
            perimeters.append(perimeter * scales)
            triangles.append(np.full(len(matrices), float(len(mesh.triangle_vertices))))
        return cls(*(np.concatenate(values) for values in (boxes, areas, perimeters, triangles)))

    def shares(self, box: DoubleArray) -> DoubleArray:
        """(N,) about which share of each instance's surfaces lies in ``box`` (2, 3): as that of its own box, seen along
        the axis in which most of it does. Surfaces are spread over two dimensions, not over three."""
        extent = self.boxes[:, 1] - self.boxes[:, 0]
        inside = np.minimum(self.boxes[:, 1], box[1]) - np.maximum(self.boxes[:, 0], box[0])
        touches = (inside >= 0.0).all(axis=1)
        along = np.sort(np.where(extent > 0.0, np.maximum(inside, 0.0) / np.maximum(extent, 1e-30), 1.0), axis=1)
        return np.where(touches, along[:, 0] * along[:, 1], 0.0)

    def estimate_memory(self, grid: VoxelGrid, bytes_per_pair: int, bounce_rays: int) -> int:
        """Bytes that voxels and their light take in nested levels."""
        cells, pairs = 0.0, 0.0
        finer = np.zeros(len(self.areas))
        for k, level in enumerate(grid.levels):
            side = grid.cell_size * (1 << k)
            shares = self.shares(np.array([level.first, level.end]) * side + grid.origin)
            there = np.maximum(shares - finer, 0.0)
            finer = shares
            measure = SurfaceMeasure(
                float(self.areas @ there), float(self.perimeters @ there), int(self.triangles @ there)
            )
            more = cells_and_pairs(measure, side, float(np.prod(level.size)))
            cells, pairs = cells + more[0], pairs + more[1]
        bricks = float(np.prod(grid.size)) / BRICK**3
        return bytes_of(bricks, cells, pairs * bytes_per_pair, bounce_rays)
