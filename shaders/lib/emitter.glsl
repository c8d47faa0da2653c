// SPDX-License-Identifier: GPL-3.0-or-later
// Emitters: triangles that glow, or equal parts of one where its emission varies, each with one radiance on either side.
// Two ways to find their light: points on them, drawn by power, and rays that happen to meet them. Both are weighed
// against each other (multiple importance sampling, Veach and Guibas 1995), so that neither a small emitter nor a near
// one is noise.
//
// The including program sets emitter_samples: points that are drawn on emitters where rays look for them too (0: none).

#include "lib/triangle.glsl"
#include "lib/sampling.glsl"
#include "lib/emitter_part.glsl"

layout(binding = TEX_EMITTERS) uniform usampler2D emitters_tex;
// For each triangle from emitter_first_triangle on: its first emitter << 6 | (parts of an edge - 1), or NONE_INDEX.
layout(binding = TEX_EMITTER_LOOKUP) uniform usampler2D emitter_lookup_tex;

uniform uint emitter_count;
uniform uint emitter_first_triangle;
uniform uint emitter_span;     // triangles in the lookup
uniform float emitter_samples;

struct EmitterSample {
    vec3 direction;  // unit, towards the emitter
    float distance;  // cells
    vec3 radiance;   // W/(m2 sr)
    float density;   // points for each steradian; 0: none that counts
    uint flags;      // RAY_* that see the emitter
};

// The point on emitters that u chooses, seen from `position`. `seed`: digits that u lacks.
EmitterSample sample_emitter(vec3 position, vec2 u, uint seed)
{
    float target = floor(u.x * EMITTER_UNITS);
    float start = 0.0;
    uint lo = 0u, hi = emitter_count - 1u;
    while (lo < hi) {  // the first one whose cumulative power is above the target
        uint middle = (lo + hi) / 2u;
        float cumulative = uintBitsToFloat(texelFetch(emitters_tex, list_texel(middle * EMITTER_TEXELS), 0).w);
        bool above = cumulative > target;
        hi = above ? middle : hi;
        lo = above ? lo : middle + 1u;
        start = above ? start : cumulative;
    }
    Emitter e = fetch_emitter(emitters_tex, lo);
    float x = (target - start + unit_float(hash(seed))) / max(e.cumulative - start, 1.0);
    float root = sqrt(x);
    vec3 to_emitter = e.corner_grid + e.edge_1 * (root * (1.0 - u.y)) + e.edge_2 * (root * u.y) - position;
    EmitterSample s;
    float squared = max(dot(to_emitter, to_emitter), 1e-12);
    s.distance = sqrt(squared);
    s.direction = to_emitter / s.distance;
    vec3 area = cross(e.edge_1, e.edge_2);
    float cosine = -dot(area, s.direction) / max(length(area), 1e-30);
    s.radiance = (cosine > 0.0 ? e.front : e.back) * e.opacity;
    s.density = abs(cosine) > 1e-6 ? e.density * squared / abs(cosine) : 0.0;
    s.flags = e.flags;
    return s;
}

// What a ray finds where it has met a triangle: its emission, weighed against points on emitters.
// `ray_density`: rays like this for each steradian.
vec3 emission_met(uint triangle, vec3 origin, vec3 direction, float distance, float ray_density)
{
    uint place = triangle - emitter_first_triangle;
    uint word = NONE_INDEX;
    if (place < emitter_span) {
        word = texelFetch(emitter_lookup_tex, list_texel(place), 0).r;
    }
    if (word == NONE_INDEX) {
        return vec3(0.0);
    }
    uint n = (word & 63u) + 1u;
    uint index = word >> 6;
    if (n > 1u) {
        vec2 barycentric;
        float unused;
        intersect_plane(fetch_triangle(triangle), origin, direction, barycentric, unused);
        index += emitter_part_at(barycentric, n);
    }
    Emitter e = fetch_emitter(emitters_tex, index);
    vec3 area = cross(e.edge_1, e.edge_2);
    float cosine = -dot(area, direction) / max(length(area), 1e-30);
    float density = e.density * distance * distance / max(abs(cosine), 1e-6);
    return (cosine > 0.0 ? e.front : e.back) * mis_weight(ray_density, emitter_samples * density);
}
