# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of voxel faces in two words: what is lost, and that Python reads what shaders write."""

from __future__ import annotations

import numpy as np

from addon.gpu.context import GpuContext
from addon.passes.packed_light import unpack_light
from blender_tests.passes.run import map_list, pack_light, test_kernel

#: Of the largest channel, which is 2^17 to 2^18 steps: half a step, or one where it is cut to what fits.
ERROR = 1.001 * 2.0**-18


def packed(gpu: GpuContext, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What shaders unpack, (N, 3), and the words between, (N, 2) uint32."""
    inputs = np.zeros((len(light), 4), np.float32)
    inputs[:, :3] = light
    found = map_list(gpu, test_kernel(gpu, "packed_light"), inputs, 8)
    halves = found[:, 4:].astype(np.uint32)
    return found[:, :3], np.stack([halves[:, 0] | halves[:, 1] << 16, halves[:, 2] | halves[:, 3] << 16], axis=1)


def random_light() -> np.ndarray:
    rng = np.random.default_rng(0)
    return (10.0 ** rng.uniform(-25.0, 30.0, (4000, 1)) * 10.0 ** rng.uniform(-4.0, 0.0, (4000, 3))).astype(np.float32)


def test_little_is_lost(gpu: GpuContext) -> None:
    light = random_light()
    found, _ = packed(gpu, light)
    largest = light.max(axis=1, keepdims=True)
    error = (found - light) / largest
    assert np.abs(error).max() < ERROR
    assert abs(error.mean()) < 1e-7, "rounding is right on average"


def test_powers_of_two_black_and_odd_numbers(gpu: GpuContext) -> None:
    """What 18 bits hold is exact; what is no number is black, what is below nothing too; the largest stays large."""
    exact = np.array([[1, 0.5, 0], [0, 0, 4096], [2.0**-60, 0, 2.0**-77], [3, 1, 2], [0, 0, 0]], np.float32)
    np.testing.assert_array_equal(packed(gpu, exact)[0], exact)
    odd = np.array([[np.nan, 1, 1], [np.inf, 1, 1], [-1, 2, 0.5], [3.4e38, 0, 0]], np.float32)
    found, _ = packed(gpu, odd)
    np.testing.assert_array_equal(found[:3], [[0, 0, 0], [0, 0, 0], [0, 2, 0.5]])
    assert 2.9e38 < found[3, 0] < np.inf


def test_what_is_too_small_is_black_not_wrong(gpu: GpuContext) -> None:
    found, _ = packed(gpu, np.array([[1e-37, 1e-39, 0], [1e-34, 0, 0]], np.float32))
    assert (found >= 0.0).all() and found.max() <= 1.1e-34


def test_python_reads_and_writes_the_same(gpu: GpuContext) -> None:
    light = random_light()
    found, words = packed(gpu, light)
    np.testing.assert_array_equal(unpack_light(words), found)
    np.testing.assert_array_equal(pack_light(light), words)
