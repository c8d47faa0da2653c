// SPDX-License-Identifier: GPL-3.0-or-later
// Directions drawn by guides: by how much light arrives from them at the bricks around, as bounces have found it.
// A guide is a tree of shares over the square of a facing's hemisphere: a texel splits a square into four.
// Clarberg et al. 2005, "Wavelet Importance Sampling"; guides as such: Jensen 1995, "Importance Driven Path Tracing Using
// the Photon Map". They only decide how many rays go where; what rays bring is divided by it.

#include "lib/grid.glsl"
#include "lib/guide_number.glsl"
#include "lib/hemisphere.glsl"

layout(binding = TEX_GUIDES) uniform sampler2D guides_tex;
layout(binding = TEX_GUIDE_NUMBERS) uniform usampler3D guide_numbers_tex;

struct Guide {
    uint first;  // texel; NONE_INDEX: there is no guide
    uint facing;
};

Guide guide_at(vec3 position, vec3 geometric_normal)
{
    Guide guide = Guide(NONE_INDEX, facing_of(geometric_normal));
    ivec3 cell = nearest_cell(position);
    uint entry = texelFetch(guide_numbers_tex, cell / BRICK, 0).r;
    if (has_guide(entry, guide.facing)) {
        uint first = guide_number(entry, guide.facing) * uint(GUIDE_TEXELS);
        bool is_empty = texelFetch(guides_tex, list_texel(first), 0) == vec4(0.0);  // light is too even for one
        guide.first = is_empty ? NONE_INDEX : first;
    }
    return guide;
}

// Shares of the four parts of a square: left and right of its lower half, of its upper half. None is zero.
vec4 guide_shares(uint level_first, ivec2 square, int level)
{
    vec4 shares = max(texelFetch(guides_tex, list_texel(level_first + uint(square.x + (square.y << level))), 0), 1.0 / 255.0);
    return shares / (shares.x + shares.y + shares.z + shares.w);
}

// A direction for a point of the unit square. Points that are spread evenly give directions that are.
vec3 sample_guide(Guide guide, vec2 u)
{
    uint level_first = guide.first;
    ivec2 square = ivec2(0);
    for (int level = 0; level < GUIDE_LEVELS; ++level) {
        vec4 shares = guide_shares(level_first, square, level);
        float lower = shares.x + shares.y;
        bool upper = u.y >= lower;
        u.y = upper ? (u.y - lower) / (1.0 - lower) : u.y / lower;
        vec2 half_shares = upper ? shares.zw : shares.xy;
        float left = half_shares.x / (half_shares.x + half_shares.y);
        bool right = u.x >= left;
        u.x = right ? (u.x - left) / (1.0 - left) : u.x / left;
        square = 2 * square + ivec2(right, upper);
        level_first += 1u << uint(2 * level);
    }
    vec2 place = (vec2(square) + clamp(u, 0.0, 1.0)) / float(GUIDE_SIDE);
    return grid_from_facing(guide.facing, hemisphere_from_square(place));
}

// Chance for each steradian that `sample_guide` draws this direction.
float guide_density(Guide guide, vec3 direction)
{
    vec3 local = facing_from_grid(guide.facing, direction);
    if (local.z <= 0.0) {
        return 0.0;
    }
    ivec2 place = ivec2(square_from_hemisphere(local) * float(GUIDE_SIDE));
    float density = local.z / PI * float(GUIDE_SIDE * GUIDE_SIDE);
    uint level_first = guide.first;
    for (int level = 0; level < GUIDE_LEVELS; ++level) {
        ivec2 part = (place >> (GUIDE_LEVELS - 1 - level)) & 1;
        density *= guide_shares(level_first, place >> (GUIDE_LEVELS - level), level)[part.x + 2 * part.y];
        level_first += 1u << uint(2 * level);
    }
    return density;
}
