# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions, points and the octahedral map: their distributions and errors."""

from __future__ import annotations

import numpy as np

from addon.gpu.context import GpuContext
from addon.passes.geometry import octahedral_snorm
from blender_tests.passes.run import map_list, test_kernel

COUNT = 20000


def directions(count: int) -> np.ndarray:
    """Random unit vectors, and all with components of -1, 0 and 1."""
    made = np.random.default_rng(0).normal(size=(count, 3))
    corners = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float)
    made[: len(corners)] = corners
    return made / np.linalg.norm(made, axis=1, keepdims=True)


def sampled(gpu: GpuContext, normals: np.ndarray, u: np.ndarray) -> np.ndarray:
    inputs = np.zeros((len(normals), 8), np.float32)
    inputs[:, :3], inputs[:, 4:6], inputs[:, 6] = normals, u, np.arange(len(normals))
    return map_list(gpu, test_kernel(gpu, "sampling"), inputs, 20)


def test_octahedral_round_trip(gpu: GpuContext) -> None:
    n = directions(COUNT)
    measured = sampled(gpu, n, np.zeros((COUNT, 2)))[:, 8:11]
    np.testing.assert_allclose(measured, n, atol=3e-7)


def test_packed_normals_are_those_of_the_shaders() -> None:
    """Python packs, decoded here by the paper's formula: within what 16 bits hold."""
    n = directions(2000)
    e = octahedral_snorm(n).view(np.int16).reshape(-1, 2) / 32767.0
    z = 1.0 - np.abs(e).sum(axis=1)
    xy = np.where(z[:, None] < 0, (1.0 - np.abs(e[:, ::-1])) * np.where(e >= 0, 1.0, -1.0), e)
    decoded = np.concatenate([xy, z[:, None]], axis=1)
    decoded /= np.linalg.norm(decoded, axis=1, keepdims=True)
    np.testing.assert_allclose(decoded, n, atol=1e-4)
    assert np.isfinite(octahedral_snorm(np.array([[0.0, 0.0, 0.0], [np.nan, 1.0, 0.0]]))).all()


def test_cosine_directions(gpu: GpuContext) -> None:
    """Unit, above the surface, mean cosine 2/3, mean squared 1/2, no side preferred: for normals all around."""
    u = np.random.default_rng(1).random((COUNT, 2))
    for normal in (*np.eye(3), *-np.eye(3), np.array([0.6, -0.48, -0.64])):
        made = sampled(gpu, np.broadcast_to(normal, (COUNT, 3)), u)[:, :3]
        np.testing.assert_allclose(np.linalg.norm(made, axis=1), 1.0, atol=1e-5)
        cosine = made @ normal
        assert cosine.min() >= -1e-6
        assert abs(cosine.mean() - 2 / 3) < 0.01 and abs((cosine**2).mean() - 0.5) < 0.01
        assert np.abs((made - cosine[:, None] * normal).mean(axis=0)).max() < 0.015


def test_disk_points(gpu: GpuContext) -> None:
    u = np.random.default_rng(2).random((COUNT, 2))
    made = sampled(gpu, np.broadcast_to([0.0, 0.0, 1.0], (COUNT, 3)), u)[:, 4:6]
    squared = (made**2).sum(axis=1)
    assert squared.max() <= 1.0 + 1e-6
    np.testing.assert_allclose(np.histogram(squared, 10, (0.0, 1.0))[0] / COUNT, 0.1, atol=0.01)
    np.testing.assert_allclose(made.mean(axis=0), 0.0, atol=0.015)


def test_low_discrepancy_points(gpu: GpuContext) -> None:
    """4096 points: every one of 64 x 64 squares is hit by fewer than 4, and 16 x 16 by 16 each within a few."""
    made = sampled(gpu, np.broadcast_to([0.0, 0.0, 1.0], (4096, 3)), np.zeros((4096, 2)))[:, 6:8]
    assert made.min() >= 0.0 and made.max() < 1.0
    fine = np.histogram2d(*made.T, 64, ((0, 1), (0, 1)))[0]
    coarse = np.histogram2d(*made.T, 16, ((0, 1), (0, 1)))[0]
    assert fine.max() <= 4 and (fine == 0).mean() < 0.25  # random points: 0.37
    assert np.abs(coarse - 16).max() <= 5


def test_scrambled_points_are_a_net(gpu: GpuContext) -> None:
    """Of 2^m points from a multiple of 2^m on, one lies in each of 2^m rectangles, whatever their shape."""
    made = sampled(gpu, np.broadcast_to([0.0, 0.0, 1.0], (4096, 3)), np.zeros((4096, 2)))[:, 6:8]
    for m in range(11):
        for block in (0, 1):
            points = made[block << m : block + 1 << m]
            for k in range(m + 1):
                found = np.floor(points * (1 << k, 1 << m - k)) @ (1 << m - k, 1)
                assert len(set(found.tolist())) == 1 << m, (m, k)
    assert len(np.unique(made % (1 / 64), axis=0)) > 4000  # scrambled below that too: no lattice


def test_hashed_numbers_are_even(gpu: GpuContext) -> None:
    made = sampled(gpu, np.broadcast_to([0.0, 0.0, 1.0], (COUNT, 3)), np.zeros((COUNT, 2)))[:, 12:15]
    assert made.min() >= 0.0 and made.max() < 1.0
    np.testing.assert_allclose(made.mean(axis=0), 0.5, atol=0.01)
    np.testing.assert_allclose(np.corrcoef(made.T), np.eye(3), atol=0.03)


def test_neighbouring_pixels_share_the_square(gpu: GpuContext) -> None:
    """In each aligned block of 8x8 pixels every division of the square into 64 equal boxes has one point in each."""
    found = sampled(gpu, directions(COUNT), np.zeros((COUNT, 2)))
    blocks = set()
    for corner in ((0, 0), (8, 0), (48, 24), (0, 56)):
        numbers = [(corner[0] + x) | (corner[1] + y) << 8 for y in range(8) for x in range(8)]
        points = found[numbers, 16:18].astype(float)
        for k in range(7):
            boxes = np.floor(points[:, 0] * 2**k) + 64 * np.floor(points[:, 1] * 2 ** (6 - k))
            assert len(np.unique(boxes)) == 64, (corner, k)
        blocks.add(tuple(points[0]))
    assert len(blocks) == 4  # no block repeats another
