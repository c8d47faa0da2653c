# SPDX-License-Identifier: GPL-3.0-or-later
"""Where in each pixel the passes of a picture sample."""

from __future__ import annotations

#: Column k: bits of the point's number that bit k of the pass's number changes. A matrix over GF(2) with ones on its
#: diagonal and nothing below: any 2^m passes that begin at a multiple of 2^m have 2^m points that do, in another order.
#: With this one, places and points on lights (``sample_2d`` of lib/sampling.glsl, by the pass's number) fill their four
#: dimensions together; with the same order they would lie on a plane. Found by a search, column by column, for nets of
#: the least t in two, three and four dimensions.
_ORDER = (
    0x1, 0x3, 0x4, 0xD, 0x1B, 0x32, 0x57, 0xF1, 0x146, 0x21A, 0x543, 0xFD5,
    0x17AE, 0x3BBD, 0x5547, 0xFB2C, 0x14FA4, 0x2F84C, 0x6BAC6, 0xD6A81, 0x1661C2, 0x273EB2, 0x5FCC98, 0xE44F53,
)  # fmt: skip
#: Of both coordinates' scrambling: of some 10,000 pairs one by which edges at all angles are smooth after few passes.
_SEEDS = (2828135718, 881331838)


def place_in_pixel(index: int) -> tuple[float, float]:
    """Place of pass ``index``, from 0 on, each coordinate in 0..1: the first two dimensions of the Sobol sequence, a
    (0, 2)-sequence in base 2, Owen-scrambled. The first is the middle: frames that take over light gather there alone.
    After 2^24 passes it begins again.
    """
    number = 0
    for bit, column in enumerate(_ORDER):
        number ^= column if index >> bit & 1 else 0
    first = _reversed(number)
    second = first
    for mask, step in ((0xFFFF, 16), (0xFF00FF, 8), (0xF0F0F0F, 4), (0x33333333, 2), (0x55555555, 1)):
        second ^= (second & mask) << step
    x, y = (
        _reversed(_scrambled(_reversed(bits), seed) ^ _scrambled(0, seed) ^ 1)
        for bits, seed in zip((first, second), _SEEDS, strict=True)
    )
    return x / 2**32, y / 2**32


def _reversed(bits: int) -> int:
    """32 bits, the lowest one first."""
    return int(f"{bits:032b}"[::-1], 2)


def _scrambled(bits: int, seed: int) -> int:
    """``scrambled`` of lib/sampling.glsl."""
    bits ^= bits * 0x3D20ADEA & 0xFFFFFFFF
    bits = (bits + seed) * (seed >> 16 | 1) & 0xFFFFFFFF
    bits ^= bits * 0x05526C56 & 0xFFFFFFFF
    return bits ^ bits * 0x53A22864 & 0xFFFFFFFF
