// SPDX-License-Identifier: GPL-3.0-or-later
// Sort pixels by batch of their triangle's material, so that each program runs over a list of its own.
// STEP 0: count.    STEP 1: first entry of each batch, and the arguments of its indirect dispatch.    STEP 2: write.
// Input: seen_img, triangles, batch of each material.    Output: counters, bin arguments, pixel list.

#include "lib/triangle.glsl"

#if STEP == 1
layout(local_size_x = 1) in;
#else
layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;
#endif

layout(std430, binding = BUF_MATERIALS) readonly buffer Batches { uint batch_of_material[]; };
layout(std430, binding = BUF_COUNTS) buffer Counters { uint counters[]; };  // for each batch: cursor
// For each batch: groups x y z of the dispatch, first entry, count.
layout(std430, binding = BUF_RESULTS) buffer Bins { uint bins[]; };
layout(std430, binding = BUF_WORK) writeonly buffer Pixels { uint pixels[]; };
layout(binding = IMG_0, r32ui) readonly uniform uimage2D seen_img;

uniform ivec2 picture_size;
uniform uint batch_count;
uniform bool pending_only;

const uint PENDING = 0x80000000u;

void main()
{
#if STEP == 1
    uint first = 0u;
    for (uint batch = 0u; batch < batch_count; ++batch) {
        uint count = counters[batch];
        // As Kernel.run_list: no axis may have more than 65535 groups.
        uint groups = (count + uint(GROUP_SIZE) - 1u) / uint(GROUP_SIZE);
        bins[5u * batch] = min(groups, 32768u);
        bins[5u * batch + 1u] = (groups + 32767u) / 32768u;
        bins[5u * batch + 2u] = 1u;
        bins[5u * batch + 3u] = first;
        bins[5u * batch + 4u] = count;
        counters[batch] = first;
        first += count;
    }
#else
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, picture_size))) {
        return;
    }
    uint seen = imageLoad(seen_img, pixel).r;
    if (seen == 0u || (pending_only && (seen & PENDING) == 0u)) {
        return;
    }
    uint triangle = (seen & ~PENDING) - 1u;
    uint material = fetch_triangle(triangle).material;
    uint entry = atomicAdd(counters[batch_of_material[material]], 1u);
#if STEP == 2
    pixels[entry] = uint(pixel.x) | uint(pixel.y) << 16;
#endif
#endif
}
