// SPDX-License-Identifier: GPL-3.0-or-later
// Runs of the triangles that cells list, and their bounds, while lists are ordered and get boxes.

#include "lib/cell_list.glsl"
#include "lib/part.glsl"

SOURCE_2D(TEX_CELL_POSITIONS, SOURCE_CELL_POSITIONS, r32ui) cell_positions_tex;

// A run of BOX_RUN entries of a list, or fewer at its end.
struct Run {
    uint first, end;  // entries
    ivec3 cell;
    float scale;      // sides of the cell in one of grid space
};

Run fetch_run(uint cell, uint number)
{
    uvec4 record = fetch_source(cells_tex, list_texel(cell));
    Run run;
    run.first = record.x + BOX_RUN * number;
    run.end = min(run.first + BOX_RUN, record.x + record.y);
    run.cell = unpack_cell(fetch_source(cell_positions_tex, list_texel(cell)).r);
    run.scale = 1.0 / level_side(level_of_cell(run.cell));
    return run;
}

// Of the triangle of an entry, measured from the cell's lowest corner in its sides, as far as boxes reach.
void bounds_in_cell(uint entry, Run run, out vec3 low, out vec3 high)
{
    uvec3 words;
    vec3 corner, edge_1, edge_2;
    fetch_corners(fetch_source(cell_triangles_tex, list_texel(entry)).rg, words, corner, edge_1, edge_2);
    corner = place_in_cell(corner, run.cell);
    low = clamp(corner + min(vec3(0.0), min(edge_1, edge_2)) * run.scale, -BOX_MARGIN, 1.0 + BOX_MARGIN);
    high = clamp(corner + max(vec3(0.0), max(edge_1, edge_2)) * run.scale, -BOX_MARGIN, 1.0 + BOX_MARGIN);
}
