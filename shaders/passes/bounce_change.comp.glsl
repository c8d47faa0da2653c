// SPDX-License-Identifier: GPL-3.0-or-later
// How much a bounce has changed, for faces here and there or for all. As the eye sees it, in roots of radiance, so that
// what is dim counts too: Dammertz et al. 2010, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global
// Illumination".
// Input: radiance after the bounce, and before it.
// Output: changes: sums of roots, and of how much they have changed.

#include "lib/packed_light.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_RADIANCE) readonly buffer Radiance { uvec2 radiance[]; };
layout(std430, binding = BUF_RADIANCE_BEFORE) readonly buffer RadianceBefore { uvec2 radiance_before[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Changes { vec2 changes[]; };

uniform uint change_count;
uniform uint face_count;
uniform uint stride;      // of the faces that are asked
uniform uint face_run;    // how many in a row

float root(uvec2 stored)
{
    return sqrt(dot(unpack_light(stored), vec3(1.0)));
}

void main()
{
    uint number = invocation_index();
    if (number >= change_count) {
        return;
    }
    vec2 sums = vec2(0.0);
    uint first = number * stride;
    for (uint face = first; face < min(first + face_run, face_count); ++face) {
        float after = root(radiance[face]);
        sums += vec2(after, abs(after - root(radiance_before[face])));
    }
    changes[number] = sums;
}
