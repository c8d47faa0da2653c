// SPDX-License-Identifier: GPL-3.0-or-later
// Cut the triangles into work items of about equal size, batch by batch.
// COUNT: how many items each batch has, and about how many pairs of triangle and cell there will be.
// Otherwise: write the items, each batch from its own start.
// Input: triangles, batch of each material.    Output: counters, work items (triangle, item number).

#include "lib/overlap.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_MATERIALS) readonly buffer Batches { uint batch_of_material[]; };
layout(std430, binding = BUF_COUNTS) buffer Counters { uint counters[]; };  // of each batch; last: the estimate of pairs
#if !COUNT
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D work_img;
#endif

uniform uint triangle_count;
uniform uint ray_mask;  // triangles that none of these rays sees are left out
uniform uint batch_count;

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre_grid, vec3 normal) {}

void main()
{
    uint index = invocation_index();
    if (index >= triangle_count) {
        return;
    }
    Triangle t = fetch_triangle(index);
    if ((t.flags & ray_mask) == 0u) {
        return;
    }
    uint count = item_count(t);
    if (count == 0u) {
        return;
    }
    uint first = atomicAdd(counters[batch_of_material[t.material]], count);
#if COUNT
    atomicAdd(counters[batch_count], min(expected_cells(t), 3u * uint(COLUMNS_PER_ITEM) * count));
#else
    for (uint item = 0u; item < count; ++item) {
        imageStore(work_img, list_texel(first + item), uvec4(index, item, 0u, 0u));
    }
#endif
}
