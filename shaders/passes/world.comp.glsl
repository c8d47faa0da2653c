// SPDX-License-Identifier: GPL-3.0-or-later
// The world's nodes evaluated in every direction.
// Input: generated text "world" (evaluate_world).    Output: world_img, equirectangular, W/(m2 sr).

#define WORLD_IS_TEXTURE 0
#include "lib/world.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(std430, binding = BUF_MATERIALS) readonly buffer Parameters { vec4 parameters[]; };
layout(binding = IMG_0, rgba32f) writeonly uniform image2D world_img;

uniform ivec2 picture_size;

vec4 world_parameter(int index)
{
    return parameters[index];
}

#include "world"

void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(at, picture_size))) {
        vec2 uv = (vec2(at) + 0.5) / vec2(picture_size);
        vec3 radiance = evaluate_world(equirectangular_direction(uv));
        imageStore(world_img, at, vec4(max(finite_or_zero(radiance), 0.0), 1.0));
    }
}
