# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells around which nothing stands on a surface."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.interface import BRICK, CUT_BITS
from addon.passes.neighbours import calm_cells
from addon.passes.voxel_numbers import popcount


@pytest.mark.parametrize("shape", [(3, 4, 5), (1, 4, 5), (5, 1, 3), (3, 5, 1), (1, 1, 6)])
@pytest.mark.parametrize("empty", [0.0, 0.4])
def test_calm_cells_have_plain_ones_around_them(shape: tuple[int, int, int], empty: float) -> None:
    """Against a look at all 27, cell by cell: in bricks and across their borders. `empty`: share of bricks."""
    random = np.random.default_rng(shape)
    size = np.array(shape) * BRICK  # z, y, x
    occupied = (random.random(size) < 0.3) & (random.random(shape) >= empty).repeat(4, 0).repeat(4, 1).repeat(4, 2)
    stands = occupied & (random.random(size) < 0.06)
    bricks = np.zeros((*shape, 4), np.uint32)
    order = []  # of cells' numbers: brick by brick
    for brick in np.ndindex(shape):
        inside = np.argwhere(occupied[tuple(slice(BRICK * at, BRICK * at + BRICK) for at in brick)])  # x fastest
        mask = sum(1 << int(x + BRICK * y + BRICK**2 * z) for z, y, x in inside)
        bricks[brick] = (mask & 0xFFFFFFFF, mask >> 32, len(order), 0)
        order += [tuple(BRICK * np.array(brick) + cell) for cell in inside]
    cells = np.array(order)
    assert len(cells) == popcount(np.ascontiguousarray(bricks[..., :2]).view(np.uint64)).sum()
    plain = np.array([0b000011, 0b001100, 0b010000, 0b110000 << 6, 0b000001 | 0b000010 << 6], np.uint32)
    cut = [0b11 | 1 << 12, 0b11 | CUT_BITS]
    standing = np.array([0b001111, 0b110011, 0b010100, 0b000011 | 0b001100 << 6, *cut], np.uint32)
    facings = np.where(stands[tuple(cells.T)], random.choice(standing, len(cells)), random.choice(plain, len(cells)))
    around = np.pad(stands, 1)
    expected = [not around[z : z + 3, y : y + 3, x : x + 3].any() for z, y, x in cells]
    assert 0.1 < np.mean(expected) < 0.9
    np.testing.assert_array_equal(calm_cells(bricks, facings), expected)


def test_without_cells_none_is_calm() -> None:
    assert calm_cells(np.zeros((1, 2, 3, 4), np.uint32), np.zeros(0, np.uint32)).shape == (0,)
