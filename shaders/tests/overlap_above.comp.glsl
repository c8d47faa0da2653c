// SPDX-License-Identifier: GPL-3.0-or-later
// overlap_above_both() of lib/clipped.glsl for a list of triangles, four vec4 each: corners, with their heights over a
// plane, and their heights over another.    Output: (area, moment x, moment y, 0).

#include "lib/clipped.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Triangles { vec4 corners[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Results { vec4 results[]; };

uniform uint count;

void main()
{
    uint index = invocation_index();
    if (index < count) {
        vec4 a = corners[4u * index], b = corners[4u * index + 1u], c = corners[4u * index + 2u];
        vec3 all = overlap(a.xyz, b.xyz, c.xyz);
        vec3 others = corners[4u * index + 3u].xyz;
        results[index] = vec4(overlap_above_both(a.xyz, b.xyz, c.xyz, vec3(a.w, b.w, c.w), others, all), 0.0);
    }
}
