# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of pixels against the projection matrix, and where in the pixel passes sample."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from addon.camera import MAX_REACH, CameraRays, filter_reach, filter_weights, pixel_offset
from addon.grid import VoxelGrid
from addon.scene import CameraData
from blender_tests.passes import scenes

GRID = VoxelGrid((-4.0, 1.0, 2.5), 0.37, (16, 16, 16))
SIZE = (40, 30)


def shifted(made: CameraData) -> CameraData:
    """Lens shift: the third column in perspective, the fourth in orthographic."""
    clip = made.clip_from_camera.copy()
    column = 2 if clip[3, 2] else 3
    clip[0, column] += 0.3
    clip[1, column] -= 0.2
    return dataclasses.replace(made, clip_from_camera=clip)


CAMERAS = {
    "perspective": scenes.camera((3.0, -2.0, 5.0), (0.1, 0.2, 0.3), aspect=4 / 3),
    "orthographic": scenes.camera((3.0, -2.0, 5.0), (0.1, 0.2, 0.3), width=6.0, aspect=4 / 3),
}
CAMERAS |= {f"{name} shifted": shifted(made) for name, made in CAMERAS.items()}
CAMERAS |= {
    f"{name} border": dataclasses.replace(made, border=(0.25, 0.5, 0.75, 0.9)) for name, made in CAMERAS.items()
}


@pytest.mark.parametrize("name", CAMERAS)
def test_points_on_a_ray_project_into_its_pixel(name: str) -> None:
    made = CAMERAS[name]
    rays = CameraRays.of(made, GRID, SIZE)
    clip_from_world = made.clip_from_camera @ np.linalg.inv(made.world_from_camera)
    x0, y0, x1, y1 = made.border
    for pixel in ((0, 0), (39, 29), (17, 4)):
        for offset in ((0.5, 0.5), (0.1, 0.9)):
            u, v = pixel[0] + offset[0], pixel[1] + offset[1]
            origin = rays.origin[0] + rays.origin[1] * u + rays.origin[2] * v
            direction = rays.direction[0] + rays.direction[1] * u + rays.direction[2] * v
            direction = direction / np.linalg.norm(direction)
            for distance in (3.0, 20.0):
                world = (origin + direction * distance) * GRID.cell_size + GRID.origin
                clip = clip_from_world @ [*world, 1.0]
                frame = 0.5 + 0.5 * clip[:2] / clip[3]  # 0..1 of the whole frame
                np.testing.assert_allclose(
                    frame, [x0 + (x1 - x0) * u / SIZE[0], y0 + (y1 - y0) * v / SIZE[1]], atol=1e-9
                )
                # And the matrix that rasterizes puts it at the pixel's centre.
                raster = rays.raster_matrix(offset) @ [*(origin + direction * distance), 1.0]
                pixels = (0.5 + 0.5 * raster[:2] / raster[3]) * SIZE
                np.testing.assert_allclose(pixels, np.add(pixel, 0.5), atol=1e-6)
            assert direction @ rays.forward > 0


@pytest.mark.parametrize("name", CAMERAS)
def test_uniforms(name: str) -> None:
    uniforms = CameraRays.of(CAMERAS[name], GRID, SIZE).uniforms((0.25, 0.75))
    assert uniforms["picture_size"] == SIZE and uniforms["pixel_offset"] == (0.25, 0.75)
    assert all(len(uniforms[key]) == 3 for key in uniforms if key.startswith("ray_"))


def test_offsets_fill_the_pixel() -> None:
    """From the middle on; of 2^m from a multiple of 2^m on, each rectangle of 2^-m of the pixel has one, whatever its
    shape."""
    assert pixel_offset(0, 1.5) == (0.5, 0.5)
    offsets = np.array([pixel_offset(k, 1.5) for k in range(4096)])
    for m in range(9):
        for block in (0, 3, 5):
            places = offsets[block << m : block + 1 << m]
            for k in range(m + 1):
                found = np.floor(places * (1 << k, 1 << m - k)) @ (1 << m - k, 1)
                assert len(set(found.tolist())) == 1 << m, (m, k)
    assert pixel_offset(7, 0.0) == (0.5, 0.5)
    assert np.abs(offsets.mean(axis=0) - 0.5).max() < 1e-4
    assert np.abs(np.array([pixel_offset(k, 0.1) for k in range(64)]) - 0.5).max() <= 0.1


@pytest.mark.parametrize("width", [0.75, 1.0, 1.5, 4.0])
def test_filter_is_the_window(width: float) -> None:
    """All passes together weigh samples by the Blackman-Harris window: its variance, which a wrong width would miss."""
    variance, total = 0.0, 0.0
    for place in (np.arange(200) + 0.5) / 200:
        reach = filter_reach(width)
        weights = np.array(filter_weights(place, width))[: 2 * reach + 1]
        away = np.arange(-reach, reach + 1) + place - 0.5
        variance, total = variance + (weights * away**2).sum(), total + weights.sum()
    x = np.linspace(-1.0, 1.0, 20001)
    window = sum(a * np.cos(np.pi * k * x) for k, a in enumerate((0.35875, 0.48829, 0.14128, 0.01168)))
    np.testing.assert_allclose(variance / total, (window * x**2).sum() / window.sum() * width**2, rtol=0.01)
    assert total / 200 == pytest.approx(1.0, abs=1e-3)


def test_a_narrow_filter_takes_its_own_pixel() -> None:
    assert filter_reach(0.3) == 0 and filter_weights(0.4, 0.3)[:2] == [1.0, 0.0]
    assert len(filter_weights(0.5, 10.0)) == 2 * MAX_REACH + 1


def sobol(count: int) -> np.ndarray:
    """(count, 2) points of the Sobol sequence, by recurrence: what lib/sampling.glsl scrambles for lights."""
    pascal = [1 << 31]
    for _ in range(31):
        pascal.append(pascal[-1] ^ pascal[-1] >> 1)
    points = np.zeros((count, 2), np.uint64)
    for k in range(count.bit_length() - 1):
        points[1 << k : 2 << k] = points[: 1 << k] ^ np.array([1 << 31 - k, pascal[k]], np.uint64)
    return points


def test_places_and_points_on_lights_fill_four_dimensions() -> None:
    """What is seen where shadows end depends on both. Of 2^8 passes each box of 2^-5 in four dimensions has 8, whatever
    its shape. (Scrambling keeps that: points on lights are not scrambled here.)"""
    count = 256
    places = np.array([pixel_offset(k, 1.5) for k in range(count)])
    points = np.concatenate([places, sobol(count) / 2**32], axis=1)
    for digits in (each for each in itertools.product(range(6), repeat=4) if sum(each) == 5):
        boxes = np.floor(points * np.exp2(digits)).astype(int)
        _, found = np.unique(boxes, axis=0, return_counts=True)
        assert len(found) == 32 and (found == 8).all(), digits


def test_places_in_pixels_do_not_go_together_with_points_on_lights() -> None:
    """The film weighs passes by their places; what a neighbour brings on the whole is the mean of what it finds."""
    count, middle = 8192, filter_reach(1.5)
    places = [pixel_offset(k, 1.5) for k in range(count)]
    weights = np.array([filter_weights(x, 1.5)[middle + 1] * filter_weights(y, 1.5)[middle] for x, y in places])
    numbers = np.array([3242174889, 2447445414], np.uint64)  # of lib/sampling.glsl
    shifted = np.arange(count, dtype=np.uint64)[:, None] * numbers
    for shift in np.random.default_rng(1).integers(0, 2**32, (20, 2), dtype=np.uint64):
        for points in ((shift + shifted) % 2**32 / 2**32, (shift ^ sobol(count)) / 2**32):
            brought = points[:, 0] * (points[:, 1] < 0.5)  # a light half behind something
            assert abs((weights * brought).mean() / weights.mean() - 0.25) < 0.01
