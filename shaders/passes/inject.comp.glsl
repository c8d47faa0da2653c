// SPDX-License-Identifier: GPL-3.0-or-later
// Light that falls on each voxel face straight from lights (HAS_LIGHTS, and HAS_MANY_LIGHTS: a part is picked),
// from points drawn on emitters (HAS_EMITTERS), and from directions drawn by the world's light (WORLD_IS_DRAWN).
// FINDS_CHANGED: after an edit; nothing is traced. Faces whose light stays get what they had, and the others are listed.
// HAS_REACH: only bricks that are marked can have such (pass inject_reach).
// Input: faces, lights, emitters, the world, triangles of cells.    Output: irradiance_img: irradiance / pi, W/(m2 sr).
// Follows Crassin et al. 2011, "Interactive Indirect Illumination Using Voxel Cone Tracing".
// Differs: visibility is a ray against the geometry for occupied voxels only, not a light-view map or a march.

#include "lib/site.glsl"
#include "lib/sampling.glsl"
#include "lib/packed_light.glsl"
#if HAS_LIGHTS
#include "lib/light_pick.glsl"
#endif
#if HAS_EMITTERS
#include "lib/emitter.glsl"
#endif
#if WORLD_IS_DRAWN
#include "lib/world_sample.glsl"
#endif

#if FINDS_CHANGED
#include "lib/changed_faces.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

#if FINDS_CHANGED
layout(binding = TEX_FACE_IRRADIANCE) uniform usampler2D irradiance_before_tex;
#if HAS_REACH
layout(binding = TEX_REACH) uniform usampler3D reach_tex;
#endif
#endif

layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D irradiance_img;

uniform uint random_seed;
uniform bool use_shadows;
uniform float link_count;  // rays that look for emitters and the world too, cosine-distributed (pass link)
uniform uint point_count;  // of each face, where light is looked for

// Points on a large light.
const uint SAMPLES = 4u;

#if FINDS_CHANGED
bool has_changed = false;
#endif

// As is_blocked of lib/trace.glsl; while changes are looked for, only whether an edit may matter to it is noted.
bool is_shadowed(vec3 origin, vec3 direction, float limit, uint seed)
{
#if FINDS_CHANGED
    has_changed = has_changed || crosses_box(origin, direction, limit, 0.0);
    return false;
#else
    return is_blocked(origin, direction, limit, seed);
#endif
}

// As is_shaded, likewise.
bool shades(vec3 origin, vec3 direction, float distance, uint seed)
{
#if FINDS_CHANGED
    has_changed = has_changed || crosses_box(origin, direction, distance, 0.0);
    return false;
#else
    return is_shaded(origin, direction, distance, seed);
#endif
}

// Point k of what a face stands for: points are spread evenly over the plane of its surface in its cell. `face` is
// NONE_INDEX where there is no surface, or it is hidden from the first point.
Site site_point(Site site, uint k)
{
    float side = cell_side(site.position);
    vec3 place = site.position / side;
    vec3 cell = floor(place);
    int axis = dominant_axis(site.normal);
    int right = (axis + 1) % 3;
    int up = (axis + 2) % 3;
    uvec2 first = uvec2(clamp(vec2(place[right] - cell[right], place[up] - cell[up]), 0.0, 1.0) * 4294967040.0);
    vec2 across = sample_2d(k, first) - sample_2d(0u, first);
    vec3 shift = vec3(0.0);
    shift[right] = across.x;
    shift[up] = across.y;
    shift[axis] = -dot(shift, site.normal) / site.normal[axis];
    float depth = place[axis] + shift[axis] - cell[axis];
    bool is_there = k > 0u && depth >= 0.0 && depth <= 1.0;
    shift *= side;
    float size = length(shift);
    vec3 origin = site.origin;
    vec3 direction = shift / max(size, 1e-6);
    // Along the surface, where nothing shall be; down, where it is.
    int look = 0;
    if (k > 0u) do {
        float reach = look == 0 ? size : 2.0 * RAY_START * side;
        bool blocked = is_shadowed(origin, direction, is_there ? reach : -1.0, hash(site.seed, k));
#if FINDS_CHANGED
        blocked = look == 1;  // wherever there may be a point, light is looked for
#endif
        is_there = is_there && blocked == (look == 1);
        origin = site.origin + shift;
        direction = -site.normal;
    } while (++look < 2);
    uint face = k == 0u || is_there ? site.face : NONE_INDEX;
    uint seed = k == 0u ? site.seed : hash(site.seed, k);
    return Site(face, site.facing, seed, site.position + shift, origin, site.normal, site.shading_normal);
}

#if HAS_LIGHTS
// Points on a light: one for each cell that a penumbra is wide whose occluder stands half way, up to SAMPLES. Of narrower
// penumbras a face knows no more than of hard shadows. How wide a sun's are, is not known: SAMPLES, or one where it is
// hardly wider than a point. All points of a face share them, rounded down, but none goes without.
uint light_points(Site site, Light light)
{
    uint most = light.radius_grid > 0.01 ? SAMPLES : 1u;
    if (light.kind != LIGHT_SUN) {
        most = uint(min(ceil(2.0 * light.radius_grid / cell_side(site.position)), float(SAMPLES)));
    }
    return max(most / point_count, 1u);
}

// Whether all of the light lies behind the surface.
bool lies_behind(Site site, Light light)
{
    float reach = light.kind == LIGHT_AREA ? length(vec2(light.half_width_grid, light.half_height_grid)) : light.radius_grid;
    vec3 away = light.position_grid - site.position;
    if (light.kind == LIGHT_SUN) {
        away = light.axis_z * sqrt(max(1.0 - reach * reach, 0.0));
    }
    return dot(away, site.shading_normal) + reach < 0.0;
}

// Irradiance that light k brings, from so many points on it.
vec3 light_from_light(Site site, uint k, Light light, uint points)
{
    uint seed = hash(site.seed + k, random_seed);
    vec3 sum = vec3(0.0);
    uint i = 0u;
    if (points > 0u) do {
        LightSample s = sample_light(light, site.position, sample_2d(i, seed));
        float cosine = dot(site.shading_normal, s.direction);
        if (cosine <= 0.0 || max_component(s.irradiance) <= 0.0 || !leaves_surface(site, s.direction)) {
            continue;
        }
        bool traces = use_shadows && (light.flags & LIGHT_CASTS_SHADOW) != 0u;
        start_at(site.origin, site.position, s.direction, s.distance);
        bool shaded = traces && shades(site.origin, s.direction, s.distance, hash(seed, i));
        sum += shaded ? vec3(0.0) : s.irradiance * cosine;
    } while (++i < points);
    return sum / float(max(points, 1u));
}

#if HAS_MANY_LIGHTS
// About what the light brings, W/m2.
float estimate(Site site, Light light)
{
    vec3 direction;
    float width;
    float brought = light_estimate(light, site.position, direction, width);
    float cosine = clamp(dot(site.shading_normal, direction) + width, 0.0, 1.0);
    return (light.flags & RAY_DIFFUSE) != 0u ? brought * cosine : 0.0;
}

vec3 light_from_lights(Site site)
{
    float total = 0.0;
    for (uint k = 0u; k < light_count; ++k) {
        total += estimate(site, fetch_light(lights_tex, k));
    }
    Picks picks = start_picks(total, unit_float(hash(site.seed + light_count, random_seed)));
    vec3 irradiance = vec3(0.0);
    while (picks.light < light_count) {
        float factor = 0.0, brought = 0.0;
        while (picks.light < light_count && factor == 0.0) {
            brought = estimate(site, fetch_light(lights_tex, picks.light));
            factor = next_pick(picks, brought);
        }
        if (factor > 0.0) {
            uint k = picks.light - 1u;
            Light light = fetch_light(lights_tex, k);
            // A light that brings a large part of all is worth more than one point.
            uint points = clamp(uint(brought / picks.interval), 1u, light_points(site, light));
            irradiance += factor * light_from_light(site, k, light, points);
        }
    }
    return irradiance;
}
#else
vec3 light_from_lights(Site site)
{
    vec3 irradiance = vec3(0.0);
    uint k = 0u;
    do {
        Light light = fetch_light(lights_tex, k);
        bool is_received = (light.flags & RAY_DIFFUSE) != 0u && !lies_behind(site, light);
        irradiance += light_from_light(site, k, light, is_received ? light_points(site, light) : 0u);
    } while (++k < light_count);
    return irradiance;
}
#endif
#endif

#if HAS_EMITTERS
vec3 light_from_emitters(Site site)
{
    vec3 irradiance = vec3(0.0);
    uint seed = hash(site.seed + 0x68E31Du, random_seed);
    uint i = 0u;
    do {
        EmitterSample s = sample_emitter(site.position, sample_2d(i, seed), hash(seed, i));
        float cosine = dot(site.shading_normal, s.direction);
        float density = emitter_samples * s.density;
        if (cosine <= 0.0 || density <= 0.0 || max_component(s.radiance) <= 0.0 || (s.flags & RAY_DIFFUSE) == 0u ||
            !leaves_surface(site, s.direction)) {
            continue;
        }
        start_at(site.origin, site.position, s.direction, s.distance);
        bool blocked = shades(site.origin, s.direction, s.distance, hash(seed, i + 0x517CC1u));
        float weight = mis_weight(density, link_count * cosine / PI);
        irradiance += blocked ? vec3(0.0) : s.radiance * (cosine * weight / density);
    } while (++i < uint(emitter_samples));
    return irradiance;
}
#endif

#if WORLD_IS_DRAWN
vec3 light_from_world(Site site)
{
    vec3 irradiance = vec3(0.0);
    uint seed = hash(site.seed + 0x2C1B3Cu, random_seed);
    uint i = 0u;
    do {
        WorldSample s = sample_world(sample_2d(i, seed), hash(seed, i));
        float cosine = dot(site.shading_normal, s.direction);
        if (cosine <= 0.0 || s.density <= 0.0 || !leaves_surface(site, s.direction)) {
            continue;
        }
        bool blocked = is_shadowed(site.origin, s.direction, 1e30, hash(seed, i + 0x517CC1u));
        float density = world_samples * s.density;
        float weight = mis_weight(density, link_count * cosine / PI);
        irradiance += blocked ? vec3(0.0) : s.radiance * (cosine * weight / density);
    } while (++i < uint(world_samples));
    return irradiance;
}
#endif

void main()
{
#if FINDS_CHANGED && HAS_REACH
    // Most faces need no more than this.
    uint number = site_first + invocation_index();
    uint ordered = number < face_count ? texelFetch(face_order_tex, list_texel(number), 0).r : 0u;
    uint face = ordered & FACE_MASK;
    vec3 place = uintBitsToFloat(texelFetch(face_place_tex, list_texel(face), 0).xyz);
    uint reach = texelFetch(reach_tex, nearest_cell(place) / BRICK, 0).r;
    face = number < face_count ? face : NONE_INDEX;
    Site site = Site(face, ordered >> FACING_SHIFT, 0u, vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    if (reach != 0u) {
        site = site_of_thread();
    }
#else
    Site site = site_of_thread();
#endif
    if (site.face == NONE_INDEX) {
        return;
    }
    vec3 irradiance = vec3(0.0);
    float points = 0.0;
#if FINDS_CHANGED && HAS_REACH
    uint end = reach != 0u ? point_count : 0u;
#else
    uint end = point_count;
#endif
    uint k = 0u;
    if (k < end) do {
        Site point = site_point(site, k);
        if (point.face == NONE_INDEX) {
            continue;
        }
        points += 1.0;
#if HAS_LIGHTS
        irradiance += light_from_lights(point);
#endif
#if HAS_EMITTERS
        irradiance += light_from_emitters(point);
#endif
#if WORLD_IS_DRAWN
        irradiance += light_from_world(point);
#endif
    } while (++k < end);
#if FINDS_CHANGED
    uint before = number_before(site.face);
    if (has_changed || before == NONE_INDEX) {
        list_changed(site.face, site.facing);
    } else {
        imageStore(irradiance_img, list_texel(site.face), texelFetch(irradiance_before_tex, list_texel(before), 0));
    }
#else
    imageStore(irradiance_img, list_texel(site.face), pack_light(irradiance / (PI * points)));
#endif
}
