// SPDX-License-Identifier: GPL-3.0-or-later
// Low-discrepancy points and the directions made of them.

#include "lib/common.glsl"

// Owen scrambling by hash: a bit of a coordinate, or of an index, is flipped or not by those more significant. `bits`:
// with the most significant one last. Laine and Karras 2011, "Stratified Sampling for Stochastic Transparency"; the
// constants are Vegdahl's (2021, "Building a Better LK Hash").
uint scrambled(uint bits, uint seed)
{
    bits ^= bits * 0x3D20ADEAu;
    bits = (bits + seed) * (seed >> 16 | 1u);
    bits ^= bits * 0x05526C56u;
    bits ^= bits * 0x53A22864u;
    return bits;
}

// A point of the Sobol sequence's first two dimensions, by its number with reversed bits: of 2^m in a row from a
// multiple of 2^m on, each of 2^m rectangles has one, whatever their shape. The second dimension in closed form.
uvec2 sobol_point(uint reversed_index)
{
    uint y = reversed_index;
    y ^= (y & 0x0000FFFFu) << 16;
    y ^= (y & 0x00FF00FFu) << 8;
    y ^= (y & 0x0F0F0F0Fu) << 4;
    y ^= (y & 0x33333333u) << 2;
    y ^= (y & 0x55555555u) << 1;
    return uvec2(reversed_index, y);
}

// Point `index` of the Sobol sequence, scrambled anew for each `seed`. Burley 2020, "Practical Hash-based Owen
// Scrambling". Places in pixels (addon/places.py) go with it.
vec2 sample_2d(uint index, uint seed)
{
    uint a = hash(seed);
    uvec2 bits = bitfieldReverse(sobol_point(bitfieldReverse(index)));
    uvec2 point = bitfieldReverse(uvec2(scrambled(bits.x, a), scrambled(bits.y, hash(a))));
    return vec2(unit_float(point.x), unit_float(point.y));
}

// Point `index` of the R2 sequence, shifted (Cranley-Patterson rotation), for directions over the hemisphere: with
// `pixel_shift`, neighbours share these evenly, as they share the light that is found.
// Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences": powers of 1 / plastic number; in integers,
// so that no precision is lost however far the sequence goes.
vec2 sample_2d(uint index, uvec2 shift)
{
    uvec2 point = shift + index * uvec2(3242174889u, 2447445414u);
    return vec2(unit_float(point.x), unit_float(point.y));
}

// Shifts that make neighbouring pixels share the unit square evenly: in each aligned block of 2^k x 2^k pixels they are a
// (0, 2k, 2)-net. The pixels' order along the Z curve, shuffled block by block, numbers points of the Sobol sequence.
// Ahmed and Wonka 2020, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of
// Pixels".
uvec2 pixel_shift(ivec2 pixel, uint seed)
{
    uvec2 v = uvec2(pixel) & 0xFFFFu;  // spread the bits: z-order number
    v = (v | v << 8) & 0x00FF00FFu;
    v = (v | v << 4) & 0x0F0F0F0Fu;
    v = (v | v << 2) & 0x33333333u;
    v = (v | v << 1) & 0x55555555u;
    // Scrambled from the highest bit down, and reversed: the radical inverse of the place in the shuffled order.
    uint place = scrambled(bitfieldReverse(v.x | v.y << 1), hash(seed));
    return sobol_point(place) ^ uvec2(hash(seed + 1u), hash(seed + 2u));
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
