// SPDX-License-Identifier: GPL-3.0-or-later
// Exact area and centre of the part of a triangle that lies inside a cell.
//
// The triangle is projected along its dominant axis. The part inside a cell is the triangle cut to a strip of depth
// (three clipped edges and two caps), then to a unit square: its area is the sum over the outline's segments of
//     integral of clamp(y, 0, 1) dx  for x in [0, 1],
// with first moments likewise. Clamps are continuous, so nothing can be lost at grazing angles, there are no vertex
// lists, and neighbouring cells use the same numbers for the line they share. Of what lies above two planes, the outline
// is cut by these first.

#include "lib/common.glsl"

// Turn the axes so that `axis` becomes z, and back.
vec3 turn(vec3 v, int axis)
{
    return axis == 0 ? v.yzx : (axis == 1 ? v.zxy : v);
}
ivec3 turn(ivec3 v, int axis)
{
    return axis == 0 ? v.yzx : (axis == 1 ? v.zxy : v);
}
vec3 turn_back(vec3 v, int axis)
{
    return axis == 0 ? v.zxy : (axis == 1 ? v.yzx : v);
}
ivec3 turn_back(ivec3 v, int axis)
{
    return axis == 0 ? v.zxy : (axis == 1 ? v.yzx : v);
}

// Narrower segments (of a cell's side) bring nothing; slopes of others fit into a float.
const float NO_WIDTH = 1e-20;

// Add segment a-b of an outline to (area, moment in x, moment in y).
void add_segment(inout vec3 sums, vec2 a, vec2 b)
{
    float x0 = clamp(a.x, 0.0, 1.0);
    float width = clamp(b.x, 0.0, 1.0) - x0;
    bool is_there = abs(width) > NO_WIDTH;
    float slope = is_there ? (b.y - a.y) / (b.x - a.x) : 0.0;
    float y0 = a.y + (x0 - a.x) * slope;
    float y1 = a.y + (x0 + width - a.x) * slope;
    float c0 = clamp(y0, 0.0, 1.0);
    float c1 = clamp(y1, 0.0, 1.0);
    // While y, clamped, goes from c0 to c1, u = x - x0 goes from `first` to `last`; before and after, it stays.
    float rise = c1 - c0;
    float span = y1 - y0;
    float per_rise = abs(span) > NO_WIDTH ? width / span : 0.0;
    float first = (c0 - y0) * per_rise;
    float last = width + (c1 - y1) * per_rise;
    // By parts: integral of c du = u c - integral of u dc, and so on.
    float both = first + last;
    float area = width * c1 - 0.5 * rise * both;
    float sixth = rise * (1.0 / 6.0);
    float in_x = 0.5 * width * width * c1 - sixth * (both * both - first * last) + x0 * area;
    float in_y = 0.5 * width * c1 * c1 - sixth * (both * (c0 + c1) + first * c0 + last * c1);
    sums += is_there ? vec3(area, in_x, in_y) : vec3(0.0);
}

// Cut edge a-b to 0 <= z < 1, add what is left, and note where it crosses the two planes: points where the outline
// enters and leaves the strip are joined by the caps.
void add_edge(inout vec3 sums, vec3 a, vec3 b, inout vec2 low_out, inout vec2 low_in, inout bool low,
              inout vec2 high_out, inout vec2 high_in, inout bool high)
{
    bool a_below = a.z < 0.0, b_below = b.z < 0.0;
    bool a_above = a.z >= 1.0, b_above = b.z >= 1.0;
    float per_height = 1.0 / (a.z - b.z);
    vec2 at_low = mix(a.xy, b.xy, clamp(a.z * per_height, 0.0, 1.0));
    vec2 at_high = mix(a.xy, b.xy, clamp((a.z - 1.0) * per_height, 0.0, 1.0));
    bool crosses_low = a_below != b_below, crosses_high = a_above != b_above;
    low = low || crosses_low;
    high = high || crosses_high;
    low_in = crosses_low && a_below ? at_low : low_in;
    low_out = crosses_low && b_below ? at_low : low_out;
    high_in = crosses_high && a_above ? at_high : high_in;
    high_out = crosses_high && b_above ? at_high : high_out;
    // An edge that stays outside has no length; where it crosses the planes may not be a number.
    bool is_outside = (a_below && b_below) || (a_above && b_above);
    vec2 start = a_below ? at_low : (a_above ? at_high : a.xy);
    vec2 end = b_below ? at_low : (b_above ? at_high : b.xy);
    add_segment(sums, is_outside ? a.xy : start, is_outside ? a.xy : end);
}

// (area, moments) of the part of triangle a b c inside the unit cube, projected along z; the sign of the area is the
// triangle's orientation.
vec3 overlap(vec3 a, vec3 b, vec3 c)
{
    vec3 sums = vec3(0.0);
    vec2 low_out = vec2(0.0), low_in = vec2(0.0), high_out = vec2(0.0), high_in = vec2(0.0);
    bool low = false, high = false;
    add_edge(sums, a, b, low_out, low_in, low, high_out, high_in, high);
    add_edge(sums, b, c, low_out, low_in, low, high_out, high_in, high);
    add_edge(sums, c, a, low_out, low_in, low, high_out, high_in, high);
    if (low) {
        add_segment(sums, low_out, low_in);
    }
    if (high) {
        add_segment(sums, high_out, high_in);
    }
    return sums;
}

// Whether corners lie on both sides of a plane.
bool is_divided(vec3 heights)
{
    return max_component(heights) > 0.0 && min(heights.x, min(heights.y, heights.z)) <= 0.0;
}

// What a plane leaves of a triangle: four corners, of which some may be one, and how high each is over another plane.
struct Quad {
    vec3 corners[4];
    vec4 others;
};

// What lies above a plane, over which the triangle's corners are so high; `others`: over another plane.
Quad cut_off(vec3 a, vec3 b, vec3 c, vec3 heights, vec3 others)
{
    bvec3 above = greaterThan(heights, vec3(0.0));
    // Corner p is on one side, q and r on the other.
    int alone = above.y == above.z ? 0 : (above.x == above.z ? 1 : 2);
    vec3 p = alone == 0 ? a : (alone == 1 ? b : c);
    vec3 q = alone == 0 ? b : (alone == 1 ? c : a);
    vec3 r = alone == 0 ? c : (alone == 1 ? a : b);
    vec3 h = alone == 0 ? heights : (alone == 1 ? heights.yzx : heights.zxy);
    vec3 o = alone == 0 ? others : (alone == 1 ? others.yzx : others.zxy);
    bool is_cut = (h.x > 0.0) != (h.y > 0.0);
    bool is_tip = h.x > 0.0;
    vec2 at = is_cut ? h.x / (h.x - h.yz) : vec2(0.0);
    vec3 on_q = mix(p, q, at.x), on_r = mix(p, r, at.y);
    vec2 o_on = mix(o.xx, o.yz, at);
    // Uncut, which is asked of triangles above alone: p, q, r, p.
    bool is_only_tip = is_cut && is_tip;
    return Quad(vec3[4](on_q, is_only_tip ? on_r : q, is_only_tip ? p : r, is_only_tip ? p : on_r),
                vec4(o_on.x, is_only_tip ? o_on.y : o.y, is_only_tip ? o.x : o.z, is_only_tip ? o.x : o_on.y));
}

// overlap() of what lies above two planes, over which the corners are so high, where one of these divides the triangle.
vec3 overlap_of_divided(vec3 a, vec3 b, vec3 c, vec3 heights, vec3 others)
{
    Quad quad = cut_off(a, b, c, heights, others);
    vec3 sums = vec3(0.0);
    vec2 low_out = vec2(0.0), low_in = vec2(0.0), high_out = vec2(0.0), high_in = vec2(0.0);
    bool low = false, high = false, divides = false;
    vec3 entry = vec3(0.0), leave = vec3(0.0);  // where the outline crosses the other plane
    for (int k = 0; k < 4; ++k) {
        vec3 start = quad.corners[k], end = quad.corners[k + 1 & 3];
        float from = quad.others[k], to = quad.others[k + 1 & 3];
        vec3 at = mix(start, end, clamp(from / (from - to), 0.0, 1.0));
        bool enters = from <= 0.0 && to > 0.0, leaves = from > 0.0 && to <= 0.0;
        divides = divides || enters;
        entry = enters ? at : entry;
        leave = leaves ? at : leave;
        start = enters ? at : start;
        end = leaves ? at : (from <= 0.0 && to <= 0.0 ? start : end);
        add_edge(sums, start, end, low_out, low_in, low, high_out, high_in, high);
    }
    if (divides) {
        add_edge(sums, leave, entry, low_out, low_in, low, high_out, high_in, high);
    }
    if (low) {
        add_segment(sums, low_out, low_in);
    }
    if (high) {
        add_segment(sums, high_out, high_in);
    }
    return sums;
}

// What of `all`, the overlap of a triangle, lies above two planes.
vec3 overlap_above_both(vec3 a, vec3 b, vec3 c, vec3 heights, vec3 others, vec3 all)
{
    bool is_above = max_component(heights) > 0.0 && max_component(others) > 0.0;
    vec3 sums = is_above ? all : vec3(0.0);
    if (is_above && (is_divided(heights) || is_divided(others))) {
        sums = overlap_of_divided(a, b, c, heights, others);
    }
    return sums;
}

// The same for one plane.
vec3 overlap_above(vec3 a, vec3 b, vec3 c, vec3 heights, vec3 all)
{
    return overlap_above_both(a, b, c, heights, vec3(1.0), all);
}
