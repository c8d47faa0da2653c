// SPDX-License-Identifier: GPL-3.0-or-later
// Normals that mirror.

#ifndef REFLECTION_NORMAL_GLSL
#define REFLECTION_NORMAL_GLSL

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

// Cosine between the viewer and that normal.
float specular_cosine(vec3 g, vec3 view, vec3 n)
{
    return clamp(dot(valid_reflection_normal(g, view, n), view), 0.0, 1.0);
}

#endif
