# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts that surfaces bring to faces are kept bit by bit."""

from __future__ import annotations

import numpy as np

from addon.gpu.context import GpuContext
from blender_tests.passes.run import map_list, test_kernel


def test_parts_are_kept(gpu: GpuContext) -> None:
    """Random parts, and each number alone at its largest: 17 bits, six facings."""
    rng = np.random.default_rng(4)
    largest = np.array([5] + [2**17 - 1] * 7)
    rows = np.concatenate([rng.integers(0, largest + 1, (200, 8)), np.diag(largest)]).astype(np.float64)
    found = map_list(gpu, test_kernel(gpu, "part", {"LEVELS": 0}), rows, 8)
    np.testing.assert_array_equal(found, rows)


def test_a_part_too_large_stays_the_largest(gpu: GpuContext) -> None:
    rows = np.full((1, 8), 2.0**20 + 5)
    rows[0, 0] = 5.0
    found = map_list(gpu, test_kernel(gpu, "part", {"LEVELS": 0}), rows, 8)
    np.testing.assert_array_equal(found[0], [5.0] + [2**17 - 1] * 7)
