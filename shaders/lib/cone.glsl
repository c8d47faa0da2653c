// SPDX-License-Identifier: GPL-3.0-or-later
// Cones through prefiltered voxels: six facings of area opacity and premultiplied radiance, with coarser levels.
// Crassin et al. 2011, "Interactive Indirect Illumination Using Voxel Cone Tracing". Differs: opacity is area and is
// added up, not composited by "over", so that it does not depend on the length of steps; coarser levels conserve it.

#include "lib/common.glsl"

layout(binding = TEX_CONES) uniform sampler3D cones_tex;

uniform ivec3 cone_size;       // cells of the finest level, one facing
uniform int cone_stride;       // cells from one facing to the next, in z
uniform float cone_cell;       // side of a cell of the finest level, in cells of the grid
uniform int cone_levels;

struct Cone {
    vec3 origin;         // grid space, on the receiver
    vec3 direction;      // unit
    vec3 normal;         // geometric normal of the receiver
    float tan_half;      // tangent of half the opening angle
    float limit;         // cells
};

// A wall seen at any angle adds up to opacity 1 when trilinear filters overlap; the gain makes up for steps that fall
// between them (measured: walls of one cell, half-angles to 30 degrees).
const float CONE_GAIN = 1.25;

// Cells are no larger than this share of their height above the receiver, however wide the cone is: larger ones hold the
// receiver's own back, and what lies behind it.
const float CONE_CLEARANCE = 1.0 / 3.0;

// (radiance, transmittance) of a cone.
vec4 trace_cone(Cone cone)
{
    float t = 0.5 * cone_cell;
    vec3 start = cone.origin + cone.normal * cone_cell;
    vec3 radiance = vec3(0.0);
    float transmittance = 1.0;
    vec3 scale = 1.0 / (cone_cell * vec3(cone_size.xy, textureSize(cones_tex, 0).z));
    vec3 box = vec3(cone_size) * cone_cell;
    float deepest = float(cone_levels - 1);
    for (int i = 0; i < 256 && t < cone.limit && transmittance > 0.002; ++i) {
        vec3 p = start + cone.direction * t;
        float height = dot(p - cone.origin, cone.normal);
        float width = max(cone_cell, min(2.0 * t * cone.tan_half, CONE_CLEARANCE * height));
        float level = min(log2(width / cone_cell), deepest);
        float side = cone_cell * exp2(level);
        if (any(lessThan(p, vec3(-0.5 * side))) || any(greaterThan(p, box + 0.5 * side))) {
            break;
        }
        vec4 q = vec4(0.0);
        for (int axis = 0; axis < 3; ++axis) {
            // The facing that looks against the cone.
            bool negative = cone.direction[axis] > 0.0;
            vec3 at = clamp(p, vec3(0.0), box);
            at.z += float((2 * axis + (negative ? 1 : 0)) * cone_stride) * cone_cell;
            q += abs(cone.direction[axis]) * textureLod(cones_tex, at * scale, level);
        }
        q *= CONE_GAIN;
        float f = q.a > 0.0 ? min(1.0, transmittance / q.a) : 0.0;
        radiance += f * q.rgb;
        transmittance -= f * q.a;
        t += side;
    }
    return vec4(radiance, max(transmittance, 0.0));
}

// Share of a light that a cone around its direction leaves free.
float cone_visibility(vec3 position, vec3 normal, vec3 direction, float tan_half, float limit)
{
    return trace_cone(Cone(position, direction, normal, tan_half, limit)).a;
}

// Cone `index` of the six of 60 degrees that cover the hemisphere, and its share of the cosine integral.
vec4 hemisphere_cone(vec3 normal, int index)
{
    if (index == 0) {
        return vec4(normal, 0.25);
    }
    vec3 t, b;
    basis(normal, t, b);
    float phi = 2.0 * PI * float(index - 1) / 5.0;
    return vec4(0.5 * normal + 0.8660254 * (cos(phi) * t + sin(phi) * b), 0.15);
}
