// SPDX-License-Identifier: GPL-3.0-or-later
// The GGX lobe for a list of (cosine of the viewer, roughness, u).    White: f0 = f90 = 1.
// Output: (sampled direction, its weight), (BRDF times cosine over the pdf of a direction of cosine u.x, even in angle
// u.y; albedo as lib/closure.glsl fits it; density of sampled directions there over the pdf; 0).

#include "lib/closure.glsl"
#include "lib/ggx.glsl"
#include "lib/sampling.glsl"
#include "tests/rows.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    vec4 given = inputs[index];
    float alpha = given.y * given.y;
    vec3 n = vec3(0.0, 0.0, 1.0);
    vec3 view = vec3(sqrt(max(0.0, 1.0 - given.x * given.x)), 0.0, given.x);
    vec3 h = sample_visible_normal(view, alpha, given.zw);
    vec3 light = reflect(-view, h);
    float weight = light.z > 0.0 ? ggx_masking(light.z, view.z, alpha) / ggx_masking_view(view.z, alpha) : 0.0;
    results[2u * index] = vec4(light, weight);

    float phi = 2.0 * PI * given.w;
    float s = sqrt(max(0.0, 1.0 - given.z * given.z));
    vec3 uniform_direction = vec3(s * cos(phi), s * sin(phi), given.z);
    float value = ggx_reflection(n, view, uniform_direction, alpha, vec3(1.0), vec3(1.0), 0.0).x * 2.0 * PI;
    float albedo = specular_directional_albedo(vec3(1.0), vec3(1.0), 0.0, given.y, given.x).x;
    float density = ggx_density(n, view, uniform_direction, alpha) * 2.0 * PI;
    results[2u * index + 1u] = vec4(value, albedo, density, 0.0);
}
