// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance of the world in a direction: a constant, or an equirectangular picture made by pass `world`.
//
// The including program defines WORLD_IS_TEXTURE (0 or 1).

#include "lib/common.glsl"

#if WORLD_IS_TEXTURE
layout(binding = TEX_WORLD) uniform sampler2D world_tex;
#else
uniform vec3 world_radiance;
#endif

// Blender's equirectangular map: u = 1/2 - atan2(y, x) / 2 pi, v = 1 - acos(z) / pi, v = 0 at the bottom row.
vec2 equirectangular(vec3 direction)
{
    return vec2(0.5 - atan(direction.y, direction.x) / (2.0 * PI), 1.0 - acos(clamp(direction.z, -1.0, 1.0)) / PI);
}

vec3 equirectangular_direction(vec2 uv)
{
    float phi = (0.5 - uv.x) * 2.0 * PI;
    float theta = (1.0 - uv.y) * PI;
    return vec3(sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta));
}

vec3 world_along(vec3 direction)
{
#if WORLD_IS_TEXTURE
    return textureLod(world_tex, equirectangular(direction), 0.0).rgb;
#else
    return world_radiance;
#endif
}
