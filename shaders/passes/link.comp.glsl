// SPDX-License-Identifier: GPL-3.0-or-later
// Which faces does each voxel face see? Cosine-distributed rays, exact against the geometry, end at other faces: these
// are its links, a Monte Carlo estimate of form factors. They depend on geometry alone, so bounces and changes of light
// trace nothing. Rays that leave the scene bring the world's light, averaged here.
// Input: faces, triangles of cells.    Output: link_img (link_count numbers of faces for each face), sky_img: W/(m2 sr), mean over all rays.
// Follows Keller 1997, "Instant Radiosity", and Szirmay-Kalos 1999, "Stochastic Iteration for Non-diffuse Global
// Illumination"; differs: one fixed set of rays serves all iterations, so that they are products with a sparse matrix.

#include "lib/radiance.glsl"
#include "lib/site.glsl"
#include "lib/sampling.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D link_img;
#if HAS_WORLD
layout(binding = IMG_1, rgba32f) writeonly uniform image2D sky_img;
#endif

uniform uint link_count;  // a multiple of four
uniform uint random_seed;

void main()
{
    Site site = site_of_thread();
    if (site.face == NONE_INDEX) {
        return;
    }
    uint seed = hash(site.face, random_seed);
    uvec4 links;
    vec3 sky = vec3(0.0);
    for (uint k = 0u; k < link_count; ++k) {
        vec3 direction = sample_cosine(site.normal, sample_2d(k, seed));
        Hit hit = trace(site.origin, direction, 1e30, RAY_DIFFUSE, false, hash(seed, k));
        uint link = NONE_INDEX;
        if (hit.triangle != NONE_INDEX) {
            link = face_at_hit(site.origin + direction * hit.distance, hit, hash(seed + k, 0x9E3779u));
        }
#if HAS_WORLD
        else {
            sky += world_along(direction);
        }
#endif
        links[k & 3u] = link;
        if ((k & 3u) == 3u) {
            imageStore(link_img, list_texel((site.face * link_count + k) / 4u), links);
        }
    }
#if HAS_WORLD
    imageStore(sky_img, list_texel(site.face), vec4(sky / float(link_count), 0.0));
#endif
}
