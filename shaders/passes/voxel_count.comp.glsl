// SPDX-License-Identifier: GPL-3.0-or-later
// Count the triangles of every occupied cell, and note which ways its surfaces face (both sides of each).
// Input: work items, triangles, cell numbering.    Output: for each cell (triangle count, face mask).

#include "lib/overlap.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Work { uvec2 work[]; };
layout(std430, binding = BUF_COUNTS) buffer Counts { uint counts[]; };

uniform uint work_count;

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre_grid, vec3 normal)
{
    uint index = cell_index(cell);
    if (index == NONE_INDEX) {
        return;
    }
    atomicAdd(counts[2u * index], 1u);
    uint faces = (normal.x != 0.0 ? 3u : 0u) | (normal.y != 0.0 ? 12u : 0u) | (normal.z != 0.0 ? 48u : 0u);
    if ((counts[2u * index + 1u] & faces) != faces) {
        atomicOr(counts[2u * index + 1u], faces);
    }
}

void main()
{
    uint index = invocation_index();
    if (index < work_count) {
        visit_cells(work[index].x, work[index].y);
    }
}
