// SPDX-License-Identifier: GPL-3.0-or-later
// pack_part() and unpack_part() of lib/part.glsl: eight numbers a row (facing, area, reflectance, position), in
// and out.

#include "lib/part.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Given { vec4 given[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Results { vec4 results[]; };

uniform uint count;

void main()
{
    uint at = 2u * invocation_index();
    if (at >= 2u * count) {
        return;
    }
    uvec4 a = uvec4(given[at]), b = uvec4(given[at + 1u]);
    Part part = unpack_part(pack_part(Part(a.x, a.y, uvec3(a.zw, b.x), b.yzw)));
    results[at] = vec4(part.facing, part.area, part.reflectance.xy);
    results[at + 1u] = vec4(part.reflectance.z, part.position);
}
