// SPDX-License-Identifier: GPL-3.0-or-later
// Walls in a cell: what its surfaces sum up to along each axis, and whether the cell may have to be cut in two.

#include "lib/part.glsl"
#include "lib/source.glsl"

SOURCE_2D(TEX_PARTS, SOURCE_PARTS, rgba32ui) parts_tex;

// Area in sides of cells: what is smaller is not worth faces of its own.
const float LEAST_AREA = 0.3;

// All ones for the axis of a facing.
uvec3 axis_mask(uint facing)
{
    return uvec3(equal(uvec3(0u, 1u, 2u), uvec3(facing >> 1))) * 0xFFFFFFFFu;
}

// Area, and area x place along the axis, of the facings.
struct Areas {
    uvec3 plus, minus, plus_place, minus_place;
    uint axes;  // that surfaces face, a bit each
};

// Of parts of a list that is not empty.
Areas sum_areas(uint first, uint end)
{
    Areas sums = Areas(uvec3(0u), uvec3(0u), uvec3(0u), uvec3(0u), 0u);
    uint k = first;
    do {
        Part part = unpack_part(fetch_source(parts_tex, list_texel(k)));
        uvec3 mask = axis_mask(part.facing);
        bool is_minus = (part.facing & 1u) != 0u;
        sums.plus += is_minus ? uvec3(0u) : part.area & mask;
        sums.minus += is_minus ? part.area & mask : uvec3(0u);
        sums.plus_place += is_minus ? uvec3(0u) : part.position & mask;
        sums.minus_place += is_minus ? part.position & mask : uvec3(0u);
        sums.axes |= 1u << (part.facing >> 1);
    } while (++k < end);
    return sums;
}

struct Walls {
    bool is_single;    // all surfaces face the same axis
    bool may_be_cut;
    vec3 plus_mean, minus_mean, middle;
    vec3 gap;          // air: surfaces that face each other
    vec3 place;        // of a wall across each axis
    vec3 area;
};

Walls find_walls(Areas sums)
{
    Walls walls;
    walls.is_single = bitCount(sums.axes) < 2;
    walls.area = vec3(max(sums.plus, sums.minus)) / FIXED_ONE;
    walls.plus_mean = vec3(sums.plus_place) / max(vec3(sums.plus), 1.0);
    walls.minus_mean = vec3(sums.minus_place) / max(vec3(sums.minus), 1.0);
    walls.gap = vec3(min(sums.plus, sums.minus)) * vec3(greaterThan(walls.minus_mean, walls.plus_mean)) / FIXED_ONE;
    walls.may_be_cut = !walls.is_single || max_component(walls.gap) > LEAST_AREA ||
                       max_component(walls.area) > 1.0 + LEAST_AREA;
    // In the middle between their sides, where they have two.
    walls.middle = 0.5 * (walls.plus_mean + walls.minus_mean);
    walls.place = mix(walls.minus_mean, walls.plus_mean, greaterThanEqual(sums.plus, sums.minus));
    for (int a = 0; a < 3; ++a) {
        bool has_two = sums.plus[a] > 0u && sums.minus[a] > 0u && walls.minus_mean[a] < walls.plus_mean[a];
        walls.place[a] = has_two ? walls.middle[a] : walls.place[a];
    }
    return walls;
}
