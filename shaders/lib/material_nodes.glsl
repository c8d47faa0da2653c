// SPDX-License-Identifier: GPL-3.0-or-later
// Functions that generated materials call. Safe versions of arithmetic give a number where mathematics gives none, as
// Blender's nodes do; their twins in Python are in addon/materials/operations.py.

#ifndef MATERIAL_NODES_GLSL
#define MATERIAL_NODES_GLSL

float safe_divide(float a, float b) {
    return b != 0.0 ? a / b : 0.0;
}

float safe_pow(float a, float b) {
    if (b == 0.0) return 1.0;
    if (a == 0.0) return 0.0;
    if (a > 0.0) return pow(a, b);
    if (b != trunc(b)) return 0.0;
    float odd = abs(b) - 2.0 * floor(abs(b) * 0.5);
    return odd == 0.0 ? pow(-a, b) : -pow(-a, b);
}

float safe_log(float a) {
    return a > 0.0 ? log(a) : 0.0;
}

// Remainder with the sign of a, as C's fmod.
float safe_fmod(float a, float b) {
    return b != 0.0 ? a - b * trunc(a / b) : 0.0;
}

float safe_atan2(float y, float x) {
    return x == 0.0 && y == 0.0 ? 0.0 : atan(y, x);
}

vec3 safe_normalize(vec3 v) {
    float squared = dot(v, v);
    return squared > 0.0 ? v * inversesqrt(squared) : vec3(0.0);
}

// How far f is between two stops of a colour ramp, 0 to 1; stops at one place make a step.
float ramp_step(float low, float high, float f) {
    return high > low ? clamp((f - low) / (high - low), 0.0, 1.0) : float(f >= high);
}

bool is_finite(float x) {
    return !isnan(x) && !isinf(x);
}

// x from 0 to `high`; 0 where it is not a number.
float valid(float x, float high) {
    return is_finite(x) ? clamp(x, 0.0, high) : 0.0;
}

vec3 valid(vec3 v, float high) {
    return vec3(valid(v.x, high), valid(v.y, high), valid(v.z, high));
}

// n as a unit vector; the fallback where it has no direction.
vec3 valid_normal(vec3 n, vec3 fallback) {
    float squared = dot(n, n);
    return is_finite(squared) && squared > 1e-20 ? n * inversesqrt(squared) : fallback;
}

// World-space normal of a tangent-space one (x along u, y along v, z out). `normal` is on the viewer's side, the tangents
// belong to the front. A degenerate UV map (no tangent) leaves the normal alone.
vec3 normal_from_tangent_space(vec3 bend, vec3 normal, vec3 tangent, vec3 bitangent, float back_facing) {
    float side = 1.0 - 2.0 * back_facing;
    vec3 front = normal * side;
    vec3 t = tangent - front * dot(front, tangent);
    float squared = dot(t, t);
    if (!(squared > 1e-12)) return normal;
    t *= inversesqrt(squared);
    vec3 b = cross(front, t);
    b *= dot(b, bitangent) < 0.0 ? -1.0 : 1.0;
    return safe_normalize(bend.x * t + bend.y * b + bend.z * front) * side;
}

// Texel at uv, averaged over a square of side `footprint` in UV units. Compute shaders have no derivatives: the level is
// chosen here.
vec4 sample_image(sampler2D image, vec2 uv, float footprint) {
    vec2 size = vec2(textureSize(image, 0));
    float level = log2(max(footprint * max(size.x, size.y), 1.0));
    return textureLod(image, uv, level);
}

// As sample_image, transparent black outside the image.
vec4 sample_image_clipped(sampler2D image, vec2 uv, float footprint) {
    bool inside = all(greaterThanEqual(uv, vec2(0.0))) && all(lessThanEqual(uv, vec2(1.0)));
    return inside ? sample_image(image, uv, footprint) : vec4(0.0);
}

// Colour of a texel that holds colour times alpha.
vec4 divided_by_alpha(vec4 texel) {
    return texel.a > 0.0 ? vec4(texel.rgb / texel.a, texel.a) : texel;
}

// Every other repetition of the image runs backwards.
vec2 mirrored(vec2 uv) {
    return 1.0 - abs(1.0 - mod(uv, 2.0));
}

// Tile of a UDIM set that uv is in: column + 10 row; -1 outside the ten columns.
float udim_tile(vec2 uv) {
    vec2 tile = floor(uv);
    return tile.x >= 0.0 && tile.x < 10.0 && tile.y >= 0.0 ? tile.x + 10.0 * tile.y : -1.0;
}

#endif
