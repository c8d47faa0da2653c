// SPDX-License-Identifier: GPL-3.0-or-later
// Reflections at each pixel of a layer, and what is seen through glass: what one ray, drawn from the GGX lobe's visible
// normals, meets: surfaces, lights, the world. A surface that is met is looked up in the voxels where the ray stands for
// an area at least as large as they are; nearer, it is followed: it is left to the next layer, which shades it for itself.
// FIRST_LAYER: what the camera sees.    HAS_LAYERS: there may be a next one.    FILLS: only pixels of the first layer whose
// light has a negative w; earlier passes have found that of the others.
// Input: surface pictures and rays of the layer, faces' radiance, triangles of cells, lights, emitters.
// Output: radiance_img: reflected radiance, added up over layers; w: 1 / distance of what the first met, 1/cells.
// KEEPS_EMITTED: emitted_out: what of it comes straight from lights, emitters or the world. HAS_LAYERS: rays_img, seen_img,
// throughput_img of the next layer, which has no surfaces yet.

#include "lib/incoming.glsl"
#include "lib/sampling.glsl"
#if HAS_LIGHTS
#include "lib/light.glsl"
#endif
#include "lib/pixel.glsl"
#include "lib/ray_shares.glsl"
#include "lib/ggx.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = IMG_0, rgba32f) uniform image2D radiance_img;
#if KEEPS_EMITTED
layout(binding = IMG_1, rgba32f) writeonly uniform image2D emitted_out;
#endif
#if HAS_LAYERS
layout(binding = IMG_2, r32ui) writeonly uniform uimage2D seen_img;
layout(binding = IMG_3, rgba32f) writeonly uniform image2D position_img;
// Factor on radiance from the layer's surface to the picture; w: side of the area that lobes alone let the ray stand for
// where it starts, cells. (Pixels do not count: were they larger than voxels, following would be no dearer.)
layout(binding = IMG_4, rgba32f) uniform image2D throughput_img;
#if FIRST_LAYER
layout(binding = IMG_5, rgba32f) writeonly uniform image2D rays_img;
#endif
layout(std430, binding = BUF_COUNTS) buffer Counters { uint followed; };

uniform bool last_layer;
#endif

uniform ivec2 tile_first;
uniform uint sample_index;
uniform uint random_seed;
uniform float specular_aperture;
uniform float light_points;  // drawn on each light where rays look for it too
uniform float amount;  // factor on all that is reflected at this layer

#if HAS_LAYERS
// SHARP_WIDTH, SHARP_REACH, SPREAD_OF_ALPHA: see addon/features.py.
// How far the ray stands for an area smaller than a voxel, cells. Where that is but a few voxels, it is nowhere.
float sharp_distance(float width, float spread)
{
    float reach = (SHARP_WIDTH - width) / max(spread, 1e-6);
    return reach < SHARP_REACH ? 0.0 : reach;
}
#endif

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
#if FIRST_LAYER && FILLS
    if (imageLoad(radiance_img, at).w >= 0.0) {
#if HAS_LAYERS
        imageStore(seen_img, at, uvec4(0u));
        imageStore(position_img, at, vec4(0.0));
        imageStore(throughput_img, at, vec4(0.0));
#endif
        return;
    }
#endif
    Pixel p = fetch_pixel(at);
    vec3 bounced = vec3(0.0);
    vec3 emitted = vec3(0.0);
    float nearness = 0.0;
    uint seen = 0u;
    vec3 throughput = vec3(amount);
    float lobe_width = 0.0;
#if !FIRST_LAYER
    vec4 before = imageLoad(throughput_img, at);
    throughput *= before.rgb;
    lobe_width = before.w;
#endif
    uint seed = hash(uint(at.x) | uint(at.y) << 16, random_seed);
    bool is_shiny = p.is_surface && max_component(p.f0 + p.f90 + p.transmission) > 0.0;
#if !FIRST_LAYER
    // Russian roulette: what would bring little goes on for its share, and in return stronger.
    float survival = min(4.0 * max_component(throughput), 1.0);
    is_shiny = is_shiny && unit_float(hash(seed, 7u + sample_index)) < survival;
    throughput /= max(survival, 1e-6);
#endif
    if (is_shiny) {
        Ray ray = pixel_ray(at);
        vec3 view = -ray.direction;
        float alpha = max(p.alpha * specular_aperture, 1e-4);
        vec3 t, b;
        vec3 normal = valid_reflection_normal(p.geometric_normal, view, p.normal);
        basis(normal, t, b);
        vec3 view_t = vec3(dot(view, t), dot(view, b), max(dot(view, normal), 1e-3));
        vec3 h = sample_visible_normal(normalize(view_t), alpha, sample_2d(sample_index, hash(seed, 2u)));
        vec3 half_vector = t * h.x + b * h.y + normal * h.z;
        float facet_cosine = max(dot(view, half_vector), 0.0);
        vec3 direction = reflect(-view, half_vector);
        vec3 weight = fresnel(p.f0, p.f90, p.ior, facet_cosine);
        bool passes = false;
#if HAS_TRANSMISSION
        if (p.is_glass) {
            vec3 passed = p.transmission * (1.0 - dielectric_reflectance(facet_cosine, p.ior));
            float share = luminance(weight) / max(luminance(weight + passed), 1e-20);
            // Multiples of sqrt(2), for passes to share evenly.
            passes = unit_float(hash(seed, 9u) + sample_index * 1779033703u) >= share;
            weight = passes ? passed / max(1.0 - share, 1e-6) : weight / max(share, 1e-6);
            direction = passes ? refract(-view, half_vector, 1.0 / p.ior) : direction;
        }
#endif
        vec3 side = passes ? -p.geometric_normal : p.geometric_normal;
        bool leaves = dot(direction, side) > 0.0 && (passes || dot(direction, normal) > 0.0);
        if (p.is_glass) {
            // Nothing is lost between the facets of glass: what would hide behind them is not held back, and what would
            // not come out is mirrored out.
            direction = dot(direction, side) > 0.0 ? direction : reflect(direction, side);
            leaves = true;
        } else {
            float n_l = max(dot(direction, normal), 0.0);
            weight *= ggx_masking(n_l, view_t.z, alpha) / ggx_masking_view(view_t.z, alpha);
        }
        if (leaves && max_component(weight) > 0.0) {
            throughput *= weight;
            vec3 origin = p.position + side * ray_start(p.position);
            uint ray_mask = passes ? RAY_TRANSMISSION : RAY_GLOSSY;
            float reach = 0.0;
#if HAS_LAYERS
            float pixel_spread = pixel_footprint(1.0, direction) - pixel_footprint(0.0, direction);
            float length = distance(p.position, ray.origin);
            lobe_width += (ray.spread - pixel_spread) * length;
            Ray next = Ray(origin, direction, ray.width + ray.spread * length, ray.spread + SPREAD_OF_ALPHA * alpha);
            // Voxels do not know what is inside of glass.
            bool is_inside = p.is_glass && (passes ? p.ior > 1.0 : p.is_inside);
            reach = is_inside ? 1e30 : sharp_distance(lobe_width, next.spread - pixel_spread);
            reach = last_layer ? 0.0 : reach;
#if HAS_OPACITY
            solid_distance = reach;
#endif
#endif
            Hit hit = trace(origin, direction, max_distance, ray_mask, false, hash(seed, 3u + sample_index));
            // Points on emitters are drawn for what is reflected outside of glass.
            bool only_rays = passes || p.is_inside;
            float density = only_rays ? 1e30 : ggx_density(normal, view, direction, alpha);
            Incoming found = incoming_from(hit, origin, direction, density, hash(seed, 5u + sample_index));
#if HAS_LIGHTS
            uint k = 0u;
            do {
                float light_distance;
                Light light = fetch_light(lights_tex, k);
                if ((light.flags & ray_mask) != 0u) {
                    vec3 shown = light_along_ray(light, origin, direction, light_distance);
                    bool free = light_distance < found.distance || (light_distance > 1e29 && found.distance > 1e29);
                    if (max_component(shown) > 0.0 && free) {
                        // Pass `direct` draws points on lights too, if they are outside of glass.
                        float points = light_points * light_density(light, origin, direction, light_distance);
                        float unused;
                        float rays = passes ? ggx_bent_density(normal, view, direction, alpha, p.ior, unused)
                                            : ggx_density(normal, view, direction, alpha);
                        shown *= mis_weight(rays, passes == p.is_inside ? points : 0.0);
                        found = Incoming(vec3(0.0), limited(shown), vec3(0.0), light_distance);
                        hit.triangle = NONE_INDEX;
                    }
                }
            } while (++k < light_count);
#endif
#if HAS_LAYERS
            if (hit.triangle != NONE_INDEX && hit.distance < reach) {
                // The next layer asks the material what it emits; here is known how much of that this ray shall bring.
                float share = 0.0, world_share = 1.0;
#if HAS_EMITTERS
                share = emission_met(hit.triangle, origin, direction, hit.distance, density).weight;
#endif
#if WORLD_IS_DRAWN
                world_share = world_ray_weight(direction, density);
#endif
                found.bounced = found.glow = vec3(0.0);
                seen = hit.triangle + 1u;
                imageStore(rays_img, ivec2(2 * at.x, at.y), vec4(next.origin, next.width));
                imageStore(rays_img, ivec2(2 * at.x + 1, at.y),
                           vec4(octahedral_encode(next.direction), next.spread, pack_shares(share, world_share)));
                atomicAdd(followed, 1u);
            }
#endif
            // Light that glass bends and light that it reflects have nothing in common, near as it may be.
            nearness = 1.0 / max(p.is_glass ? 0.0 : found.distance, 1e-3);
            bounced = found.bounced * throughput;
            emitted = (found.emitted + found.glow) * throughput;
        }
    }
    vec3 radiance = finite_or_zero(bounced + emitted);
#if FIRST_LAYER
    imageStore(radiance_img, at, vec4(radiance, nearness));
#if KEEPS_EMITTED
    imageStore(emitted_out, at, vec4(finite_or_zero(emitted), nearness));
#endif
#else
    imageStore(radiance_img, at, imageLoad(radiance_img, at) + vec4(radiance, 0.0));
#endif
#if HAS_LAYERS
    imageStore(seen_img, at, uvec4(seen));
    imageStore(position_img, at, vec4(0.0));
    imageStore(throughput_img, at, vec4(seen != 0u ? finite_or_zero(throughput) : vec3(0.0), lobe_width));
#endif
}
