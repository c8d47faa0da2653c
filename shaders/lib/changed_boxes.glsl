// SPDX-License-Identifier: GPL-3.0-or-later
// Boxes around what was edited: rays that cross none of them meet what they met before.

#include "lib/common.glsl"

uniform vec3 box_low[CHANGED_BOXES];  // grid space
uniform vec3 box_high[CHANGED_BOXES];
uniform int box_count;
uniform vec3 hull_low;  // a box around all of them
uniform vec3 hull_high;

bool crosses(vec3 low, vec3 high, vec3 origin, vec3 inverse, float limit)
{
    vec3 a = (low - origin) * inverse;
    vec3 b = (high - origin) * inverse;
    vec3 enter = min(a, b);
    vec3 leave = max(a, b);
    return max(0.0, max(enter.x, max(enter.y, enter.z))) <= min(limit, min(leave.x, min(leave.y, leave.z)));
}

vec3 inverse_of(vec3 direction)
{
    return 1.0 / mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
}

// Whether a ray crosses a box before `limit` (cells); boxes grow by `margin` on all sides. Most rays miss what is around
// all boxes.
bool crosses_box(vec3 origin, vec3 direction, float limit, float margin)
{
    vec3 inverse = inverse_of(direction);
    bool meets_hull = crosses(hull_low - margin, hull_high + margin, origin, inverse, limit);
    bool found = meets_hull && box_count == 1;
    int k = 0;
    if (meets_hull && box_count > 1) do {
        found = found || crosses(box_low[k] - margin, box_high[k] + margin, origin, inverse, limit);
    } while (++k < box_count);
    return found;
}

// Whether a ray crosses the box around all boxes, however far.
bool crosses_hull(vec3 origin, vec3 direction)
{
    return crosses(hull_low, hull_high, origin, inverse_of(direction), 1e30);
}

// Whether something of the boxes may lie above the plane through a point.
bool lies_above(vec3 point, vec3 normal)
{
    return dot(mix(hull_low, hull_high, greaterThan(normal, vec3(0.0))) - point, normal) > -0.01;
}
