// SPDX-License-Identifier: GPL-3.0-or-later
// trace_cone() of lib/cone.glsl for a list of (origin, limit), (direction, tan of half the angle), (normal, 0).
// FETCH: texels (x, y, z, level) of the volume instead.    Output: (radiance, transmittance) or the texel.

#include "lib/cone.glsl"
#include "tests/rows.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
#if FETCH
    vec4 at = inputs[index];
    results[index] = texelFetch(cones_tex, ivec3(at.xyz), int(at.w));
#else
    vec4 a = inputs[3u * index];
    vec4 b = inputs[3u * index + 1u];
    results[index] = trace_cone(Cone(a.xyz, b.xyz, inputs[3u * index + 2u].xyz, b.w, a.w));
#endif
}
