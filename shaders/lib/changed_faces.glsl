// SPDX-License-Identifier: GPL-3.0-or-later
// Which faces an edit of the scene may have changed the light of, where the others are taken over: those that are new,
// and those with a ray that crosses a box around what was edited. They are listed.

#include "lib/common.glsl"

layout(binding = TEX_NUMBERS_BEFORE) uniform usampler2D numbers_before_tex;
layout(binding = IMG_1, r32ui) writeonly uniform uimage2D changed_img;
layout(std430, binding = BUF_COUNTS) buffer Counters { uint changed_count; };

uniform vec3 box_low[CHANGED_BOXES];  // grid space
uniform vec3 box_high[CHANGED_BOXES];
uniform int box_count;

// Number of a face in the lists before; NONE_INDEX: it is new.
uint number_before(uint face)
{
    return texelFetch(numbers_before_tex, list_texel(face), 0).r;
}

// Whether a ray may meet something else than before, up to `limit`: cells.
bool crosses_box(vec3 origin, vec3 direction, float limit)
{
    vec3 inverse = 1.0 / mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
    bool crosses = false;
    for (int k = 0; k < box_count; ++k) {
        vec3 a = (box_low[k] - origin) * inverse;
        vec3 b = (box_high[k] - origin) * inverse;
        vec3 enter = min(a, b);
        vec3 leave = max(a, b);
        float first = max(0.0, max(enter.x, max(enter.y, enter.z)));
        crosses = crosses || first <= min(limit, min(leave.x, min(leave.y, leave.z)));
    }
    return crosses;
}

void list_changed(uint face)
{
    imageStore(changed_img, list_texel(atomicAdd(changed_count, 1u)), uvec4(face));
}
