// SPDX-License-Identifier: GPL-3.0-or-later
// Which lights are asked for their shadows, where there are more than LIGHT_PICKS. What each brings unshadowed is
// estimated; those that bring a LIGHT_PICKS-th of the sum, or more, are asked in any case. The others lie on a line, each
// as long as its estimate, and those are asked that points meet which lie a LIGHT_PICKS-th of the sum apart; they count as
// much more as they are asked less often. So all count right on average, and no light counts for more than a
// LIGHT_PICKS-th of the sum that was not asked in any case.
// Duffield, Lund and Thorup 2007, "Priority sampling for estimation of arbitrary subset sums" (threshold sampling);
// Madow 1949, "On the Theory of Systematic Sampling" (points on the line).

#include "lib/light.glsl"

// About what a light brings to a surface that faces it, W/m2, unshadowed; its direction, and the sine of half the angle
// under which it is seen. Not 0 where it brings something.
float light_estimate(Light light, vec3 position, out vec3 direction, out float width)
{
    float brightness = max_component(light.intensity);
    if (light.kind == LIGHT_SUN) {
        direction = light.axis_z;
        width = light.radius_grid;
        return brightness;
    }
    vec3 to_light = light.position_grid - position;
    float squared = max(dot(to_light, to_light), 1e-12);
    float distance = sqrt(squared);
    direction = to_light / distance;
    float radius = light.radius_grid;
#if HAS_AREAS
    if (light.kind == LIGHT_AREA) {
        radius = length(vec2(light.half_width_grid, light.half_height_grid));  // corners reach farther than sides
    }
#endif
    width = min(radius / distance, 1.0);
    float estimate = brightness * falloff_factor(distance * cell_size);
#if HAS_AREAS
    if (light.kind == LIGHT_AREA) {
        float area = 4.0 * light.half_width_grid * light.half_height_grid;
        float cosine = min(dot(direction, light.axis_z) + width, 1.0);
        // By its nearest point, as that is what a point on it may bring.
        float near = max(distance - radius, 0.25 * max(distance, radius));
        float seen = min(area * cosine / (near * near), PI);
        return cosine > 0.0 ? estimate * seen * spread_attenuation(light, cosine) : 0.0;
    }
#endif
#if HAS_SPOTS
    if (light.kind == LIGHT_SPOT) {
        // Cosines differ by up to sqrt(2) times the sine, and more where the cone is stretched.
        float stretch = max_component(light.spot_scale) /
                        max(min(light.spot_scale.x, min(light.spot_scale.y, light.spot_scale.z)), 1e-6);
        estimate *= spot_attenuation(light, -direction, min(1.5 * width * stretch, 2.0));
    }
#endif
    return estimate / ((squared + 0.25 * light.radius_grid * light.radius_grid) * cell_size * cell_size);
}

// The walk along the line.
struct Picks {
    float interval;  // from point to point
    float point;     // the next
    float reached;   // where the line has come to
    uint light;      // the next
};

// `total`: of all estimates; `random`, in [0, 1): where points lie.
Picks start_picks(float total, float random)
{
    float interval = total / float(LIGHT_PICKS);
    return Picks(interval, interval * random, 0.0, 0u);
}

// Go on to the next light, which brings `estimate`. How much it counts; 0: it is not asked.
float next_pick(inout Picks picks, float estimate)
{
    ++picks.light;
    if (estimate >= picks.interval) {
        return estimate > 0.0 ? 1.0 : 0.0;
    }
    picks.reached += estimate;
    bool met = estimate > 0.0 && picks.reached > picks.point;
    picks.point += met ? picks.interval : 0.0;
    return met ? picks.interval / estimate : 0.0;
}
