// SPDX-License-Identifier: GPL-3.0-or-later
// Which guides a brick has: number of the first << 6 | a bit for each facing.

bool has_guide(uint entry, uint facing)
{
    return (entry >> facing & 1u) != 0u;
}

// Guides of a brick follow each other in the order of their bits.
uint guide_number(uint entry, uint facing)
{
    return (entry >> 6) + uint(bitCount(entry & ((1u << facing) - 1u)));
}
