// SPDX-License-Identifier: GPL-3.0-or-later
// How much of a triangle's part in a cell stops rays, and where: cutouts keep their outlines within a cell.
// A word of a cell's list: a bit for each of OUTLINE_SIZE places of the cell, seen along the axis that the triangle's normal
// is nearest to; the highest eight bits: the opacity of all of it. No bit is set where it is the same all over.

const ivec2 OUTLINE_SIZE = ivec2(7, 8);

// Number of the bit for a place in a cell.
uint outline_bit(vec3 place, int axis)
{
    vec2 across = clamp(vec2(place[(axis + 1) % 3], place[(axis + 2) % 3]), 0.0, 1.0);
    ivec2 at = min(ivec2(across * vec2(OUTLINE_SIZE)), OUTLINE_SIZE - 1);
    return uint(at.y * OUTLINE_SIZE.x + at.x);
}

// A point of that place, `random` from 0 to 1, on the cell's lower side.
vec3 outline_point(uint bit, vec2 random, int axis)
{
    vec2 across = (vec2(int(bit) % OUTLINE_SIZE.x, int(bit) / OUTLINE_SIZE.x) + random) / vec2(OUTLINE_SIZE);
    vec3 place = vec3(0.0);
    place[(axis + 1) % 3] = across.x;
    place[(axis + 2) % 3] = across.y;
    return place;
}

uvec2 pack_outline(uvec2 bits, float opacity)
{
    return uvec2(bits.x, (bits.y & 0xFFFFFFu) | uint(clamp(opacity, 0.0, 1.0) * 255.0 + 0.5) << 24);
}

// Cells tell of themselves, and a little more: rounding must not put a place between two.
const float OUTLINE_MARGIN = 1.0 / 128.0;

// Opacity at a place, from the cell's lowest corner.
float outline_opacity(uvec2 outline, vec3 place, int axis)
{
    bool varies = (outline.x | (outline.y & 0xFFFFFFu)) != 0u;
    bool is_here = all(lessThan(abs(place - 0.5), vec3(0.5 + OUTLINE_MARGIN)));
    uint bit = outline_bit(place, axis);
    uint word = bit < 32u ? outline.x : outline.y;
    return varies ? float(is_here ? word >> (bit & 31u) & 1u : 0u) : float(outline.y >> 24) / 255.0;
}
