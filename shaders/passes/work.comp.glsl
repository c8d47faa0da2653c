// SPDX-License-Identifier: GPL-3.0-or-later
// Cut the triangles into work items of about equal size.
// COUNT: how many there are.    Otherwise: write them.
// Input: triangles.    Output: counter, work items (triangle, item number).

#include "lib/overlap.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_COUNTS) buffer Counter { uint counter; };
#if !COUNT
layout(std430, binding = BUF_WORK) writeonly buffer Work { uvec2 work[]; };
#endif

uniform uint triangle_count;
uniform uint ray_mask;  // triangles that none of these rays sees are left out

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
    uint first = atomicAdd(counter, count);
#if !COUNT
    for (uint item = 0u; item < count; ++item) {
        work[first + item] = uvec2(index, item);
    }
#endif
}
