// SPDX-License-Identifier: GPL-3.0-or-later
// Which faces does each site (a surface point that one or more voxel faces stand for) see? Cosine-distributed rays, exact against the geometry, end at other faces: these
// are its links, a Monte Carlo estimate of form factors. They depend on geometry alone, so bounces and changes of light
// trace nothing. Rays that leave the scene bring the world's light, averaged here.
// Input: faces, triangles of cells.    Output: link_img (link_count numbers of faces for each face), sky_img: W/(m2 sr), mean over all rays.
// Follows Keller 1997, "Instant Radiosity", and Szirmay-Kalos 1999, "Stochastic Iteration for Non-diffuse Global
// Illumination"; differs: one fixed set of rays serves all iterations, so that they are products with a sparse matrix.

#include "lib/radiance.glsl"
#include "lib/face.glsl"
#include "lib/sampling.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D link_img;
#if HAS_WORLD
layout(binding = IMG_1, rgba32f) writeonly uniform image2D sky_img;
#endif

uniform uint thread_first;
uniform uint cell_count;
uniform uint link_count;  // a multiple of four
uniform uint random_seed;

void main()
{
    uint thread = thread_first + invocation_index();
    uint facing = facing_of_thread(thread, cell_count);
    uvec4 record = texelFetch(cells_tex, list_texel(cell_of_thread(thread, cell_count)), 0);
    if (!has_facing(record, facing) || site_facing(record, facing) != facing) {
        return;
    }
    uint index = face_index(record, facing);
    vec3 position, normal;
    fetch_face_place(index, position, normal);
    vec3 origin = position + normal * RAY_START;
    uint seed = hash(index, random_seed);
    uvec4 links;
    vec3 sky = vec3(0.0);
    for (uint k = 0u; k < link_count; ++k) {
        vec3 direction = sample_cosine(normal, sample_2d(k, seed));
        Hit hit = trace(origin, direction, 1e30, RAY_DIFFUSE, false, hash(seed, k));
        uint link = NONE_INDEX;
        if (hit.triangle != NONE_INDEX) {
            link = face_at_hit(origin + direction * hit.distance, hit, hash(seed + k, 0x9E3779u));
        }
#if HAS_WORLD
        else {
            sky += world_along(direction);
        }
#endif
        links[k & 3u] = link;
        if ((k & 3u) == 3u) {
            imageStore(link_img, list_texel((index * link_count + k) / 4u), links);
        }
    }
#if HAS_WORLD
    imageStore(sky_img, list_texel(index), vec4(sky / float(link_count), 0.0));
#endif
}
