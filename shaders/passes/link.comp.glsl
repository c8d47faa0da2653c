// SPDX-License-Identifier: GPL-3.0-or-later
// Which faces does each voxel face see? Cosine-distributed rays, exact against the geometry, end at other faces: these
// are its links, a Monte Carlo estimate of form factors. They depend on geometry alone, so bounces and changes of light
// trace nothing. Rays that leave the scene bring the world's light, those that meet an emitter its light, weighed against
// the directions and points that pass inject draws; both are averaged here.
// Input: faces, emitters, triangles of cells.
// Output: link_img (link_count links for each face), straight_img: W/(m2 sr), mean over all rays.
// Follows Keller 1997, "Instant Radiosity", and Szirmay-Kalos 1999, "Stochastic Iteration for Non-diffuse Global
// Illumination"; differs: one fixed set of rays serves all iterations, so that they are products with a sparse matrix.

#include "lib/radiance.glsl"
#include "lib/site.glsl"
#include "lib/link.glsl"
#include "lib/link_ray.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif
#if WORLD_IS_DRAWN
#include "lib/world_weight.glsl"
#endif
#if HAS_EMITTERS
#include "lib/emitter.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D link_img;
#if HAS_WORLD || HAS_EMITTERS
layout(binding = IMG_1, rg32ui) uniform uimage2D straight_img;
#endif

uniform uint link_count;  // a multiple of four
uniform uint link_first;  // of this dispatch, which makes the links before link_end; multiples of four too
uniform uint link_end;
uniform uint random_seed;

void main()
{
    Site site = site_of_thread();
    if (site.face == NONE_INDEX) {
        return;
    }
    uint seed = hash(site.seed, random_seed);
    uvec2 shift = link_shift(site.origin, site.normal, random_seed);
    uvec4 links;
    vec3 straight = vec3(0.0);
    uint k = link_first;
    do {
        vec3 direction;
        bool leaves = link_ray(site, k, shift, seed, direction);
        Hit hit = trace(site.origin, direction, leaves ? 1e30 : -1.0, RAY_DIFFUSE, false, hash(seed, k));
        uint link = NONE_INDEX;
        if (hit.triangle != NONE_INDEX) {
            link = face_at_hit(site.origin + direction * hit.distance, hit, hash(seed + k, 0x9E3779u));
#if HAS_EMITTERS
            float density = float(link_count) * received_cosine(site.shading_normal, site.normal, direction) / PI;
            Emitted emission = emission_met(hit.triangle, site.origin, direction, hit.distance, density);
            straight += emission.weight * emission.radiance;
#endif
        }
#if HAS_WORLD
        else if (leaves) {
#if WORLD_IS_DRAWN
            float density = float(link_count) * received_cosine(site.shading_normal, site.normal, direction) / PI;
            straight += world_ray_weight(direction, density) * world_along(direction);
#else
            straight += world_along(direction);
#endif
        }
#endif
        links[k & 3u] = pack_link(link, site.facing, direction);
        if ((k & 3u) == 3u) {
            imageStore(link_img, list_texel((site.face * link_count + k) / 4u), links);
        }
    } while (++k < link_end);
#if HAS_WORLD || HAS_EMITTERS
    straight = finite_or_zero(straight / float(link_count));
    if (link_first > 0u) {
        straight += unpack_light(imageLoad(straight_img, list_texel(site.face)).rg);
    }
    imageStore(straight_img, list_texel(site.face), pack_light(straight));
#endif
}
