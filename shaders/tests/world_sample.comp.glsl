// SPDX-License-Identifier: GPL-3.0-or-later
// Directions of the world for a list of (u, v, seed).
// Output: (direction, density), (radiance, weight of a ray of density 1 there).

#define WORLD_IS_TEXTURE 1
#include "lib/common.glsl"
#include "lib/world_sample.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Inputs { vec4 inputs[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Results { vec4 results[]; };

uniform uint count;

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    vec4 given = inputs[index];
    WorldSample s = sample_world(given.xy, uint(given.z));
    results[2u * index] = vec4(s.direction, s.density);
    results[2u * index + 1u] = vec4(s.radiance, world_ray_weight(s.direction, 1.0));
}
