// SPDX-License-Identifier: GPL-3.0-or-later
// Behind a surface that lets this pass through: find what is seen next.
// Input: seen_img with marked pixels, position_tex.    Output: seen_img (still marked; 0 when nothing follows).

#include "lib/trace.glsl"
#include "lib/ray.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = TEX_POSITION) uniform sampler2D position_tex;
layout(binding = IMG_0, r32ui) uniform uimage2D seen_img;
layout(binding = IMG_1, rgba32f) writeonly uniform image2D position_img;
layout(std430, binding = BUF_COUNTS) buffer Counters { uint pending; };

uniform uint ray_mask;  // which kind of rays these are

const uint PENDING = 0x80000000u;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, picture_size)) || (imageLoad(seen_img, pixel).r & PENDING) == 0u) {
        return;
    }
    vec3 direction = pixel_ray(pixel).direction;
    vec3 position = texelFetch(position_tex, pixel, 0).xyz;
    Hit hit = trace(position + direction * ray_start(position), direction, 1e30, ray_mask, false, 0u);
    if (hit.triangle == NONE_INDEX) {
        imageStore(seen_img, pixel, uvec4(0u));
        imageStore(position_img, pixel, vec4(0.0));
    } else {
        imageStore(seen_img, pixel, uvec4((hit.triangle + 1u) | PENDING));
        atomicAdd(pending, 1u);
    }
}
