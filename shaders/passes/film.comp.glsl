// SPDX-License-Identifier: GPL-3.0-or-later
// Take one pass into a mean of the film. Each pixel takes the samples of all pixels that its filter reaches, not its own
// alone: far fewer passes show smooth edges than if each sample counted for one pixel.
// Input: value_tex, this pass's value at each pixel.    Output: mean_img (over passes); KEEPS_HALF: half_img.
// All is done by differences, so that what is the same everywhere and always stays so to the bit.

#include "lib/tiles.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = TEX_VALUE) uniform sampler2D value_tex;
layout(binding = IMG_0, rgba32f) uniform image2D mean_img;
#if KEEPS_HALF
layout(binding = IMG_1, rgba32f) uniform image2D half_img;  // mean over half of the passes
uniform float half_share;
#endif

uniform ivec2 picture_size;
uniform int reach;                     // pixels to each side
uniform float weights_x[FILTER_TAPS];  // of the pixels from -reach to reach
uniform float weights_y[FILTER_TAPS];
uniform float share;                   // of this pass in the mean, it included

void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
    vec4 value = texelFetch(value_tex, at, 0);
    vec4 sum = vec4(0.0);
    float weights = 0.0;
    for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
            ivec2 there = at + ivec2(x, y);
            bool usable = all(greaterThanEqual(there, ivec2(0))) && all(lessThan(there, picture_size)) && is_active(there);
            float weight = usable ? weights_x[x + reach] * weights_y[y + reach] : 0.0;
            sum += weight > 0.0 ? weight * (texelFetch(value_tex, there, 0) - value) : vec4(0.0);
            weights += weight;
        }
    }
    value += sum / weights;  // of what there is: nothing beyond the border and in tiles that are done
    vec4 before = imageLoad(mean_img, at);
    imageStore(mean_img, at, before + (value - before) * share);
#if KEEPS_HALF
    before = imageLoad(half_img, at);
    imageStore(half_img, at, before + (value - before) * half_share);
#endif
}
