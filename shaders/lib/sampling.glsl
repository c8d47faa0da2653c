// SPDX-License-Identifier: GPL-3.0-or-later
// Low-discrepancy points and the directions made of them.

#include "lib/common.glsl"

// Point `index` of the R2 sequence, shifted by a random amount that `seed` decides (Cranley-Patterson rotation).
// Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences": powers of 1 / plastic number; in integers,
// so that no precision is lost however far the sequence goes.
vec2 sample_2d(uint index, uint seed)
{
    uint a = hash(seed);
    uvec2 point = uvec2(a, hash(a)) + index * uvec2(3242174889u, 2447445414u);
    return vec2(unit_float(point.x), unit_float(point.y));
}

// Cosine-distributed direction around unit n: pdf = cos / pi.
vec3 sample_cosine(vec3 n, vec2 u)
{
    vec3 t, b;
    basis(n, t, b);
    float r = sqrt(u.x);
    float phi = 2.0 * PI * u.y;
    return normalize(t * (r * cos(phi)) + b * (r * sin(phi)) + n * sqrt(max(0.0, 1.0 - u.x)));
}

// Uniform point of the unit disk.
vec2 sample_disk(vec2 u)
{
    float r = sqrt(u.x);
    float phi = 2.0 * PI * u.y;
    return vec2(r * cos(phi), r * sin(phi));
}

// Weight of a sample of one way to find light, by how many samples for each steradian it and the other way send there.
// Veach and Guibas 1995, "Optimally Combining Sampling Techniques": the power heuristic.
float mis_weight(float own, float other)
{
    float ratio = other / max(own, 1e-30);
    return 1.0 / (1.0 + ratio * ratio);
}

// Visible normal of the GGX distribution, in the frame where the surface's normal is z.
// Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps".
vec3 sample_visible_normal(vec3 view, float alpha, vec2 u)
{
    vec3 stretched = normalize(vec3(alpha * view.xy, view.z));
    float phi = 2.0 * PI * u.x;
    float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    float s = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 cap = vec3(s * cos(phi), s * sin(phi), z) + stretched;
    return normalize(vec3(alpha * cap.xy, max(1e-6, cap.z)));
}
