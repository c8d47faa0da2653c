// SPDX-License-Identifier: GPL-3.0-or-later
// Set the bit of every cell that a triangle enters, and count these pairs of triangle and cell, batch by batch.
// Input: work items, triangles, batch of each material.    Output: mask_img, counters.

#include "lib/overlap.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Work { uvec2 work[]; };
layout(std430, binding = BUF_MATERIALS) readonly buffer Batches { uint batch_of_material[]; };
layout(std430, binding = BUF_COUNTS) buffer Counters { uint counters[]; };
layout(binding = IMG_0, r32ui) uniform uimage3D mask_img;  // two words a brick, side by side in x

uniform uint work_count;

uint pairs = 0u;

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre_grid, vec3 normal)
{
    uint bit = brick_bit(cell);
    ivec3 brick = cell / BRICK;
    ivec3 at = ivec3(2 * brick.x + int(bit >> 5), brick.yz);
    uint value = 1u << (bit & 31u);
    if ((imageLoad(mask_img, at).r & value) == 0u) {  // most are set already, and looking is cheaper
        imageAtomicOr(mask_img, at, value);
    }
    ++pairs;
}

void main()
{
    uint index = invocation_index();
    if (index < work_count) {
        uvec2 item = work[index];
        visit_cells(item.x, item.y);
        uint material = texelFetch(triangles_tex, triangle_texel(item.x), 0).w & 0xFFFFFFu;
        atomicAdd(counters[batch_of_material[material]], pairs);
    }
}
