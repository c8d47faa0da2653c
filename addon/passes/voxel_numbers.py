# SPDX-License-Identifier: GPL-3.0-or-later
"""Which voxel cells are occupied, where they are, and where their lists start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..gpu import interface
from ..grid import Level

#: Longest leap over empty bricks that a brick's record can hold: four bits.
MAX_LEAP = 15

#: Entries of work that are put in order together: less, and few lists are alike; more, and what is near in space lies
#: far apart.
ALIKE_RUN = 1 << 12

_POPCOUNT = np.array([bin(value).count("1") for value in range(1 << 16)], np.uint8)


def popcount(words: np.ndarray) -> np.ndarray:
    """Bits set in each uint64 of ``words``, same shape, int64."""
    halves = np.ascontiguousarray(words).view(np.uint16).reshape(*words.shape, 4)
    return _POPCOUNT[halves].sum(axis=-1, dtype=np.int64)


def empty_octants(occupied: np.ndarray) -> np.ndarray:
    """How far the space is empty that begins with a brick, in each direction that goes up or down along all axes: the
    side, in bricks, of the largest cube without an occupied one (what lies outside the grid is empty), at most 15.

    ``occupied``: (z, y, x) bool. Returns uint32 of the same shape, four bits for each octant: the lowest for that which
    goes up along x, y and z; bit 0 of an octant's number stands for down along x, bit 1 along y, bit 2 along z.
    """
    found = np.zeros((8, *occupied.shape), np.uint8)
    empty = np.pad(~occupied, MAX_LEAP, constant_values=True).view(np.uint8)  # whether the cube that begins there is
    for side in range(1, MAX_LEAP + 1):
        for octant in range(8):
            first = [MAX_LEAP - (side - 1) * (octant >> axis & 1) for axis in (2, 1, 0)]
            found[octant] += empty[tuple(slice(at, at + size) for at, size in zip(first, occupied.shape, strict=True))]
        for axis in range(3):
            ends = [slice(None)] * 3
            ends[axis] = slice(None, -1)
            starts = [slice(None)] * 3
            starts[axis] = slice(1, None)
            empty = empty[tuple(ends)] & empty[tuple(starts)]
    words = np.zeros(occupied.shape, np.uint32)
    for octant in range(8):
        words |= found[octant].astype(np.uint32) << np.uint32(4 * octant)
    return words


def level_octants(occupied: np.ndarray, levels: Sequence[Level]) -> np.ndarray:
    """``empty_octants`` of the levels of a nested grid, each for itself. What a finer level covers is not empty: rays
    go on there. What lies outside a level is, but rays stop at its border.

    ``occupied``: (z, y, x) bool, bricks of the stack.
    """
    words = np.zeros(occupied.shape, np.uint32)
    finer: Level | None = None
    for level in levels:
        part = occupied[level.bricks].copy()
        if finer is not None:
            part[finer.inside(level)] = True
        words[level.bricks] = empty_octants(part)
        finer = level
    return words


def cell_positions(masks: np.ndarray, bricks: tuple[int, int, int], bits_xy: tuple[int, int] = (11, 11)) -> np.ndarray:
    """Positions of occupied cells in the order of their numbers, packed, (N,) uint32: x and y in
    ``bits_xy`` bits, then z.

    ``masks``: (B,) uint64, bricks in the order x fastest.
    """
    y_shift, z_shift = bits_xy[0], sum(bits_xy)
    filled = np.flatnonzero(masks)
    z, rest = np.divmod(filled, bricks[0] * bricks[1])
    y, x = np.divmod(rest, bricks[0])
    corners = ((x | y << y_shift | z << z_shift) * interface.BRICK).astype(np.uint32)
    bit = np.arange(64, dtype=np.uint32)
    inside = bit & 3 | (bit >> 2 & 3) << y_shift | bit >> 4 << z_shift
    bits = np.unpackbits(np.ascontiguousarray(masks[filled]).view(np.uint8), bitorder="little")
    index = np.flatnonzero(bits)
    return corners[index >> 6] | inside[index & 63]


def cell_records(counts: np.ndarray) -> np.ndarray:
    """Records of cells as lib/grid.glsl describes them, (N, 4) uint32, before they have faces.

    ``counts``: (N,) uint32, triangles of each cell.
    """
    records = np.zeros((len(counts), 4), np.uint32)
    np.subtract(np.cumsum(counts, dtype=np.uint32), counts, out=records[:, 0])
    records[:, 1] = counts
    return records


def hidden_cells(records: np.ndarray) -> np.ndarray:
    """What ``records`` (N, 4) uint32 say of the cells beside: (N,) uint32, six bits of each side."""
    near, far = records[:, 2] >> interface.HIDDEN_SHIFT, records[:, 3] >> interface.HIDDEN_SHIFT
    return near | far << 6


def with_hidden_cells(records: np.ndarray, hidden: np.ndarray | int) -> np.ndarray:
    """``records`` (N, 4) uint32 that say ``hidden`` of the cells beside, as ``hidden_cells`` gives it."""
    result = records.copy()
    result[:, 2:] &= (1 << interface.HIDDEN_SHIFT) - 1
    result[:, 2] |= np.uint32(hidden & 63) << np.uint32(interface.HIDDEN_SHIFT)
    result[:, 3] |= np.uint32(hidden >> 6) << np.uint32(interface.HIDDEN_SHIFT)
    return result


def face_counts(facings: np.ndarray) -> np.ndarray:
    """Faces of cells. ``facings``: (N,) uint32, last words of their records."""
    return _POPCOUNT[facings & interface.FACING_MASK]


def runs(before: np.ndarray, now: np.ndarray, lengths: np.ndarray) -> list[tuple[int, int, int]]:
    """Parts of a list that stay beside each other: (first entry before, first entry now, entries), in their order.

    ``before``, ``now``: (N,) where the list of each cell started and starts, both ascending; ``lengths``: (N,) entries.
    """
    listed = lengths > 0
    old, new, count = (values[listed].astype(np.int64) for values in (before, now, lengths))
    if not len(old):
        return []
    breaks = (old[1:] != old[:-1] + count[:-1]) | (new[1:] != new[:-1] + count[:-1])
    starts = np.concatenate([[0], np.flatnonzero(breaks) + 1])
    totals = np.add.reduceat(count, starts)
    return list(zip(old[starts].tolist(), new[starts].tolist(), totals.tolist(), strict=True))


def number_faces(records: np.ndarray, facings: np.ndarray) -> None:
    """Fill in the faces of ``records``. ``facings``: (N,) uint32, their last word."""
    faces = face_counts(facings)
    np.subtract(np.cumsum(faces, dtype=np.uint32), faces, out=records[:, 2])
    records[:, 3] = facings


def cell_axes(facings: np.ndarray) -> tuple[np.ndarray, tuple[int, int, int]]:
    """Work of pass voxel_resolve: cell | side << 29 | axis << 30 for each side and axis that a cell has faces on, axis
    by axis, those last that both sides have; and how many there are of each axis.

    ``facings``: (N,) uint32, last words of records.
    """
    work = []
    for axis in range(3):
        near, far = (facings & (3 << 6 * side + 2 * axis) != 0 for side in range(2))
        alone = [np.flatnonzero(near & ~far), np.flatnonzero(far & ~near) | 1 << 29]
        both = np.flatnonzero(near & far)
        work.append(np.concatenate([*alone, both, both | 1 << 29]).astype(np.uint32) | np.uint32(axis << 30))
    return np.concatenate(work), (len(work[0]), len(work[1]), len(work[2]))


def alike(lengths: np.ndarray) -> np.ndarray:
    """An order in which those with lists of about a length are beside each other, and those that were near stay near:
    threads side by side wait for the longest list of any of them. (N,) int64; ``lengths``: (N,) uint32.
    """
    rows = -(-len(lengths) // ALIKE_RUN)
    keys = np.full(rows * ALIKE_RUN, 0xFFFF, np.uint16)
    keys[: len(lengths)] = np.minimum(lengths, 0xFFFF)
    order = np.argsort(keys.reshape(-1, ALIKE_RUN), axis=1, kind="stable") + ALIKE_RUN * np.arange(rows)[:, None]
    return order.ravel()[: len(lengths)]


def guide_entries(bricks: np.ndarray, records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which guides there are: one for each facing that faces of a brick have.

    ``bricks``: (B, 4) uint32, ``records``: (N, 4) uint32, of cells, as lib/grid.glsl describes them. Returns (B,)
    uint32, number of each brick's first guide << 6 | a bit for each facing, and (G,) uint32, brick << 3 | facing.
    """
    entries = np.zeros(len(bricks), np.uint32)
    filled = np.flatnonzero(bricks[:, 0] | bricks[:, 1])
    if not len(filled):
        return entries, np.zeros(0, np.uint32)
    facings = np.bitwise_or.reduceat(records[:, 3], bricks[filled, 2])
    facings = (facings | facings >> 6) & 63  # on either side of a cut
    counts = _POPCOUNT[facings].astype(np.uint32)
    entries[filled] = (np.cumsum(counts, dtype=np.uint32) - counts) << 6 | facings
    which, facing = np.nonzero(facings[:, None] >> np.arange(6, dtype=np.uint32) & 1)
    return entries, (filled[which] << 3 | facing).astype(np.uint32)
