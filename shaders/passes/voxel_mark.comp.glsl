// SPDX-License-Identifier: GPL-3.0-or-later
// Set the bit of every cell that a triangle enters.
// Input: work items, triangles.    Output: mask_img.

#include "lib/overlap.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Work { uvec2 work[]; };
layout(binding = IMG_0, r32ui) uniform uimage3D mask_img;

uniform uint work_count;

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre_grid, vec3 normal)
{
    uint bit = brick_bit(cell);
    ivec3 at = mask_texel(cell, bit);
    uint value = 1u << (bit & 31u);
    if ((imageLoad(mask_img, at).r & value) == 0u) {
        imageAtomicOr(mask_img, at, value);
    }
}

void main()
{
    uint index = invocation_index();
    if (index < work_count) {
        visit_cells(work[index].x, work[index].y);
    }
}
