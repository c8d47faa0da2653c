// SPDX-License-Identifier: GPL-3.0-or-later
// Reflections at each pixel: what one ray, drawn from the GGX lobe's visible normals, meets: surfaces, the world, lights
// wider than the lobe.
// Input: surface pictures, faces' radiance, triangles of cells, lights.
// Output: radiance_out: reflected radiance. KEEPS_EMITTED: emitted_out: what of it comes straight from lights, emitters or the world.

#include "lib/incoming.glsl"
#include "lib/sampling.glsl"
#if HAS_LIGHTS
#include "lib/light.glsl"
#endif
#include "lib/pixel.glsl"
#include "lib/camera.glsl"
#include "lib/ggx.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = IMG_0, rgba32f) writeonly uniform image2D radiance_out;
#if KEEPS_EMITTED
layout(binding = IMG_1, rgba32f) writeonly uniform image2D emitted_out;
#endif

uniform ivec2 tile_first;
uniform uint sample_index;
uniform uint random_seed;
uniform float specular_aperture;

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size))) {
        return;
    }
    Pixel p = fetch_pixel(at);
    vec3 bounced = vec3(0.0);
    vec3 emitted = vec3(0.0);
    if (p.is_surface && max_component(p.f0 + p.f90) > 0.0) {
        vec3 origin = p.position + p.geometric_normal * RAY_START;
        uint seed = hash(uint(at.x) | uint(at.y) << 16, random_seed);
        vec3 camera_origin, view;
        camera_ray(at, camera_origin, view);
        view = -view;
        float alpha = max(p.alpha * specular_aperture, 1e-4);
        vec3 t, b;
        vec3 normal = valid_reflection_normal(p.geometric_normal, view, p.normal);
        basis(normal, t, b);
        vec3 view_t = vec3(dot(view, t), dot(view, b), max(dot(view, normal), 1e-3));
        vec3 h = sample_visible_normal(normalize(view_t), alpha, sample_2d(sample_index, hash(seed, 2u)));
        vec3 half_vector = t * h.x + b * h.y + normal * h.z;
        vec3 direction = reflect(-view, half_vector);
        float n_l = dot(direction, normal);
        if (n_l > 0.0 && dot(direction, p.geometric_normal) > 0.0) {
            float n_v = view_t.z;
            vec3 weight = fresnel(p.f0, p.f90, max(dot(view, half_vector), 0.0)) *
                          (ggx_masking(n_l, n_v, alpha) / ggx_masking_view(n_v, alpha));
            float density = ggx_density(normal, view, direction, alpha);
            Incoming found = incoming(origin, direction, RAY_GLOSSY, density, hash(seed, 3u + sample_index));
#if HAS_LIGHTS
            for (uint k = 0u; k < light_count; ++k) {
                float light_distance;
                Light light = fetch_light(lights_tex, k);
                if ((light.flags & RAY_GLOSSY) != 0u && light_half_angle(light, origin) > glossy_half_angle(p.alpha)) {
                    vec3 seen = light_along_ray(light, origin, direction, light_distance);
                    bool free = light_distance < found.distance || (light_distance > 1e29 && found.distance > 1e29);
                    if (max_component(seen) > 0.0 && free) {
                        found = Incoming(vec3(0.0), limited(seen), light_distance);
                    }
                }
            }
#endif
            bounced = found.bounced * weight;
            emitted = found.emitted * weight;
        }
    }
    imageStore(radiance_out, at, vec4(finite_or_zero(bounced + emitted), 0.0));
#if KEEPS_EMITTED
    imageStore(emitted_out, at, vec4(finite_or_zero(emitted), 0.0));
#endif
}
