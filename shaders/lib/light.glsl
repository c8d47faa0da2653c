// SPDX-License-Identifier: GPL-3.0-or-later
// Lights: points on them, what arrives from there, and what a ray sees of them. Units and shapes are Blender's.
//
// The including program sets cell_size (metres) and light_falloff (exponent k of 1 / distance^k; 2 is physical), and
// defines which kinds of light there are: HAS_POINTS (and spots), HAS_SPOTS, HAS_SPHERES (points and spots that are true
// spheres), HAS_SUNS, HAS_AREAS (HAS_RECTANGLES, HAS_ELLIPSES), and whether falloff is physical: PHYSICAL_FALLOFF.

#include "lib/sampling.glsl"
#include "lib/solid_angle.glsl"

uniform float cell_size;
uniform float light_falloff;
uniform uint light_count;

layout(binding = TEX_LIGHTS) uniform usampler2D lights_tex;

struct LightSample {
    vec3 direction;   // unit, towards the light
    float distance;   // cells
    vec3 irradiance;  // W/m2 on a surface that faces the direction, unshadowed
    float density;    // how many such directions for each steradian; without bound for lights that rays cannot meet
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

// Points of a sun's disk for each steradian.
float sun_density(Light light, vec3 direction)
{
    float sine2 = light.radius_grid * light.radius_grid;
    return max(dot(direction, light.axis_z), 1e-3) / max(PI * sine2, 1e-30);
}

#if HAS_SUNS
// Uniform over the projected disk: L pi sin^2(half angle) = E, whatever the angle.
LightSample sample_sun(Light light, vec2 u)
{
    vec2 offset = sample_disk(u) * light.radius_grid;
    float along = sqrt(max(1e-6, 1.0 - dot(offset, offset)));
    vec3 direction = light.axis_x * offset.x + light.axis_y * offset.y + light.axis_z * along;
    return LightSample(direction, 1e30, light.intensity / along, sun_density(light, direction));
}
#endif

#if HAS_AREAS
// What is known of an area light seen from a place in front of it, in the light's axes.
struct AreaView {
    vec3 centre;      // z > 0: the light shines there
    vec2 half_sides;
    vec2 low;         // rectangles: the part of it that shines there
    vec2 high;
    bool is_ellipse;
    bool is_wide;     // points are drawn by solid angle, not by area
#if HAS_RECTANGLES
    bool is_turned;   // x and y of `rectangle` are the light's y and x
    SphericalRectangle rectangle;
#endif
#if HAS_ELLIPSES
    EllipticCone cone;
#endif
};

AreaView view_area(Light light, vec3 position)
{
    AreaView view;
    vec3 c = light.position_grid - position;
    view.centre = vec3(dot(c, light.axis_x), dot(c, light.axis_y), max(dot(c, light.axis_z), 1e-20));
    view.half_sides = vec2(light.half_width_grid, light.half_height_grid);
    view.is_ellipse = (light.flags & LIGHT_IS_ELLIPSE) != 0u;
    view.is_wide = false;
    view.low = view.centre.xy - view.half_sides;
    view.high = view.centre.xy + view.half_sides;
#if HAS_RECTANGLES
    // No other part shines there than what lies in this angle around the nearest point of the light's plane.
    float reach = light.spot_smooth < 0.5 * PI - 1e-4 ? view.centre.z * tan(light.spot_smooth) : 1e30;
    view.low = max(view.low, -reach);
    view.high = min(view.high, reach);
    // Where it is narrow it is cut across: rounding shows least.
    view.is_turned = view.high.x - view.low.x > view.high.y - view.low.y;
    view.rectangle = spherical_rectangle(view.is_turned ? view.low.yx : view.low,
                                         view.is_turned ? view.high.yx : view.high, view.centre.z);
    view.is_wide = view.rectangle.solid_angle > LEAST_SOLID_ANGLE;
#endif
#if HAS_ELLIPSES
    if (view.is_ellipse) {
        view.cone = elliptic_cone(view.centre, view.half_sides);
        view.is_wide = PI * view.cone.tangents.x * view.cone.tangents.y > LEAST_SOLID_ANGLE;
    }
#endif
    return view;
}

// How many points for each steradian sample_area sends along a direction in which the light is seen.
float area_density(AreaView view, vec3 direction, float cosine, float squared)
{
    vec2 sides = view.is_ellipse ? 2.0 * view.half_sides : view.high - view.low;
    float area = sides.x * sides.y * (view.is_ellipse ? 0.25 * PI : 1.0);
    float density = squared / max(area * cosine, 1e-20);
#if HAS_RECTANGLES
    density = view.is_wide && !view.is_ellipse ? 1.0 / view.rectangle.solid_angle : density;
#endif
#if HAS_ELLIPSES
    density = view.is_wide && view.is_ellipse ? elliptic_cone_density(view.cone, direction) : density;
#endif
    return density;
}

LightSample sample_area(Light light, vec3 position, vec2 u)
{
    AreaView view = view_area(light, position);
    vec2 place = mix(view.low, view.high, u);
#if HAS_RECTANGLES
    if (view.is_wide && !view.is_ellipse) {
        place = sample_rectangle(view.rectangle, view.is_turned ? u.yx : u);
        place = view.is_turned ? place.yx : place;
    }
#endif
    vec3 to_light = vec3(place, view.centre.z);
#if HAS_ELLIPSES
    if (view.is_ellipse) {
        vec2 p = sample_disk(u) * view.half_sides;
        vec3 direction = sample_elliptic_cone(view.cone, u);
        // Rounding lets some of them miss its plane.
        vec3 met = direction * (view.centre.z / max(direction.z, 1e-6));
        to_light = view.is_wide ? met : vec3(view.centre.xy + p, view.centre.z);
    }
#endif
    float squared = max(dot(to_light, to_light), 1e-20);
    float distance = sqrt(squared);
    vec3 local = to_light / distance;
    float density = area_density(view, local, local.z, squared);
    bool shines = dot(light.position_grid - position, light.axis_z) > 0.0 && all(lessThan(view.low, view.high));
    float factor = shines ? spread_attenuation(light, local.z) * falloff_factor(distance * cell_size) / density : 0.0;
    vec3 direction = light.axis_x * local.x + light.axis_y * local.y + light.axis_z * local.z;
    return LightSample(normalize(direction), distance, light.intensity * factor, density);
}
#endif

// The cone in which a point or spot light is seen: around a disk that faces the receiver, or a true sphere; all around
// inside of one. `per_squared`: its versine over the light's radius squared, where it has none too.
float light_versine(Light light, float squared, out float per_squared)
{
    float radius2 = light.radius_grid * light.radius_grid;
#if HAS_SPHERES
    if ((light.flags & LIGHT_IS_SPHERE) != 0u) {
        bool inside = squared <= radius2;
        per_squared = inside ? 2.0 / radius2 : 1.0 / (squared * (1.0 + sqrt(max(1.0 - radius2 / squared, 0.0))));
        return radius2 * per_squared;
    }
#endif
    per_squared = 1.0 / (squared + radius2 + sqrt(squared * (squared + radius2)));
    return radius2 * per_squared;
}

#if HAS_POINTS
// Uniform in solid angle. L = I / (pi r^2).
LightSample sample_point(Light light, vec3 position, vec2 u)
{
    vec3 axis = light.position_grid - position;
    float squared = max(dot(axis, axis), 1e-20);
    float to_centre = sqrt(squared);
    float per_squared, sine;
    float versine = light_versine(light, squared, per_squared);
    vec3 direction = sample_cone(axis / to_centre, versine, u, sine);
    float along = dot(axis, direction);
    float distance = squared / max(along, 1e-20);
#if HAS_SPHERES
    if ((light.flags & LIGHT_IS_SPHERE) != 0u) {
        float radius2 = light.radius_grid * light.radius_grid;
        float inside = sqrt(max(radius2 - squared * sine * sine, 0.0));
        distance = along + (squared > radius2 ? -inside : inside);
    }
#endif
    float factor = 2.0 * per_squared / (cell_size * cell_size) * falloff_factor(distance * cell_size);
#if HAS_SPOTS
    if (light.kind == LIGHT_SPOT) {
        factor *= spot_attenuation(light, -direction, 0.0);
    }
#endif
    return LightSample(direction, distance, light.intensity * factor, 1.0 / max(2.0 * PI * versine, 1e-30));
}
#endif

// A point on the light, chosen by u, seen from position (grid space).
LightSample sample_light(Light light, vec3 position, vec2 u)
{
    LightSample result = LightSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), 1e30);
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
    vec3 off = to_light - direction * along;
    float off2 = dot(off, off);
    float squared = dot(to_light, to_light);
    float radius2 = light.radius_grid * light.radius_grid;
    bool seen;
    if ((light.flags & LIGHT_IS_SPHERE) != 0u) {
        bool inside = squared <= radius2;
        float half_chord = sqrt(max(radius2 - off2, 0.0));
        seen = off2 < radius2 && (inside || along > 0.0);
        distance = along + (inside ? half_chord : -half_chord);
    } else {  // a disk that faces the ray's origin
        seen = along > 0.0 && squared * off2 < radius2 * along * along;
        distance = squared / max(along, 1e-20);
    }
    float share = light.kind == LIGHT_SPOT ? spot_attenuation(light, -direction, 0.0) : 1.0;
    return seen && distance > 0.0 ? light.radiance * share : vec3(0.0);
}

// How many points for each steradian sample_light sends along a direction in which the light is seen, `distance` away.
// Without bound for lights that rays cannot meet.
float light_density(Light light, vec3 position, vec3 direction, float distance)
{
    float density = 1e30;
#if HAS_SUNS
    if (light.kind == LIGHT_SUN) {
        density = sun_density(light, direction);
    }
#endif
#if HAS_AREAS
    if (light.kind == LIGHT_AREA) {
        vec3 local = vec3(dot(direction, light.axis_x), dot(direction, light.axis_y), dot(direction, light.axis_z));
        density = area_density(view_area(light, position), local, local.z, distance * distance);
    }
#endif
#if HAS_POINTS
    if (light.kind == LIGHT_POINT || light.kind == LIGHT_SPOT) {
        vec3 to_light = light.position_grid - position;
        float unused;
        density = 1.0 / max(2.0 * PI * light_versine(light, max(dot(to_light, to_light), 1e-20), unused), 1e-30);
    }
#endif
    return density;
}
