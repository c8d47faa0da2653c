// SPDX-License-Identifier: GPL-3.0-or-later
// Write the pairs of triangle and cell, each batch from its own start; count the triangles of every occupied cell, and
// note which ways its surfaces face: each by the axis its normal is nearest to, and both sides of it.
// Input: work items, triangles, cell numbering, batch of each material.
// Output: pairs (triangle, cell, area, centre in the cell); for each cell (triangle count, face mask).

#include "lib/overlap.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Work { uvec2 work[]; };
layout(std430, binding = BUF_MATERIALS) readonly buffer Batches { uint batch_of_material[]; };
layout(std430, binding = BUF_COUNTS) buffer Cursors { uint cursors[]; };  // next pair of each batch
layout(std430, binding = BUF_SUMS) buffer Cells { uint cells[]; };
layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D pair_img;

uniform uint work_count;

uint batch;

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre_grid, vec3 normal)
{
    uint index = cell_index(cell);
    if (index == NONE_INDEX) {
        return;
    }
    atomicAdd(cells[2u * index], 1u);
    uint faces = 3u << uint(2 * dominant_axis(normal));
    if ((cells[2u * index + 1u] & faces) != faces) {
        atomicOr(cells[2u * index + 1u], faces);
    }
    uvec3 centre = uvec3(clamp(centre_grid - vec3(cell), 0.0, 1.0) * 1023.0 + 0.5);
    uvec4 pair = uvec4(triangle_index, index, floatBitsToUint(area), centre.x | centre.y << 10 | centre.z << 20);
    imageStore(pair_img, list_texel(atomicAdd(cursors[batch], 1u)), pair);
}

void main()
{
    uint index = invocation_index();
    if (index < work_count) {
        uvec2 item = work[index];
        batch = batch_of_material[texelFetch(triangles_tex, triangle_texel(item.x), 0).w & 0xFFFFFFu];
        visit_cells(item.x, item.y);
    }
}
