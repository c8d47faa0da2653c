// SPDX-License-Identifier: GPL-3.0-or-later
// trace() of lib/trace.glsl for a list of rays: (origin, limit), (direction, any hit?), grid space.
// Output: (distance, triangle + 1, 0, 0), (normal, 0), (cell, 0).

#include "lib/trace.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Rays { vec4 rays[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Results { vec4 results[]; };

uniform uint count;
uniform uint ray_mask;

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    vec4 a = rays[2u * index];
    vec4 b = rays[2u * index + 1u];
    Hit hit = trace(a.xyz, b.xyz, a.w, ray_mask, b.w > 0.5, hash(index));
    results[3u * index] = vec4(hit.distance, float(hit.triangle + 1u), 0.0, 0.0);
    results[3u * index + 1u] = vec4(hit.normal, 0.0);
    results[3u * index + 2u] = vec4(vec3(hit.cell), 0.0);
}
