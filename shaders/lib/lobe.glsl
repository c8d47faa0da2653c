// SPDX-License-Identifier: GPL-3.0-or-later
// The lobe of reflections at a pixel.

#include "lib/pixel.glsl"
#include "lib/closure.glsl"

uniform float specular_aperture;

bool is_shiny(Pixel p)
{
    return p.is_surface && max_component(p.f0 + p.f90 + p.transmission) > 0.0;
}

// Share of the light within the lobe that the surface reflects to where the ray along `direction` comes from.
vec3 specular_color(Pixel p, vec3 direction)
{
    float cosine = abs(dot(direction, p.normal));
    return max(specular_directional_albedo(p.f0, p.f90, p.ior, sqrt(p.alpha), cosine) + p.transmission, 1e-3);
}

// Tangent of half the angle that holds about half of the lobe.
float lobe_width(float roughness)
{
    return max(2.0 * roughness * roughness * specular_aperture, 1e-4);
}

// Where lobes take turns, those of another width have other light.
bool are_lobes_alike(float one, float other)
{
    return max(one, other) < 2.0 * min(one, other);
}
