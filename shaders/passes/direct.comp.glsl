// SPDX-License-Identifier: GPL-3.0-or-later
// Light straight from lights at each pixel, with shadows of the lights' real size: one point on each light a pass.
// Input: surface pictures, lights, triangles of cells.
// Output: diffuse_out: irradiance / pi, W/(m2 sr), to be multiplied by the diffuse reflectance; glossy_out: radiance.

#include "lib/trace.glsl"
#include "lib/light.glsl"
#include "lib/pixel.glsl"
#include "lib/ray.glsl"
#if HAS_GLOSSY
#include "lib/ggx.glsl"
#endif
#if SHADOW_CONES
#include "lib/cone.glsl"
#endif

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = IMG_0, rgba32f) writeonly uniform image2D diffuse_out;
#if HAS_GLOSSY
layout(binding = IMG_1, rgba32f) writeonly uniform image2D glossy_out;
#endif

uniform ivec2 tile_first;
uniform uint sample_index;
uniform uint random_seed;
uniform bool use_shadows;
uniform float shadow_amount;
uniform float shadow_cone_angle;
#if HAS_GLOSSY
uniform float specular_aperture;
#endif

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
    vec3 diffuse = vec3(0.0);
    vec3 glossy = vec3(0.0);
    Pixel p = fetch_pixel(at);
    if (p.is_surface) {
        vec3 direction = pixel_ray(at).direction;
        vec3 origin = p.position + p.geometric_normal * RAY_START;
#if HAS_GLOSSY
        vec3 glossy_normal = valid_reflection_normal(p.geometric_normal, -direction, p.normal);
#endif
        uint pixel_seed = hash(uint(at.x) | uint(at.y) << 16, random_seed);
        for (uint k = 0u; k < light_count; ++k) {
            Light light = fetch_light(lights_tex, k);
            uint seed = hash(pixel_seed + k, 0xD1B54Au);
            LightSample s = sample_light(light, origin, sample_2d(sample_index, seed));
            float cosine = dot(p.normal, s.direction);
            // Light behind the surface comes out of glass, bent.
            bool behind = dot(p.geometric_normal, s.direction) <= 0.0;
            if ((behind && !p.is_inside) || max_component(s.irradiance) <= 0.0) {
                continue;
            }
            vec3 on_diffuse = (light.flags & RAY_DIFFUSE) != 0u ? s.irradiance * max(cosine, 0.0) / PI : vec3(0.0);
            vec3 on_glossy = vec3(0.0);
#if HAS_GLOSSY
            // Rays of pass `reflect` look for the light too.
#if HAS_TRANSMISSION
            if (behind && (light.flags & RAY_TRANSMISSION) != 0u) {
                float facet_cosine;
                float rays = ggx_bent_density(glossy_normal, -direction, s.direction, max(p.alpha * specular_aperture, 1e-4),
                                              p.ior, facet_cosine);
                float points = light_density(light, origin, s.direction, s.distance);
                on_glossy = s.irradiance * p.transmission * (1.0 - dielectric_reflectance(facet_cosine, p.ior)) * rays *
                            mis_weight(points, rays);
            }
#endif
            if ((light.flags & RAY_GLOSSY) != 0u && !p.is_inside) {
                float rays = ggx_density(glossy_normal, -direction, s.direction, max(p.alpha * specular_aperture, 1e-4));
                float points = light_density(light, origin, s.direction, s.distance);
                on_glossy = s.irradiance * ggx_reflection(glossy_normal, -direction, s.direction, p.alpha, p.f0, p.f90,
                                                          p.ior) *
                            mis_weight(points, rays);
            }
#endif
            if (max_component(on_diffuse + on_glossy) <= 0.0) {
                continue;
            }
            float visible = 1.0;
            if (use_shadows && (light.flags & LIGHT_CASTS_SHADOW) != 0u) {
#if SHADOW_CONES
                float angle = shadow_cone_angle > 0.0 ? 0.5 * shadow_cone_angle : light_half_angle(light, origin);
                visible = cone_visibility(p.position, p.geometric_normal, s.direction, tan(angle), s.distance);
#else
                vec3 from = behind ? p.position - p.geometric_normal * RAY_START : origin;
                visible = is_blocked(from, s.direction, s.distance - RAY_START, hash(seed, sample_index)) ? 0.0 : 1.0;
#endif
                visible = mix(1.0, visible, shadow_amount);
            }
            diffuse += on_diffuse * visible;
            glossy += on_glossy * visible;
        }
    }
    imageStore(diffuse_out, at, vec4(finite_or_zero(diffuse), 0.0));
#if HAS_GLOSSY
    imageStore(glossy_out, at, vec4(finite_or_zero(glossy), 0.0));
#endif
}
