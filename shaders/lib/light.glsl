// SPDX-License-Identifier: GPL-3.0-or-later
// Lights: points on them, what arrives from there, and what a ray sees of them. Units and shapes are Blender's.
//
// The including program sets cell_size (metres) and light_falloff (exponent k of 1 / distance^k; 2 is physical), and
// defines which kinds of light there are: HAS_POINTS (and spots), HAS_SPOTS, HAS_SPHERES (points and spots that are true
// spheres), HAS_SUNS, HAS_AREAS, and whether falloff is physical: PHYSICAL_FALLOFF.

#include "lib/sampling.glsl"

uniform float cell_size;
uniform float light_falloff;
uniform uint light_count;

layout(binding = TEX_LIGHTS) uniform usampler2D lights_tex;

struct LightSample {
    vec3 direction;   // unit, towards the light
    float distance;   // cells
    vec3 irradiance;  // W/m2 on a surface that faces the direction, unshadowed
};

// Share of a spot's light inside its blended cone, which `more` widens (cosine). Cycles, spot_light_attenuation: the angle
// is measured in the light's own space, so that its scale makes the cone elliptic.
float spot_attenuation(Light light, vec3 from_light, float more)
{
    vec3 local = vec3(dot(from_light, light.axis_x), dot(from_light, light.axis_y), dot(from_light, light.axis_z));
    float cosine = -normalize(local * light.spot_scale).z;
    return smoothstep(0.0, 1.0, (cosine + more - light.cos_cone) * light.spot_smooth);
}

// Share of an area light's radiance at an angle off its normal (its cosine is given) for a spread of 2 h:
// max(0, 1 - tan angle / tan h). Cycles, area_light_spread_attenuation; the gain that keeps the power is in `intensity`.
float spread_attenuation(Light light, float cosine)
{
    float h = light.spot_smooth;
    if (h >= 0.5 * PI - 1e-4) {
        return 1.0;
    }
    float tangent = sqrt(max(0.0, 1.0 - cosine * cosine)) / max(cosine, 1e-6);
    return max(0.0, 1.0 - tangent / tan(h));
}

// 1 / distance^k over 1 / distance^2: what a falloff that is not physical changes.
float falloff_factor(float distance_m)
{
#if PHYSICAL_FALLOFF
    return 1.0;
#else
    return pow(max(distance_m, 1e-6), 2.0 - light_falloff);
#endif
}

#if HAS_SUNS
// Uniform over the projected disk: L pi sin^2(half angle) = E, whatever the angle.
LightSample sample_sun(Light light, vec2 u)
{
    vec2 offset = sample_disk(u) * light.radius_grid;
    float along = sqrt(max(1e-6, 1.0 - dot(offset, offset)));
    vec3 direction = light.axis_x * offset.x + light.axis_y * offset.y + light.axis_z * along;
    return LightSample(direction, 1e30, light.intensity / along);
}
#endif

#if HAS_AREAS
LightSample sample_area(Light light, vec3 position, vec2 u)
{
    bool ellipse = (light.flags & LIGHT_IS_ELLIPSE) != 0u;
    vec2 p = ellipse ? sample_disk(u) : 2.0 * u - 1.0;
    vec3 to_light = light.position_grid + light.axis_x * (p.x * light.half_width_grid) +
                    light.axis_y * (p.y * light.half_height_grid) - position;
    float squared = max(dot(to_light, to_light), 1e-12);
    float distance = sqrt(squared);
    vec3 direction = to_light / distance;
    float cosine = dot(direction, light.axis_z);
    float area = 4.0 * light.half_width_grid * light.half_height_grid * (ellipse ? 0.25 * PI : 1.0);
    float factor = cosine > 0.0 ? cosine * area / squared * spread_attenuation(light, cosine) : 0.0;
    return LightSample(direction, distance, light.intensity * (factor * falloff_factor(distance * cell_size)));
}
#endif

#if HAS_POINTS
LightSample sample_point(Light light, vec3 position, vec2 u)
{
    vec3 axis = light.position_grid - position;
    float squared = max(dot(axis, axis), 1e-12);
    vec3 z = axis * inversesqrt(squared);
    vec3 t, b;
    basis(z, t, b);
    // A disk that faces the receiver; a point when its radius is 0.
    vec2 p = sample_disk(u) * light.radius_grid;
    vec3 to_light = axis + t * p.x + b * p.y;
    float to_squared = max(dot(to_light, to_light), 1e-12);
    float distance = sqrt(to_squared);
    vec3 direction = to_light / distance;
    float factor = dot(z, direction) / (to_squared * cell_size * cell_size);
#if HAS_SPHERES
    float radius2 = light.radius_grid * light.radius_grid;
    if ((light.flags & LIGHT_IS_SPHERE) != 0u && squared > radius2) {
        // The visible cap of a true sphere, uniform in solid angle. L = I / (pi r^2).
        float sin2 = radius2 / squared;
        float versine = sin2 / (1.0 + sqrt(1.0 - sin2));  // 1 - cos, without cancellation for small spheres
        float cos_theta = 1.0 - u.x * versine;
        float sin_theta = sqrt(max(0.0, 1.0 - cos_theta * cos_theta));
        float phi = 2.0 * PI * u.y;
        direction = normalize(t * (sin_theta * cos(phi)) + b * (sin_theta * sin(phi)) + z * cos_theta);
        float along = dot(axis, direction);
        distance = along - sqrt(max(0.0, along * along - squared + radius2));
        float radius_m = max(light.radius_grid * cell_size, 1e-9);
        factor = 2.0 * versine / (radius_m * radius_m);
    }
#endif
#if HAS_SPOTS
    if (light.kind == LIGHT_SPOT) {
        factor *= spot_attenuation(light, -direction, 0.0);
    }
#endif
    return LightSample(direction, distance, light.intensity * (factor * falloff_factor(distance * cell_size)));
}
#endif

// A point on the light, chosen by u, seen from position (grid space).
LightSample sample_light(Light light, vec3 position, vec2 u)
{
    LightSample result = LightSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0));
#if HAS_SUNS
    if (light.kind == LIGHT_SUN) {
        result = sample_sun(light, u);
    }
#endif
#if HAS_AREAS
    if (light.kind == LIGHT_AREA) {
        result = sample_area(light, position, u);
    }
#endif
#if HAS_POINTS
    if (light.kind == LIGHT_POINT || light.kind == LIGHT_SPOT) {
        result = sample_point(light, position, u);
    }
#endif
    return result;
}

// Half the angle under which the light is seen from position: which of two ways to find its reflection is less noisy.
float light_half_angle(Light light, vec3 position)
{
    if (light.kind == LIGHT_SUN) {
        return asin(clamp(light.radius_grid, 0.0, 1.0));
    }
    return atan(light.radius_grid, max(distance(position, light.position_grid), 1e-6));
}

// Radiance of the light along a ray, and how far it is (cells); zero when the ray misses it.
vec3 light_along_ray(Light light, vec3 origin, vec3 direction, out float distance)
{
    distance = 1e30;
    if (light.kind == LIGHT_SUN) {
        bool inside = dot(direction, light.axis_z) > 0.0 && length(cross(direction, light.axis_z)) < light.radius_grid;
        return inside ? light.radiance : vec3(0.0);
    }
    vec3 to_light = light.position_grid - origin;
    if (light.kind == LIGHT_AREA) {
        float cosine = dot(direction, light.axis_z);
        if (cosine <= 0.0) {
            return vec3(0.0);
        }
        distance = dot(to_light, light.axis_z) / cosine;
        vec3 p = direction * distance - to_light;
        vec2 at = vec2(dot(p, light.axis_x) / light.half_width_grid, dot(p, light.axis_y) / light.half_height_grid);
        bool inside = (light.flags & LIGHT_IS_ELLIPSE) != 0u ? dot(at, at) <= 1.0 : max(abs(at.x), abs(at.y)) <= 1.0;
        return distance > 0.0 && inside ? light.radiance * spread_attenuation(light, cosine) : vec3(0.0);
    }
    float along = dot(to_light, direction);
    float off2 = dot(to_light, to_light) - along * along;
    float radius2 = light.radius_grid * light.radius_grid;
    if (along <= 0.0 || off2 >= radius2) {
        return vec3(0.0);
    }
    distance = (light.flags & LIGHT_IS_SPHERE) != 0u ? along - sqrt(radius2 - off2) : along;
    float share = light.kind == LIGHT_SPOT ? spot_attenuation(light, -direction, 0.0) : 1.0;
    return distance > 0.0 ? light.radiance * share : vec3(0.0);
}

// How many points for each steradian sample_light sends along a direction in which the light is seen, `distance` away.
// Without bound for lights that rays cannot meet.
float light_density(Light light, vec3 position, vec3 direction, float distance)
{
    if (light.radius_grid <= 0.0) {
        return 1e30;
    }
    if (light.kind == LIGHT_SUN) {
        float sine2 = light.radius_grid * light.radius_grid;
        return max(dot(direction, light.axis_z), 1e-3) / (PI * sine2);
    }
    if (light.kind == LIGHT_AREA) {
        float area = 4.0 * light.half_width_grid * light.half_height_grid *
                     ((light.flags & LIGHT_IS_ELLIPSE) != 0u ? 0.25 * PI : 1.0);
        return distance * distance / max(area * dot(direction, light.axis_z), 1e-12);
    }
    vec3 to_light = light.position_grid - position;
    float squared = max(dot(to_light, to_light), 1e-12);
    float radius2 = light.radius_grid * light.radius_grid;
    float sine2 = radius2 / squared;
    if ((light.flags & LIGHT_IS_SPHERE) != 0u && sine2 < 1.0) {
        return (1.0 + sqrt(1.0 - sine2)) / (2.0 * PI * sine2);
    }
    return distance * distance / max(PI * radius2 * dot(direction, to_light) * inversesqrt(squared), 1e-12);
}
