// SPDX-License-Identifier: GPL-3.0-or-later
// pack_part() and unpack_part() of lib/part.glsl: nine numbers a row (facing, emits, area, reflectance, position), three
// of padding, in and out.

#include "lib/part.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Given { vec4 given[]; };
layout(std430, binding = BUF_SUMS) writeonly buffer Results { vec4 results[]; };

uniform uint count;

void main()
{
    uint at = 3u * invocation_index();
    if (at >= 3u * count) {
        return;
    }
    uvec4 a = uvec4(given[at]), b = uvec4(given[at + 1u]), c = uvec4(given[at + 2u]);
    Part part = unpack_part(pack_part(Part(a.x, a.z, uvec3(a.w, b.xy), uvec3(b.zw, c.x), a.y != 0u)));
    results[at] = vec4(part.facing, part.emits ? 1.0 : 0.0, part.area, part.reflectance.x);
    results[at + 1u] = vec4(part.reflectance.yz, part.position.xy);
    results[at + 2u] = vec4(part.position.z, 0.0, 0.0, 0.0);
}
