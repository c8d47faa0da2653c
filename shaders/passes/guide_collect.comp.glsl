// SPDX-License-Identifier: GPL-3.0-or-later
// Light that links bring to the faces of a brick, facing by facing, binned by the direction that it comes from.
// Input: guides to make, cells, links, what faces' light counts (pass guide_light), the world.
// Output: bins_img, four bins to a texel.

#include "lib/grid.glsl"
#include "lib/guide_work.glsl"
#include "lib/guide_light.glsl"
#include "lib/link.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_CELLS, SOURCE_CELLS, rgba32ui) cells_tex;
layout(binding = TEX_LINKS) uniform usampler2D links_tex;
layout(binding = TEX_FACE_RADIANCE) uniform sampler2D face_light_tex;
layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D bins_img;

uniform uint link_count;  // of each face
#if HAS_WORLD
// Of the world, from the middle of a bin.
float light_of_world(uint facing, uint bin)
{
    vec2 place = (vec2(bin % uint(GUIDE_SIDE), bin / uint(GUIDE_SIDE)) + 0.5) / float(GUIDE_SIDE);
    return guide_light(world_along(grid_from_facing(facing, hemisphere_from_square(place))));
}
#endif

void main()
{
    uint number = guide_first + invocation_index();
    if (number >= guide_count) {
        return;
    }
    GuideWork work = fetch_guide_work(number);
    uvec4 brick = fetch_source(bricks_tex, work.brick);
    uint cells = uint(bitCount(brick.x) + bitCount(brick.y));
    vec2 bins[GUIDE_BINS];
    for (int bin = 0; bin < GUIDE_BINS; ++bin) {
        bins[bin] = vec2(0.0);
    }
    uint at = 0u;  // cell << 1 | side of its cut
    while (at < 2u * cells) {
        uint face = NONE_INDEX;
        for (; at < 2u * cells && face == NONE_INDEX; ++at) {
            uvec4 record = fetch_source(cells_tex, list_texel(brick.z + (at >> 1)));
            uint bit = work.facing + 6u * (at & 1u);
            face = (record.w >> bit & 1u) != 0u ? face_index(record, bit) : NONE_INDEX;
        }
        if (face == NONE_INDEX) {
            break;
        }
        uint q = 0u;
        do {
            uvec4 links = texelFetch(links_tex, list_texel(face * (link_count / 4u) + q), 0);
            for (int k = 0; k < 4; ++k) {
                uint linked = linked_face(links[k]);
                uint bin = link_bin(links[k]);
                if (bin < uint(GUIDE_BINS)) {
                    float light = linked == NONE_INDEX ? 0.0 : texelFetch(face_light_tex, list_texel(linked), 0).r;
#if HAS_WORLD
                    if (linked == NONE_INDEX) {
                        light = light_of_world(work.facing, bin);
                    }
#endif
                    bins[bin] += vec2(light, 1.0);
                }
            }
        } while (++q < link_count / 4u);
    }
    for (int k = 0; k < bin_count; k += 4) {
        uvec4 four = uvec4(pack_bin(bins[k]), pack_bin(bins[k + 1]), pack_bin(bins[k + 2]), pack_bin(bins[k + 3]));
        imageStore(bins_img, list_texel((number * uint(GUIDE_BINS) + uint(k)) / 4u), four);
    }
}
