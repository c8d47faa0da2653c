// SPDX-License-Identifier: GPL-3.0-or-later
// Indirect light at each pixel: what leaves the voxel faces that stratified rays meet, and the world's light.
// Input: surface pictures, faces' radiance, triangles of cells, lights (for what glossy rays see of them).
// Output: diffuse_out: mean incoming radiance, to be multiplied by the diffuse reflectance; glossy_out: radiance.

#include "lib/radiance.glsl"
#include "lib/sampling.glsl"
#if HAS_LIGHTS
#include "lib/light.glsl"
#endif
#include "lib/pixel.glsl"
#include "lib/camera.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif
#if HAS_GLOSSY
#include "lib/ggx.glsl"
#endif
#if GATHER_CONES
#include "lib/cone.glsl"
#endif

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

#if HAS_DIFFUSE
layout(binding = IMG_0, rgba32f) writeonly uniform image2D diffuse_out;
#endif
#if HAS_GLOSSY
layout(binding = IMG_1, rgba32f) writeonly uniform image2D glossy_out;
#endif

uniform ivec2 tile_first;
uniform uint sample_index;
uniform uint ray_count;          // diffuse directions in this pass
uniform uint random_seed;
uniform float max_distance;      // cells
uniform float specular_aperture;
uniform float clamp_indirect;    // 0: no clamping

vec3 limited(vec3 radiance)
{
    float largest = max_component(radiance);
    return clamp_indirect > 0.0 && largest > clamp_indirect ? radiance * (clamp_indirect / largest) : radiance;
}

vec3 world_or_black(vec3 direction)
{
#if HAS_WORLD
    return world_along(direction);
#else
    return vec3(0.0);
#endif
}

// Radiance that arrives along a ray from surfaces and the world.
vec3 incoming(vec3 origin, vec3 direction, uint ray_mask, uint seed, out float distance)
{
    Hit hit = trace(origin, direction, max_distance, ray_mask, GATHER_OCCLUSION != 0, seed);
    distance = hit.distance;
    if (hit.triangle == NONE_INDEX) {
        return world_or_black(direction);
    }
#if GATHER_OCCLUSION
    return vec3(0.0);
#else
    return face_radiance(face_at_hit(origin + direction * hit.distance, hit, hash(seed, 0x2545F4u)));
#endif
}

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size))) {
        return;
    }
    Pixel p = fetch_pixel(at);
    vec3 diffuse = vec3(0.0);
    vec3 glossy = vec3(0.0);
    if (p.is_surface) {
        vec3 origin = p.position + p.geometric_normal * RAY_START;
        uint seed = hash(uint(at.x) | uint(at.y) << 16, random_seed);
        float distance;
#if HAS_DIFFUSE
        if (max_component(p.diffuse) > 0.0) {
#if GATHER_CONES
            for (int k = 0; k < 6; ++k) {
                vec4 axis = hemisphere_cone(p.normal, k);
                vec4 found = trace_cone(Cone(p.position, axis.xyz, p.geometric_normal, 0.57735, max_distance));
                diffuse += axis.w * (found.rgb + found.a * world_or_black(axis.xyz));
            }
#else
            for (uint k = 0u; k < ray_count; ++k) {
                uint index = sample_index * ray_count + k;
                vec3 direction = sample_cosine(p.normal, sample_2d(index, hash(seed, 1u)));
                if (dot(direction, p.geometric_normal) > 0.0) {
                    diffuse += limited(incoming(origin, direction, RAY_DIFFUSE, hash(seed, index), distance));
                }
            }
            diffuse /= float(ray_count);
#endif
        }
#endif
#if HAS_GLOSSY
        if (max_component(p.f0 + p.f90) > 0.0) {
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
                vec3 radiance = incoming(origin, direction, RAY_GLOSSY, hash(seed, 3u + sample_index), distance);
#if HAS_LIGHTS
                for (uint k = 0u; k < light_count; ++k) {
                    float light_distance;
                    Light light = fetch_light(lights_tex, k);
                    if ((light.flags & RAY_GLOSSY) != 0u &&
                        light_half_angle(light, origin) > glossy_half_angle(p.alpha)) {
                        vec3 seen = light_along_ray(light, origin, direction, light_distance);
                        bool free = light_distance < distance || (light_distance > 1e29 && distance > 1e29);
                        if (max_component(seen) > 0.0 && free) {
                            distance = light_distance;
                            radiance = seen;
                        }
                    }
                }
#endif
                glossy = limited(radiance * weight);
            }
        }
#endif
    }
#if HAS_DIFFUSE
    imageStore(diffuse_out, at, vec4(finite_or_zero(diffuse), 0.0));
#endif
#if HAS_GLOSSY
    imageStore(glossy_out, at, vec4(finite_or_zero(glossy), 0.0));
#endif
}
