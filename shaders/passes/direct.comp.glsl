// SPDX-License-Identifier: GPL-3.0-or-later
// Light straight from lights (HAS_LIGHTS), emitters (HAS_EMITTERS) and a world whose light is concentrated
// (WORLD_IS_DRAWN) at each pixel, with shadows of their real size: in each pass one point on each light, or of many
// (HAS_MANY_LIGHTS) on those that are picked, one point on all emitters, chosen among several by what it would bring, and
// one direction of the world.
// Input: surface pictures, lights, emitters, the world, triangles of cells.
// Output: diffuse_out: irradiance / pi, W/(m2 sr), to be multiplied by the diffuse reflectance; glossy_out: radiance.

#include "lib/trace.glsl"
#include "lib/sampling.glsl"
#if HAS_LIGHTS
#include "lib/light_pick.glsl"
#endif
#if HAS_EMITTERS
#include "lib/emitter.glsl"
#endif
#if WORLD_IS_DRAWN
#include "lib/clamp.glsl"
#include "lib/world_sample.glsl"
#endif
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
#if HAS_GLOSSY || HAS_EMITTERS || WORLD_IS_DRAWN
uniform float specular_aperture;
#endif
#if HAS_EMITTERS || WORLD_IS_DRAWN
uniform float max_distance;      // of what rays look for, cells

// What light of `radiance` from `direction` brings that was drawn with `density`, so many for each steradian, and that
// `gathered` and `reflected` rays look for too. MIS weights are those of the candidates: any that add up to 1 are right.
void weigh_drawn(Pixel p, vec3 view, vec3 glossy_normal, float alpha, vec3 direction, vec3 radiance, uint flags,
                 float density, float gathered, float reflected, out vec3 on_diffuse, out vec3 on_glossy)
{
    on_diffuse = on_glossy = vec3(0.0);
    float cosine = dot(p.normal, direction);
    if ((flags & RAY_DIFFUSE) != 0u && cosine > 0.0) {
        float weight = mis_weight(density, gathered * cosine / PI);
        on_diffuse = radiance * (cosine / PI * weight / density);
    }
#if HAS_GLOSSY
    if ((flags & RAY_GLOSSY) != 0u && !p.is_inside) {
        float other = ggx_density(glossy_normal, view, direction, alpha);
        float weight = mis_weight(density, reflected * other);
        on_glossy = radiance * ggx_reflection(glossy_normal, view, direction, alpha, p.f0, p.f90, p.ior) *
                    (weight / density);
    }
#endif
}
#endif

#if HAS_EMITTERS
// Rays that look for emitters too: gathered and reflected in this pass.
uniform float gathered_rays;
uniform float reflected_rays;

// Talbot, Cline and Egbert 2005, "Importance Resampling for Global Illumination": candidates drawn by power, one kept by
// what it would bring unshadowed.
void add_emitters(Pixel p, vec3 origin, vec3 view, vec3 glossy_normal, uint seed, inout vec3 diffuse, inout vec3 glossy)
{
    float alpha = max(p.alpha * specular_aperture, 1e-4);
    float total = 0.0, chosen = 0.0, distance = 0.0;
    vec3 direction = vec3(0.0), chosen_diffuse = vec3(0.0), chosen_glossy = vec3(0.0);
    uint candidates = uint(emitter_samples);
    for (uint i = 0u; i < candidates; ++i) {
        uint index = sample_index * candidates + i;
        uint candidate_seed = hash(seed, index);
        EmitterSample s = sample_emitter(p.position, sample_2d(index, seed), candidate_seed);
        float density = emitter_samples * s.density;
        if (dot(p.geometric_normal, s.direction) <= 0.0 || density <= 0.0) {
            continue;
        }
        float in_reach = s.distance <= max_distance ? 1.0 : 0.0;
        vec3 on_diffuse, on_glossy;
        weigh_drawn(p, view, glossy_normal, alpha, s.direction, s.radiance, s.flags, density, in_reach * gathered_rays,
                    in_reach * reflected_rays, on_diffuse, on_glossy);
        float value = luminance(p.diffuse * on_diffuse + on_glossy);
        total += value;
        if (value > 0.0 && unit_float(hash(candidate_seed, 0xA511E9u)) * total < value) {
            chosen = value;
            chosen_diffuse = on_diffuse;
            chosen_glossy = on_glossy;
            direction = s.direction;
            distance = s.distance;
        }
    }
    start_at(origin, p.position, direction, distance);
    if (chosen > 0.0 && !is_shaded(origin, direction, distance, hash(seed, sample_index + 0x3C6EF3u))) {
        diffuse += chosen_diffuse * (total / chosen);
        glossy += chosen_glossy * (total / chosen);
    }
}
#endif

#if WORLD_IS_DRAWN
uniform float world_rays;        // that are gathered and look for it too; one that is reflected does
uniform float world_on_diffuse;  // factors on its light
uniform float world_on_glossy;

void add_world(Pixel p, vec3 origin, vec3 view, vec3 glossy_normal, uint seed, inout vec3 diffuse, inout vec3 glossy)
{
    uint own_seed = hash(seed, sample_index);
    WorldSample s = sample_world(sample_2d(sample_index, seed), own_seed);
    float alpha = max(p.alpha * specular_aperture, 1e-4);
    vec3 on_diffuse = vec3(0.0), on_glossy = vec3(0.0);
    if (dot(p.geometric_normal, s.direction) > 0.0 && s.density > 0.0) {
        weigh_drawn(p, view, glossy_normal, alpha, s.direction, limited(s.radiance), RAY_ALL, s.density, world_rays, 1.0,
                    on_diffuse, on_glossy);
    }
    if (max_component(p.diffuse * on_diffuse + on_glossy) > 0.0 &&
        !is_blocked(origin, s.direction, max_distance, hash(own_seed))) {
        diffuse += world_on_diffuse * on_diffuse;
        glossy += world_on_glossy * on_glossy;
    }
}
#endif

#if HAS_LIGHTS
// `factor`: how much the light counts.
void add_light(Pixel p, vec3 origin, vec3 view, vec3 glossy_normal, uint pixel_seed, uint k, float factor,
               inout vec3 diffuse, inout vec3 glossy)
{
    Light light = fetch_light(lights_tex, k);
    uint seed = hash(pixel_seed + k, 0xD1B54Au);
    LightSample s = sample_light(light, p.position, sample_2d(sample_index, seed));
    float cosine = dot(p.normal, s.direction);
    // Light behind the surface comes out of glass, bent.
    bool behind = dot(p.geometric_normal, s.direction) <= 0.0;
    if ((behind && !p.is_inside) || max_component(s.irradiance) <= 0.0) {
        return;
    }
    vec3 on_diffuse = (light.flags & RAY_DIFFUSE) != 0u ? s.irradiance * max(cosine, 0.0) / PI : vec3(0.0);
    vec3 on_glossy = vec3(0.0);
#if HAS_GLOSSY
    // Rays of pass `reflect` look for the light too.
    float alpha = max(p.alpha * specular_aperture, 1e-4);
#if HAS_TRANSMISSION
    if (behind && (light.flags & RAY_TRANSMISSION) != 0u) {
        float facet_cosine;
        float rays = ggx_bent_density(glossy_normal, view, s.direction, alpha, p.ior, facet_cosine);
        on_glossy = s.irradiance * p.transmission * (1.0 - dielectric_reflectance(facet_cosine, p.ior)) * rays *
                    mis_weight(s.density, rays);
    }
#endif
    if ((light.flags & RAY_GLOSSY) != 0u && !p.is_inside) {
        float rays = ggx_density(glossy_normal, view, s.direction, alpha);
        vec3 reflected = ggx_reflection(glossy_normal, view, s.direction, alpha, p.f0, p.f90, p.ior);
        on_glossy = s.irradiance * reflected * mis_weight(s.density, rays);
    }
#endif
    if (max_component(on_diffuse + on_glossy) <= 0.0) {
        return;
    }
    float visible = 1.0;
    if (use_shadows && (light.flags & LIGHT_CASTS_SHADOW) != 0u) {
#if SHADOW_CONES
        float angle = shadow_cone_angle > 0.0 ? 0.5 * shadow_cone_angle : light_half_angle(light, origin);
        vec3 side = behind ? -p.geometric_normal : p.geometric_normal;
        visible = cone_visibility(p.position, side, s.direction, tan(angle), s.distance);
#else
        vec3 from = behind ? p.position - p.geometric_normal * ray_start(p.position) : origin;
        start_at(from, p.position, s.direction, s.distance);
        visible = is_shaded(from, s.direction, s.distance, hash(seed, sample_index)) ? 0.0 : 1.0;
#endif
        visible = mix(1.0, visible, shadow_amount);
    }
    diffuse += on_diffuse * (visible * factor);
    glossy += on_glossy * (visible * factor);
}

#if HAS_MANY_LIGHTS
// About what the light brings to the picture. Where it is mirrored counts as far as its width, and the lobe's, blur it.
float estimate(Pixel p, vec3 origin, vec3 view, vec3 glossy_normal, Light light)
{
    vec3 direction;
    float width;
    float brought = light_estimate(light, origin, direction, width);
    float cosine = p.is_inside ? 1.0 : clamp(dot(p.normal, direction) + width, 0.0, 1.0);
    vec3 reflected = p.diffuse * ((light.flags & RAY_DIFFUSE) != 0u ? cosine / PI : 0.0);
#if HAS_GLOSSY
    if ((light.flags & (RAY_GLOSSY | RAY_TRANSMISSION)) != 0u) {
        float alpha = min(p.alpha * specular_aperture + 0.5 * width, 1.0);
        reflected += (p.f0 + p.transmission) * (cosine / PI) +
                     ggx_reflection(glossy_normal, view, direction, alpha, p.f0, p.f90, p.ior);
    }
#endif
    return brought * max_component(reflected);
}

void add_lights(Pixel p, vec3 origin, vec3 view, vec3 glossy_normal, ivec2 at, inout vec3 diffuse, inout vec3 glossy)
{
    uint seed = hash(uint(at.x) | uint(at.y) << 16, random_seed);
    float total = 0.0;
    for (uint k = 0u; k < light_count; ++k) {
        total += estimate(p, origin, view, glossy_normal, fetch_light(lights_tex, k));
    }
    // Passes go on by the golden section: soon each light has been asked as often as its estimate says.
    Picks picks = start_picks(total, unit_float(pixel_shift(at, random_seed + light_count).x + sample_index * 2654435769u));
    while (picks.light < light_count) {
        float factor = 0.0;
        while (picks.light < light_count && factor == 0.0) {
            factor = next_pick(picks, estimate(p, origin, view, glossy_normal, fetch_light(lights_tex, picks.light)));
        }
        if (factor > 0.0) {
            add_light(p, origin, view, glossy_normal, seed, picks.light - 1u, factor, diffuse, glossy);
        }
    }
}
#else
void add_lights(Pixel p, vec3 origin, vec3 view, vec3 glossy_normal, ivec2 at, inout vec3 diffuse, inout vec3 glossy)
{
    uint seed = hash(uint(at.x) | uint(at.y) << 16, random_seed);
    uint k = 0u;
    do {
        add_light(p, origin, view, glossy_normal, seed, k, 1.0, diffuse, glossy);
    } while (++k < light_count);
}
#endif
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
        vec3 origin = p.position + p.geometric_normal * ray_start(p.position);
        vec3 glossy_normal = p.normal;
#if HAS_GLOSSY
        glossy_normal = valid_reflection_normal(p.geometric_normal, -direction, p.normal);
#endif
#if HAS_EMITTERS || WORLD_IS_DRAWN
        uint pixel_seed = hash(uint(at.x) | uint(at.y) << 16, random_seed);
#endif
#if HAS_EMITTERS
        add_emitters(p, origin, -direction, glossy_normal, hash(pixel_seed, 0x7F4A7Cu), diffuse, glossy);
#endif
#if WORLD_IS_DRAWN
        add_world(p, origin, -direction, glossy_normal, hash(pixel_seed, 0x5BD1E9u), diffuse, glossy);
#endif
#if HAS_LIGHTS
        add_lights(p, origin, -direction, glossy_normal, at, diffuse, glossy);
#endif
    }
    imageStore(diffuse_out, at, vec4(finite_or_zero(diffuse), 0.0));
#if HAS_GLOSSY
    imageStore(glossy_out, at, vec4(finite_or_zero(glossy), 0.0));
#endif
}
