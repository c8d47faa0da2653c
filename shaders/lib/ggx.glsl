// SPDX-License-Identifier: GPL-3.0-or-later
// The GGX lobe: evaluation. Walter et al. 2007; height-correlated Smith masking after Heitz 2014, "Understanding the
// Masking-Shadowing Function in Microfacet-Based BRDFs". What scatters between facets is already in f0 and f90
// (lib/closure.glsl).

#include "lib/common.glsl"
#include "lib/fresnel.glsl"
#include "lib/reflection_normal.glsl"

float ggx_lambda(float cosine, float alpha)
{
    float c2 = cosine * cosine;
    float t2 = max(0.0, 1.0 - c2) / max(c2, 1e-12);
    return 0.5 * (sqrt(1.0 + alpha * alpha * t2) - 1.0);
}

float ggx_masking_view(float n_v, float alpha)
{
    return 1.0 / (1.0 + ggx_lambda(n_v, alpha));
}

float ggx_masking(float n_l, float n_v, float alpha)
{
    return 1.0 / (1.0 + ggx_lambda(n_l, alpha) + ggx_lambda(n_v, alpha));
}

float ggx_distribution(float n_h, float alpha)
{
    float a2 = alpha * alpha;
    float d = (n_h * n_h) * (a2 - 1.0) + 1.0;
    return a2 / (PI * d * d);
}

// BRDF times cosine.
vec3 ggx_reflection(vec3 n, vec3 view, vec3 light, float alpha, vec3 f0, vec3 f90, float ior)
{
    vec3 h = normalize(view + light);
    float n_l = dot(n, light);
    float n_v = max(abs(dot(n, view)), 1e-4);
    if (n_l <= 0.0) {
        return vec3(0.0);
    }
    float specular = ggx_distribution(clamp(dot(n, h), 0.0, 1.0), alpha) * ggx_masking(n_l, n_v, alpha) / (4.0 * n_v);
    return fresnel(f0, f90, ior, dot(view, h)) * specular;
}

// How many directions for each steradian light is bent to that meets facets of sample_visible_normal; `ior`: of the far
// side, where `light` points, over the near one. Also the cosine between viewer and facet. Walter et al. 2007.
float ggx_bent_density(vec3 n, vec3 view, vec3 light, float alpha, float ior, out float facet_cosine)
{
    vec3 h = view + ior * light;
    h *= (dot(h, n) < 0.0 ? -1.0 : 1.0) / max(length(h), 1e-6);
    facet_cosine = dot(view, h);
    float beyond = -dot(light, h);
    float n_v = max(abs(dot(n, view)), 1e-4);
    float stretch = facet_cosine - ior * beyond;
    if (facet_cosine <= 0.0 || beyond <= 0.0 || abs(stretch) < 1e-4) {
        return 0.0;
    }
    return ggx_distribution(clamp(dot(n, h), 0.0, 1.0), alpha) * ggx_masking_view(n_v, alpha) * facet_cosine / n_v *
           ior * ior * beyond / (stretch * stretch);
}

// How many directions for each steradian sample_visible_normal (lib/sampling.glsl) sends towards `light`.
float ggx_density(vec3 n, vec3 view, vec3 light, float alpha)
{
    float n_v = max(abs(dot(n, view)), 1e-4);
    float n_h = clamp(dot(n, normalize(view + light)), 0.0, 1.0);
    return ggx_distribution(n_h, alpha) * ggx_masking_view(n_v, alpha) / (4.0 * n_v);
}
