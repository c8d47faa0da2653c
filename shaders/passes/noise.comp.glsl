// SPDX-License-Identifier: GPL-3.0-or-later
// Noise of each tile of the film: how far half of the passes are from all of them. The difference of the means has the
// variance of the mean itself. As Cycles measures it, in proportion to the root of the brightness, so that dark and bright
// parts look alike: Dammertz et al. 2010, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination".
// Input: means over all passes, and over half of them.    Output: noise_img, one texel a tile.

#include "lib/common.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = IMG_0, rgba32f) readonly uniform image2D mean_img;
layout(binding = IMG_1, rgba32f) readonly uniform image2D half_img;
layout(binding = IMG_2, r32f) writeonly uniform image2D noise_img;

uniform ivec2 picture_size;
uniform ivec2 tile_count;

void main()
{
    ivec2 tile = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(tile, tile_count))) {
        return;
    }
    ivec2 first = tile * TILE_SIZE;
    ivec2 end = min(first + TILE_SIZE, picture_size);
    float squares = 0.0;
    float brightness = 0.0;
    for (int y = first.y; y < end.y; ++y) {
        for (int x = first.x; x < end.x; ++x) {
            vec3 all = imageLoad(mean_img, ivec2(x, y)).rgb;
            vec3 half_of_them = imageLoad(half_img, ivec2(x, y)).rgb;
            float difference = dot(abs(all - half_of_them), vec3(1.0));
            squares += difference * difference;
            brightness += dot(all, vec3(1.0));
        }
    }
    float count = float((end.x - first.x) * (end.y - first.y));
    imageStore(noise_img, tile, vec4(sqrt(squares / count) / (1e-4 + sqrt(max(brightness, 0.0) / count))));
}
