// SPDX-License-Identifier: GPL-3.0-or-later
// Boxes around what was edited: rays that cross none of them meet what they met before.

#include "lib/common.glsl"

uniform vec3 box_low[CHANGED_BOXES];  // grid space
uniform vec3 box_high[CHANGED_BOXES];
uniform int box_count;

// Whether a ray crosses a box before `limit` (cells); boxes grow by `margin` on all sides.
bool crosses_box(vec3 origin, vec3 direction, float limit, float margin)
{
    vec3 inverse = 1.0 / mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
    bool crosses = false;
    for (int k = 0; k < box_count; ++k) {
        vec3 a = (box_low[k] - margin - origin) * inverse;
        vec3 b = (box_high[k] + margin - origin) * inverse;
        vec3 enter = min(a, b);
        vec3 leave = max(a, b);
        float first = max(0.0, max(enter.x, max(enter.y, enter.z)));
        crosses = crosses || first <= min(limit, min(leave.x, min(leave.y, leave.z)));
    }
    return crosses;
}

// Whether some of a box lies above the plane through a point.
bool lies_above(vec3 point, vec3 normal)
{
    bool above = false;
    for (int k = 0; k < box_count; ++k) {
        vec3 highest = mix(box_low[k], box_high[k], greaterThan(normal, vec3(0.0)));
        above = above || dot(highest - point, normal) > -0.01;
    }
    return above;
}
