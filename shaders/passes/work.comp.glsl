// SPDX-License-Identifier: GPL-3.0-or-later
// Cut the triangles into work items of some columns of cells each. Items are listed batch by batch, and in a batch by
// their number of columns, so that threads side by side have the same to do.
// COUNT: how many items there are of each kind, and about how many pairs of triangle and cell there will be.
// Otherwise: write the items, each kind from its own start.
// Input: triangles, batch of each material.    Output: counters, work items (triangle, item number).

#include "lib/overlap.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_MATERIALS) readonly buffer Batches { uint batch_of_material[]; };
layout(std430, binding = BUF_COUNTS) buffer Counters { uint counters[]; };  // of each kind; last: the estimate of pairs
#if !COUNT
layout(std430, binding = BUF_WORK) writeonly buffer Work { uvec2 work[]; };
#endif

uniform uint triangle_count;
uniform uint ray_mask;  // triangles that none of these rays sees are left out
uniform uint batch_count;
uniform uint block_count;
uniform uint block_size;  // triangles

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
    uint columns = column_count(t);
    if (columns == 0u) {
        return;
    }
    uint kind = (batch_of_material[t.material] * block_count + index / block_size) * COLUMNS_PER_ITEM;
    uint full = (columns - 1u) / COLUMNS_PER_ITEM;
    uint rest = columns - full * COLUMNS_PER_ITEM;
    uint at_rest = atomicAdd(counters[kind + rest - 1u], 1u);
    uint at_full = 0u;
    if (full > 0u) {
        at_full = atomicAdd(counters[kind + COLUMNS_PER_ITEM - 1u], full);
    }
#if COUNT
    atomicAdd(counters[batch_count * block_count * COLUMNS_PER_ITEM], min(expected_cells(t), 3u * columns));
#else
    work[at_rest] = uvec2(index, full);
    for (uint item = 0u; item < full; ++item) {
        work[at_full + item] = uvec2(index, item);
    }
#endif
}
