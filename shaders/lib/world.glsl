// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance of the world in a direction: a constant, or an equirectangular picture made by pass `world`.
//
// The including program defines WORLD_IS_TEXTURE (0 or 1), and WORLD_IS_DRAWN where directions of that picture are drawn
// by its light (lib/world_sample.glsl) and weighed against rays.

#include "lib/common.glsl"
#include "lib/sampling.glsl"

#if WORLD_IS_TEXTURE
layout(binding = TEX_WORLD) uniform sampler2D world_tex;  // w: directions drawn for each steradian, of each texel
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

#if WORLD_IS_DRAWN
uniform float world_samples;  // directions that are drawn where rays look for the world too

// Weight of a ray that has found the world, against drawn directions. `density`: rays like this for each steradian.
float world_ray_weight(vec3 direction, float density)
{
    ivec2 size = textureSize(world_tex, 0);
    ivec2 texel = min(ivec2(equirectangular(direction) * vec2(size)), size - 1);
    return mis_weight(density, world_samples * texelFetch(world_tex, texel, 0).a);
}
#endif
