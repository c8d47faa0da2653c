// SPDX-License-Identifier: GPL-3.0-or-later
// Directions of the world's picture, drawn by the light that comes from them: Pharr, Jakob and Humphreys, "Physically
// Based Rendering", on infinite area lights. Differs: texels are chosen by whole numbers, and within one all directions
// are alike, so that the density is exactly that of what is drawn.

#include "lib/world_weight.glsl"

// Running sums of chances along each row of the picture; last column: of whole rows. In EMITTER_UNITS.
layout(binding = TEX_WORLD_TABLE) uniform sampler2D world_table_tex;

struct WorldSample {
    vec3 direction;  // unit
    vec3 radiance;   // W/(m2 sr)
    float density;   // directions for each steradian
};

// The first of `count` texels from `first` on, `step` apart, whose sum is above the target. `within`: where in it.
int search_world_table(ivec2 first, ivec2 step, int count, float u, uint seed, out float within)
{
    float target = floor(u * EMITTER_UNITS);
    float start = 0.0, end = EMITTER_UNITS;
    int lo = 0, hi = count - 1;
    while (lo < hi) {
        int middle = (lo + hi) / 2;
        float sum = texelFetch(world_table_tex, first + middle * step, 0).r;
        bool above = sum > target;
        hi = above ? middle : hi;
        end = above ? sum : end;
        lo = above ? lo : middle + 1;
        start = above ? start : sum;
    }
    within = (target - start + unit_float(hash(seed))) / max(end - start, 1.0);
    return lo;
}

// The direction that u chooses. `seed`: digits that u lacks.
WorldSample sample_world(vec2 u, uint seed)
{
    ivec2 size = textureSize(world_tex, 0);
    vec2 within;
    ivec2 texel;
    texel.y = search_world_table(ivec2(size.x, 0), ivec2(0, 1), size.y, u.y, seed, within.y);
    texel.x = search_world_table(ivec2(0, texel.y), ivec2(1, 0), size.x, u.x, seed + 1u, within.x);
    // Evenly over the texel's solid angle: in height above the horizon, and around.
    vec2 rows = -cos(vec2(texel.y, texel.y + 1) * (PI / float(size.y)));
    float z = mix(rows.x, rows.y, within.y);
    float phi = (0.5 - (float(texel.x) + within.x) / float(size.x)) * 2.0 * PI;
    WorldSample s;
    s.direction = vec3(sqrt(max(0.0, 1.0 - z * z)) * vec2(cos(phi), sin(phi)), z);
    s.radiance = world_along(s.direction);
    s.density = texelFetch(world_tex, texel, 0).a;  // of this texel, wherever rounding puts the direction
    return s;
}
