// SPDX-License-Identifier: GPL-3.0-or-later
// Count the triangles of every occupied cell.    Input: pairs, cell numbering.

#include "lib/grid.glsl"
#include "lib/part.glsl"

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_PAIRS, SOURCE_PAIRS, rgba32ui) pairs_tex;
layout(std430, binding = BUF_COUNTS) buffer Cells { uint cells[]; };

uniform uint pair_count;

void main()
{
    uint number = invocation_index();
    if (number >= pair_count) {
        return;
    }
    uvec4 pair = fetch_source(pairs_tex, list_texel(number));
    atomicAdd(cells[cell_index(pair_cell(pair))], 1u);
}
