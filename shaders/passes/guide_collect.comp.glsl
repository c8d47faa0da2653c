// SPDX-License-Identifier: GPL-3.0-or-later
// Light that links bring to the faces of a brick, facing by facing, binned by the direction that it comes from.
// Input: guides to make, faces, links, what faces' light counts (pass guide_light), the world.
// Output: bins_img, two bins to a texel: sum of what light counts, number of links.

#include "lib/grid.glsl"
#include "lib/face.glsl"
#include "lib/guide_work.glsl"
#include "lib/guide_light.glsl"
#include "lib/link_shift.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_CELLS) uniform usampler2D cells_tex;
layout(binding = TEX_LINKS) uniform usampler2D links_tex;
layout(binding = TEX_FACE_RADIANCE) uniform sampler2D face_light_tex;
layout(binding = IMG_0, rgba32f) writeonly uniform image2D bins_img;

uniform uint link_count;  // of each face
uniform uint random_seed;

// Where the light of ray k of a face comes from, and what it counts. `link`: the face that the ray meets.
void fetch_link(uint link, uint k, vec3 position, vec3 normal, uvec2 shift, out vec3 direction, out float light)
{
    if (link != NONE_INDEX) {
        vec3 way = uintBitsToFloat(texelFetch(face_place_tex, list_texel(link), 0).xyz) - position;
        direction = way / max(length(way), 1e-6);
        light = texelFetch(face_light_tex, list_texel(link), 0).r;
    } else {
        direction = sample_cosine(normal, sample_2d(k, shift));  // as pass link has drawn it, but for shading normals
#if HAS_WORLD
        light = guide_light(world_along(direction));
#else
        light = 0.0;
#endif
    }
}

void main()
{
    uint number = guide_first + invocation_index();
    if (number >= guide_count) {
        return;
    }
    GuideWork work = fetch_guide_work(number);
    uvec4 brick = texelFetch(bricks_tex, work.brick, 0);
    uint cells = uint(bitCount(brick.x) + bitCount(brick.y));
    vec2 bins[GUIDE_BINS];
    for (int bin = 0; bin < GUIDE_BINS; ++bin) {
        bins[bin] = vec2(0.0);
    }
    uint at = 0u;  // cell << 1 | side of its cut
    while (at < 2u * cells) {
        uint face = NONE_INDEX;
        for (; at < 2u * cells && face == NONE_INDEX; ++at) {
            uvec4 record = texelFetch(cells_tex, list_texel(brick.z + (at >> 1)), 0);
            uint bit = work.facing + 6u * (at & 1u);
            face = (record.w >> bit & 1u) != 0u ? face_index(record, bit) : NONE_INDEX;
        }
        if (face == NONE_INDEX) {
            break;
        }
        vec3 position;
        vec3 normal;
        fetch_face_place(face, position, normal);
        uvec2 shift = link_shift(position + normal * ray_start(position), normal, random_seed);
        for (uint q = 0u; q < link_count / 4u; ++q) {
            uvec4 links = texelFetch(links_tex, list_texel(face * (link_count / 4u) + q), 0);
            for (int k = 0; k < 4; ++k) {
                vec3 direction;
                float light;
                fetch_link(links[k], 4u * q + uint(k), position, normal, shift, direction, light);
                vec3 local = facing_from_grid(work.facing, direction);
                if (local.z > 0.0) {
                    ivec2 place = ivec2(square_from_hemisphere(local) * float(GUIDE_SIDE));
                    bins[place.x + GUIDE_SIDE * place.y] += vec2(light, 1.0);
                }
            }
        }
    }
    for (int k = 0; k < bin_count / 2; ++k) {
        imageStore(bins_img, list_texel(number * uint(GUIDE_BINS / 2) + uint(k)), vec4(bins[2 * k], bins[2 * k + 1]));
    }
}
