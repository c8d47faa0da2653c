// SPDX-License-Identifier: GPL-3.0-or-later
// Light that links bring to the faces of a brick, facing by facing, binned by the direction that it comes from.
// Input: guides to make, faces, links, faces' radiance, the world.
// Output: bins_img, two bins to a texel: sum of radiance to the power of GUIDE_POWER, number of links.

#include "lib/grid.glsl"
#include "lib/face.glsl"
#include "lib/guide_work.glsl"
#include "lib/packed_light.glsl"
#include "lib/link_shift.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_CELLS) uniform usampler2D cells_tex;
layout(binding = TEX_LINKS) uniform usampler2D links_tex;
layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;
layout(binding = IMG_0, rgba32f) writeonly uniform image2D bins_img;

uniform uint link_count;  // of each face
uniform uint random_seed;

const float MOST_RADIANCE = 1e15;  // what is brighter counts as this: its power is finite

// Where the light of a face's link comes from, and its luminance.
void fetch_link(uint face, uint k, vec3 position, vec3 normal, uvec2 shift, out vec3 direction, out float light)
{
    uint at = face * link_count + k;
    uint link = texelFetch(links_tex, list_texel(at / 4u), 0)[at & 3u];
    if (link != NONE_INDEX) {
        vec3 there;
        vec3 normal_there;
        fetch_face_place(link, there, normal_there);
        direction = (there - position) / max(distance(there, position), 1e-6);
        light = luminance(unpack_light(texelFetch(face_radiance_tex, list_texel(link), 0).rg));
    } else {
        direction = sample_cosine(normal, sample_2d(k, shift));  // as pass link has drawn it, but for shading normals
#if HAS_WORLD
        light = luminance(world_along(direction));
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
    for (uint cell = 0u; cell < cells; ++cell) {
        uvec4 record = texelFetch(cells_tex, list_texel(brick.z + cell), 0);
        for (uint bit = work.facing; bit < 12u; bit += 6u) {  // on either side of a cut
            if ((record.w >> bit & 1u) == 0u) {
                continue;
            }
            uint face = face_index(record, bit);
            vec3 position;
            vec3 normal;
            fetch_face_place(face, position, normal);
            uvec2 shift = link_shift(position + normal * ray_start(position), normal, random_seed);
            for (uint k = 0u; k < link_count; ++k) {
                vec3 direction;
                float light;
                fetch_link(face, k, position, normal, shift, direction, light);
                vec3 local = facing_from_grid(work.facing, direction);
                if (local.z > 0.0) {
                    ivec2 place = ivec2(square_from_hemisphere(local) * float(GUIDE_SIDE));
                    bins[place.x + GUIDE_SIDE * place.y] +=
                        vec2(pow(clamp(light, 0.0, MOST_RADIANCE), GUIDE_POWER), 1.0);
                }
            }
        }
    }
    for (int k = 0; k < GUIDE_BINS / 2; ++k) {
        imageStore(bins_img, list_texel(number * uint(GUIDE_BINS / 2) + uint(k)), vec4(bins[2 * k], bins[2 * k + 1]));
    }
}
