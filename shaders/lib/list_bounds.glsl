// SPDX-License-Identifier: GPL-3.0-or-later
// Bounds of the triangles that cells list, while boxes over long lists are made.

#include "lib/cell_list.glsl"
#include "lib/part.glsl"

layout(binding = TEX_CELL_POSITIONS) uniform usampler2D cell_positions_tex;

// Of the triangle of an entry of a cell's list, measured from the cell's lowest corner in its sides, as far as boxes reach.
void bounds_in_cell(uint entry, uint cell, out vec3 low, out vec3 high)
{
    uvec3 words;
    vec3 corner, edge_1, edge_2;
    fetch_corners(fetch_source(cell_triangles_tex, list_texel(entry)).rg, words, corner, edge_1, edge_2);
    ivec3 at = ivec3(unpack_cell(texelFetch(cell_positions_tex, list_texel(cell), 0).r));
    float scale = 1.0 / level_side(level_of_cell(at));
    corner = place_in_cell(corner, at);
    edge_1 *= scale;
    edge_2 *= scale;
    low = clamp(corner + min(vec3(0.0), min(edge_1, edge_2)), -BOX_MARGIN, 1.0 + BOX_MARGIN);
    high = clamp(corner + max(vec3(0.0), max(edge_1, edge_2)), -BOX_MARGIN, 1.0 + BOX_MARGIN);
}
