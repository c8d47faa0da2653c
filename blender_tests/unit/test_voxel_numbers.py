# SPDX-License-Identifier: GPL-3.0-or-later
"""How occupied cells are numbered, and how far it is empty around them."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.interface import BRICK
from addon.passes.voxel_numbers import (
    ALIKE_RUN,
    alike,
    cell_axes,
    cell_positions,
    cell_records,
    empty_octants,
    guide_entries,
    hidden_cells,
    number_faces,
    popcount,
    with_hidden_cells,
)


def masks_of(cells: np.ndarray, bricks: tuple[int, int, int]) -> np.ndarray:
    """(B,) uint64: bit x + 4 y + 16 z of brick x + X (y + Y z)."""
    masks = np.zeros(bricks[0] * bricks[1] * bricks[2], np.uint64)
    for cell in cells:
        brick, inside = np.divmod(cell, BRICK)
        index = brick[0] + bricks[0] * (brick[1] + bricks[1] * brick[2])
        masks[index] |= np.uint64(1) << np.uint64(inside[0] + 4 * inside[1] + 16 * inside[2])
    return masks


def test_popcount() -> None:
    words = np.array([[0, 1, 2**64 - 1], [2**63, 0xF0F0, 2**32 - 1]], np.uint64)
    np.testing.assert_array_equal(popcount(words), [[0, 1, 64], [1, 8, 32]])


@pytest.mark.parametrize("count", [0, 1, ALIKE_RUN, 2 * ALIKE_RUN + 17])
def test_lists_of_a_length_come_together(count: int) -> None:
    """Everything once, by length within each run; equal ones, and those of any great length, as they were."""
    lengths = np.random.default_rng(1).choice(np.array([1, 5, 70_000, 2**32 - 1], np.uint32), count)
    order = alike(lengths)
    np.testing.assert_array_equal(np.sort(order), np.arange(count))
    np.testing.assert_array_equal(order // ALIKE_RUN, np.arange(count) // ALIKE_RUN)
    expected = np.lexsort([np.minimum(lengths, 70_000), np.arange(count) // ALIKE_RUN])
    np.testing.assert_array_equal(order, expected)


@pytest.mark.parametrize("bricks", [(1, 1, 1), (3, 2, 5)])
def test_cells_are_numbered_brick_by_brick(bricks: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(0)
    cells = np.unique(rng.integers(0, np.array(bricks) * BRICK, (60, 3)), axis=0)
    packed = cell_positions(masks_of(cells, bricks), bricks)
    found = np.stack([packed & 2047, packed >> 11 & 2047, packed >> 22], axis=1)
    assert {tuple(cell) for cell in found} == {tuple(cell) for cell in cells}
    brick, inside = np.divmod(found.astype(np.int64), BRICK)
    order = (brick @ [1, bricks[0], bricks[0] * bricks[1]]) * 64 + inside @ [1, 4, 16]
    assert (np.diff(order) > 0).all()


def test_no_cells() -> None:
    assert len(cell_positions(np.zeros(8, np.uint64), (2, 2, 2))) == 0


def test_the_last_cell_of_the_largest_grid_fits() -> None:
    """1023 in each axis: 11, 11 and 10 bits."""
    masks = np.zeros(256 * 256 * 256, np.uint64)
    masks[-1] = np.uint64(1) << np.uint64(63)
    packed = int(cell_positions(masks, (256, 256, 256))[0])
    assert (packed & 2047, packed >> 11 & 2047, packed >> 22) == (1023, 1023, 1023)


def test_empty_octants() -> None:
    """Against cubes that grow until they hold an occupied brick; what lies outside the grid is empty."""
    occupied = np.random.default_rng(4).random((5, 7, 9)) < 0.02
    occupied[2, 3, 4] = True
    found = empty_octants(occupied)
    for place in np.ndindex(occupied.shape):
        for octant in range(8):
            downwards = [octant >> axis & 1 for axis in (2, 1, 0)]
            side = 0
            while side < 15:
                ends = [(c - side * down, c + 1 + side * (1 - down)) for c, down in zip(place, downwards, strict=True)]
                if occupied[tuple(slice(max(low, 0), high) for low, high in ends)].any():
                    break
                side += 1
            assert found[place] >> 4 * octant & 15 == side


def test_empty_octants_reach_as_far_as_four_bits_hold() -> None:
    far = np.zeros((1, 1, 40), bool)
    far[0, 0, 0] = True
    found = empty_octants(far)[0, 0]
    np.testing.assert_array_equal(found >> 4 & 15, np.minimum(np.arange(40), 15))
    np.testing.assert_array_equal(found & 15, np.where(np.arange(40) == 0, 0, 15))


def test_cells_get_their_share_of_lists_and_faces() -> None:
    """Three triangles facing x and z, one facing y, two facing all ways, of these x on one side of a cut across z, y on
    both, z beyond: lists and faces follow each other."""
    counts = np.array([3, 1, 2], np.uint32)
    facings = np.array([0b110011, 0b001100, 0b111100001111 | 3 << 12 | 127 << 14], np.uint32)
    records = cell_records(counts)
    np.testing.assert_array_equal(records, [[0, 3, 0, 0], [3, 1, 0, 0], [4, 2, 0, 0]])
    number_faces(records, facings)
    np.testing.assert_array_equal(records[:, :3], [[0, 3, 0], [3, 1, 4], [4, 2, 6]])
    np.testing.assert_array_equal(records[:, 3], facings)
    work, axis_counts = cell_axes(facings)
    assert work.dtype == np.uint32 and axis_counts == (2, 3, 2)
    beyond, y, z = 1 << 29, 1 << 30, 2 << 30
    np.testing.assert_array_equal(work, [0, 2, 1 | y, 2 | y, 2 | y | beyond, 0 | z, 2 | z | beyond])


def test_no_cells_have_nothing() -> None:
    none = np.zeros(0, np.uint32)
    assert cell_records(none).shape == (0, 4)
    assert cell_axes(none)[0].shape == (0,) and cell_axes(none)[1] == (0, 0, 0)


def test_guides_of_bricks() -> None:
    """Two bricks with cells, one between them without: each has a guide for every facing of its cells."""
    bricks = np.zeros((3, 4), np.uint32)
    bricks[0, :3] = 0b11, 0, 0  # cells 0 and 1
    bricks[2, :3] = 0, 0b1, 2  # cell 2
    records = np.zeros((3, 4), np.uint32)
    records[:, 3] = 0b000011, 0b001001, 0b110000
    entries, work = guide_entries(bricks, records)
    np.testing.assert_array_equal(entries, [0 << 6 | 0b001011, 0, 3 << 6 | 0b110000])
    np.testing.assert_array_equal(work, [0 << 3 | 0, 0 << 3 | 1, 0 << 3 | 3, 2 << 3 | 4, 2 << 3 | 5])


def test_no_guides() -> None:
    entries, work = guide_entries(np.zeros((2, 4), np.uint32), np.zeros((0, 4), np.uint32))
    assert not entries.any() and len(work) == 0


def test_hidden_cells_share_words_of_records() -> None:
    records = np.array([[7, 3, 5, 0xABC | 0x3FFFFF & ~0xFFF], [9, 1, (1 << 26) - 1, 0x3FFFFFF]], np.uint32)
    hidden = np.array([0b101010_010101, 0xFFF], np.uint32)
    told = with_hidden_cells(records, hidden)
    np.testing.assert_array_equal(hidden_cells(told), hidden)
    np.testing.assert_array_equal(told[:, :2], records[:, :2])
    np.testing.assert_array_equal(told[:, 2:] & 0x3FFFFFF, records[:, 2:])
    np.testing.assert_array_equal(with_hidden_cells(told, 0), records)
