// SPDX-License-Identifier: GPL-3.0-or-later
// The GGX lobe: evaluation. Walter et al. 2007; height-correlated Smith masking after Heitz 2014, "Understanding the
// Masking-Shadowing Function in Microfacet-Based BRDFs". What scatters between facets is already in f0 and f90
// (lib/closure.glsl).

#include "lib/common.glsl"

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

vec3 fresnel(vec3 f0, vec3 f90, float cosine)
{
    float m = clamp(1.0 - cosine, 0.0, 1.0);
    float m2 = m * m;
    return mix(f0, f90, m2 * m2 * m);
}

// BRDF times cosine.
vec3 ggx_reflection(vec3 n, vec3 view, vec3 light, float alpha, vec3 f0, vec3 f90)
{
    vec3 h = normalize(view + light);
    float n_l = dot(n, light);
    float n_v = max(abs(dot(n, view)), 1e-4);
    if (n_l <= 0.0) {
        return vec3(0.0);
    }
    float specular = ggx_distribution(clamp(dot(n, h), 0.0, 1.0), alpha) * ggx_masking(n_l, n_v, alpha) / (4.0 * n_v);
    return fresnel(f0, f90, dot(view, h)) * specular;
}

// How many directions for each steradian sample_visible_normal (lib/sampling.glsl) sends towards `light`.
float ggx_density(vec3 n, vec3 view, vec3 light, float alpha)
{
    float n_v = max(abs(dot(n, view)), 1e-4);
    float n_h = clamp(dot(n, normalize(view + light)), 0.0, 1.0);
    return ggx_distribution(n_h, alpha) * ggx_masking_view(n_v, alpha) / (4.0 * n_v);
}

// The normal nearest to n whose mirror direction stays above the surface: with interpolated normals it can lie below, and
// the reflection would be black. As Cycles' ensure_valid_specular_reflection: in the plane of the geometric normal g (z)
// and n, a normal (x, z) sends view (vx, vz) to height 2 (x vx + z vz) z - vz; it shall be `lowest`, which is a quadratic
// equation in z^2.
vec3 valid_reflection_normal(vec3 g, vec3 view, vec3 n)
{
    float vz = dot(g, view);
    float lowest = min(0.9 * vz, 0.01);
    vec3 across = n - g * dot(n, g);
    float size = length(across);
    if (vz <= 0.0 || size < 1e-5 || dot(g, reflect(-view, n)) >= lowest) {
        return n;
    }
    across /= size;
    float vx = dot(across, view);
    float t = lowest + vz;
    float a = vx * vx + vz * vz;
    float b = vx * vx + t * vz;
    float root = sqrt(max(0.0, b * b - a * t * t));
    vec3 best = g;
    float nearest = -2.0;
    for (int k = 0; k < 2; ++k) {
        float z2 = clamp((k == 0 ? b + root : b - root) / (2.0 * a), 0.0, 1.0);
        vec3 candidate = across * sqrt(1.0 - z2) + g * sqrt(z2);
        // Squaring the equation has added solutions: one side of it must have the sign of the other.
        if ((t - 2.0 * vz * z2) * vx >= -1e-6 && dot(candidate, n) > nearest) {
            nearest = dot(candidate, n);
            best = candidate;
        }
    }
    return best;
}
