// SPDX-License-Identifier: GPL-3.0-or-later
// Write down every pair of a triangle and a cell that it enters, and set the cell's bit.
// IS_PART: cells of bricks that are made again, and no others.
// Input: work items, triangles.    Output: pairs (see lib/part.glsl), how many, mask_img.

#include "lib/overlap.glsl"
#include "lib/part.glsl"
#if IS_PART
#include "lib/changed_bricks.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_WORK, SOURCE_WORK, rg32ui) work_tex;
layout(std430, binding = BUF_COUNTS) buffer Counters { uint counters[]; };  // pairs when a batch starts, and in the end
layout(binding = IMG_0, r32ui) uniform uimage3D mask_img;  // two words a brick, side by side in x
layout(binding = IMG_1, rgba32ui) writeonly uniform uimage2D pair_img;

uniform uint work_first;
uniform uint work_count;
uniform uint batch;
uniform uint pair_capacity;  // what does not fit is counted all the same

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre, vec3 normal)
{
#if IS_PART
    if (!is_made_again(cell)) {
        return;
    }
#endif
    uint bit = brick_bit(cell);
    ivec3 brick = cell / BRICK;
    ivec3 at = ivec3(2 * brick.x + int(bit >> 5), brick.yz);
    uint value = 1u << (bit & 31u);
    if ((imageLoad(mask_img, at).r & value) == 0u) {  // most are set already, and looking is cheaper
        imageAtomicOr(mask_img, at, value);
    }
    uint number = atomicAdd(counters[batch], 1u);
    if (number < pair_capacity) {
        uvec4 pair = pack_pair(triangle_index, cell, area, centre, dominant_axis(normal));
        imageStore(pair_img, list_texel(number), pair);
    }
}

void main()
{
    uint index = invocation_index();
    if (index < work_count) {
        uvec2 item = fetch_source(work_tex, list_texel(work_first + index)).rg;
        visit_cells(item.x, item.y);
    }
}
