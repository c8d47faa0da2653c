// SPDX-License-Identifier: GPL-3.0-or-later
// How much a bounce has changed, for faces here and there or for all. As the eye sees it, in roots of radiance, so that
// what is dim counts too: Dammertz et al. 2010, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global
// Illumination".
// Input: face_radiance_tex, after the bounce; before_tex, before it.
// Output: changes: sums of roots, and of how much they have changed.

#include "lib/packed_light.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;
layout(binding = TEX_RADIANCE_BEFORE) uniform usampler2D before_tex;
layout(std430, binding = BUF_RESULTS) writeonly buffer Changes { vec2 changes[]; };

uniform uint change_count;
uniform uint face_count;
uniform uint stride;      // of the faces that are asked
uniform uint face_run;    // how many in a row

float root(usampler2D radiance_tex, uint face)
{
    return sqrt(dot(unpack_light(texelFetch(radiance_tex, list_texel(face), 0).rg), vec3(1.0)));
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
        float after = root(face_radiance_tex, face);
        sums += vec2(after, abs(after - root(before_tex, face)));
    }
    changes[number] = sums;
}
