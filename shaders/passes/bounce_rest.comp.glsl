// SPDX-License-Identifier: GPL-3.0-or-later
// What bounces that are not made would still add. Each brings about the same share of what the one before brought, so
// together they are a geometric series: L + rest * (L - L before), rest = share + share^2 + ...
// Input: radiance after the last bounce, and before it.    Output: in place of the latter, W/(m2 sr).
// Aitken 1926, "On Bernoulli's Numerical Solution of Algebraic Equations"; differs: one share for all faces.

#include "lib/packed_light.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_RADIANCE) readonly buffer Radiance { uvec2 radiance[]; };
layout(std430, binding = BUF_RADIANCE_BEFORE) buffer RadianceBefore { uvec2 radiance_before[]; };

uniform uint face_count;
uniform float rest;

void main()
{
    uint face = invocation_index();
    if (face < face_count) {
        vec3 last = unpack_light(radiance[face]);
        vec3 before = unpack_light(radiance_before[face]);
        radiance_before[face] = pack_light(last + rest * (last - before)).xy;
    }
}
