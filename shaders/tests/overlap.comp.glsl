// SPDX-License-Identifier: GPL-3.0-or-later
// overlap() of lib/overlap.glsl for a list of triangles, three vec4 each.    Output: (area, moment x, moment y, 0).

#include "lib/overlap.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Triangles { vec4 corners[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Results { vec4 results[]; };

uniform uint count;

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre, vec3 normal) {}

void main()
{
    uint index = invocation_index();
    if (index < count) {
        uint at = 3u * index;
        results[index] = vec4(overlap(corners[at].xyz, corners[at + 1u].xyz, corners[at + 2u].xyz), 0.0);
    }
}
