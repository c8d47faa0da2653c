# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays through pixels, for the shaders: affine in the pixel's place (lib/camera.glsl)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .grid import VoxelGrid
from .places import place_in_pixel
from .scene import CameraData, CameraKind, DoubleArray


@dataclass(frozen=True)
class CameraRays:
    """Uniforms of lib/camera.glsl for one picture, and the matrix that rasterizes it."""

    size: tuple[int, int]  # pixels
    origin: tuple[DoubleArray, DoubleArray, DoubleArray]  # at pixel (0,0), per pixel in x, in y; grid space
    direction: tuple[DoubleArray, DoubleArray, DoubleArray]
    clip_from_grid: DoubleArray  # (4, 4), of the picture (border applied)
    position: DoubleArray  # (3,) grid space
    forward: DoubleArray  # (3,) unit
    depth_range: tuple[float, float]  # of the grid along ``forward``, cells; what is behind the camera left out

    @classmethod
    def of(cls, camera: CameraData, grid: VoxelGrid, size: tuple[int, int]) -> CameraRays:
        """The rays of a picture of ``size`` pixels that shows the camera's border."""
        x0, y0, x1, y1 = camera.border
        # Normalized device coordinates of the border become -1..1.
        crop = np.eye(4)
        crop[0, 0], crop[1, 1] = 1.0 / max(x1 - x0, 1e-9), 1.0 / max(y1 - y0, 1e-9)
        crop[0, 3] = -(x0 + x1 - 1.0) * crop[0, 0]
        crop[1, 3] = -(y0 + y1 - 1.0) * crop[1, 1]
        clip_from_camera = crop @ camera.clip_from_camera
        grid_from_camera = grid.grid_from_world @ camera.world_from_camera
        rotation = camera.world_from_camera[:3, :3]
        eye = grid_from_camera[:3, 3]

        # A pixel's ndc is affine in its place; in camera space x_clip = P00 x + P02 z + P03 and so on.
        p = clip_from_camera
        step = np.array([2.0 / size[0], 2.0 / size[1]])
        zero = np.zeros(3)
        if camera.kind is CameraKind.PERSPECTIVE:
            # At z = -1: w = 1, so x = (ndc_x + P02) / P00.
            corner = rotation @ np.array([(-1.0 + p[0, 2]) / p[0, 0], (-1.0 + p[1, 2]) / p[1, 1], -1.0])
            dx = rotation @ np.array([step[0] / p[0, 0], 0.0, 0.0])
            dy = rotation @ np.array([0.0, step[1] / p[1, 1], 0.0])
            origin, direction = (eye, zero, zero), (corner, dx, dy)
        else:
            scale = 1.0 / grid.cell_size
            corner = rotation @ np.array([(-1.0 - p[0, 3]) / p[0, 0], (-1.0 - p[1, 3]) / p[1, 1], 0.0])
            dx = rotation @ np.array([step[0] / p[0, 0], 0.0, 0.0])
            dy = rotation @ np.array([0.0, step[1] / p[1, 1], 0.0])
            origin = (eye + corner * scale, dx * scale, dy * scale)
            direction = (rotation @ np.array([0.0, 0.0, -1.0]), zero, zero)
        clip_from_grid = clip_from_camera @ np.linalg.inv(grid_from_camera)
        forward = rotation @ np.array([0.0, 0.0, -1.0])
        corners = np.array(np.meshgrid(*grid.box.T)).reshape(3, -1).T
        depths = (corners - eye) @ forward
        nearest, farthest = float(depths.min()), float(depths.max())
        if camera.kind is CameraKind.PERSPECTIVE:
            nearest = max(nearest, 0.0)
        depth_range = (nearest, max(farthest, nearest + 1.0))
        return cls(size, origin, direction, clip_from_grid, eye, forward, depth_range)

    @property
    def eye(self) -> tuple[float, float, float, float]:
        """Homogeneous, grid space: where rays come from, or, of an orthographic camera, against which direction."""
        is_perspective = not self.origin[1].any()
        x, y, z = self.position if is_perspective else -self.forward
        return float(x), float(y), float(z), float(is_perspective)

    def uniforms(self, offset: tuple[float, float]) -> dict[str, Any]:
        """Values for lib/camera.glsl; ``offset``: place in the pixel, (0.5, 0.5) is its centre."""
        names = ("ray_origin", "ray_origin_x", "ray_origin_y", "ray_direction", "ray_direction_x", "ray_direction_y")
        values = (*self.origin, *self.direction)
        result: dict[str, Any] = {
            name: tuple(float(c) for c in value) for name, value in zip(names, values, strict=True)
        }
        return result | {"picture_size": self.size, "pixel_offset": offset}

    def raster_matrix(self, offset: tuple[float, float]) -> DoubleArray:
        """Clip from grid space so that pixel centres lie at ``offset``."""
        shift = np.eye(4)
        shift[0, 3] = (1.0 - 2.0 * offset[0]) / self.size[0]
        shift[1, 3] = (1.0 - 2.0 * offset[1]) / self.size[1]
        return shift @ self.clip_from_grid


#: Pixels to each side that a filter reaches, at most: Blender's widest is 10.
MAX_REACH = 11


def pixel_offset(index: int, filter_width: float) -> tuple[float, float]:
    """Where in each pixel pass ``index`` samples, 0..1: near the middle where the filter is narrower than a pixel."""
    x, y = place_in_pixel(index)
    side = min(1.0, 2.0 * filter_width)
    return 0.5 + (x - 0.5) * side, 0.5 + (y - 0.5) * side


def filter_reach(filter_width: float) -> int:
    """Pixels to each side whose samples a pixel takes."""
    return min(max(int(np.ceil(filter_width - 0.5)), 0), MAX_REACH)


def filter_weights(place: float, filter_width: float) -> list[float]:
    """Weights of the pixels from ``-reach`` to ``reach`` whose samples lie at ``place`` in each; zeros follow.

    Their sum is 1 on average over places: a pass counts by what it finds of the filter.

    The Blackman-Harris window (Harris 1978), which falls to zero ``filter_width`` pixels from the middle: as in Cycles,
    it is twice as wide in all as the setting says.
    """
    reach = filter_reach(filter_width)
    if reach == 0:
        return [1.0] + [0.0] * (2 * MAX_REACH)
    x = np.clip((np.arange(-reach, reach + 1) + place - 0.5) / filter_width, -1.0, 1.0) * np.pi
    weights = 0.35875 + 0.48829 * np.cos(x) + 0.14128 * np.cos(2.0 * x) + 0.01168 * np.cos(3.0 * x)
    weights /= 2.0 * 0.35875 * filter_width  # its integral
    return [*np.maximum(weights, 0.0).tolist(), *[0.0] * (2 * (MAX_REACH - reach))]
