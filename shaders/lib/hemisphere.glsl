// SPDX-License-Identifier: GPL-3.0-or-later
// The hemisphere of a facing as a unit square: equal areas are equal shares of irradiance, and what is near stays near.
// Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square"; the disk is the hemisphere seen from above.

#include "lib/common.glsl"

// Facing whose axis unit n is nearest to: +x -x +y -y +z -z.
uint facing_of(vec3 n)
{
    int axis = dominant_axis(n);
    return uint(2 * axis) + (n[axis] < 0.0 ? 1u : 0u);
}

// A direction in the facing's frame, where the facing is z; and back.
vec3 facing_from_grid(uint facing, vec3 v)
{
    int axis = int(facing >> 1);
    return vec3(v[(axis + 1) % 3], v[(axis + 2) % 3], (facing & 1u) == 0u ? v[axis] : -v[axis]);
}

vec3 grid_from_facing(uint facing, vec3 v)
{
    int axis = int(facing >> 1);
    vec3 result;
    result[(axis + 1) % 3] = v.x;
    result[(axis + 2) % 3] = v.y;
    result[axis] = (facing & 1u) == 0u ? v.z : -v.z;
    return result;
}

// Place of a unit direction with z >= 0, [0, 1).
vec2 square_from_hemisphere(vec3 direction)
{
    float r = length(direction.xy);
    float turn = atan(direction.y, direction.x) / (0.25 * PI);  // -4 .. 4, eighths of a circle
    turn = turn < -1.0 ? turn + 8.0 : turn;                     // -1 .. 7: two of them for each quarter of the square
    vec2 place = turn < 1.0 ? vec2(1.0, turn)
                            : (turn < 3.0 ? vec2(2.0 - turn, 1.0) : (turn < 5.0 ? vec2(-1.0, 4.0 - turn) : vec2(turn - 6.0, -1.0)));
    return clamp(0.5 + 0.5 * r * place, 0.0, 0.999999);
}

vec3 hemisphere_from_square(vec2 place)
{
    vec2 s = 2.0 * place - 1.0;
    bool wide = abs(s.x) > abs(s.y);
    float r = wide ? s.x : s.y;
    float turn = 0.25 * PI * (wide ? s.y : s.x) / (r == 0.0 ? 1.0 : r);
    vec2 disk = wide ? r * vec2(cos(turn), sin(turn)) : r * vec2(sin(turn), cos(turn));
    return vec3(disk, sqrt(max(0.0, 1.0 - dot(disk, disk))));
}
