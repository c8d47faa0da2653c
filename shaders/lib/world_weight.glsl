// SPDX-License-Identifier: GPL-3.0-or-later
// Two ways to find the light of a world's picture that is concentrated (WORLD_IS_DRAWN): directions drawn by it, and rays
// that leave the scene. Both are weighed against each other, as points on emitters are (lib/emitter.glsl).

#include "lib/sampling.glsl"
#include "lib/world.glsl"

uniform float world_samples;  // directions that are drawn where rays look for the world too

// Weight of a ray that has found the world. `density`: rays like this for each steradian.
float world_ray_weight(vec3 direction, float density)
{
    ivec2 size = textureSize(world_tex, 0);
    ivec2 texel = min(ivec2(equirectangular(direction) * vec2(size)), size - 1);
    return mis_weight(density, world_samples * texelFetch(world_tex, texel, 0).a);
}
