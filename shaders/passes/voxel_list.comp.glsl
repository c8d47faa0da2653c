// SPDX-License-Identifier: GPL-3.0-or-later
// The triangles of each cell, where nothing asks for their materials; otherwise pass voxel_accumulate lists them.
// Input: pairs, cell numbering.    Output: triangles of cells.

#include "lib/grid.glsl"
#include "lib/part.glsl"
#include "lib/triangle.glsl"

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_PAIRS, SOURCE_PAIRS, rgba32ui) pairs_tex;
layout(std430, binding = BUF_COUNTS) buffer Cursors { uint cursors[]; };  // next list entry of each cell
#if HAS_INSTANCES
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D cell_triangle_img;
#else
layout(binding = IMG_0, r32ui) writeonly uniform uimage2D cell_triangle_img;
#endif

uniform uint pair_first;
uniform uint pair_count;

void main()
{
    uint number = invocation_index();
    if (number >= pair_count) {
        return;
    }
    uvec4 pair = fetch_source(pairs_tex, list_texel(pair_first + number));
    uint slot = atomicAdd(cursors[cell_index(pair_cell(pair))], 1u);
    imageStore(cell_triangle_img, list_texel(slot), uvec4(list_entry(pair.x, fetch_triangle(pair.x)), 0u, 0u));
}
