// SPDX-License-Identifier: GPL-3.0-or-later
// Directions of the world for a list of (u, v, seed).
// Output: (direction, density), (radiance, weight of a ray of density 1 there).

#define WORLD_IS_TEXTURE 1
#include "lib/common.glsl"
#include "lib/world_sample.glsl"
#include "tests/rows.glsl"

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
