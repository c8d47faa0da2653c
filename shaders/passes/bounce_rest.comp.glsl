// SPDX-License-Identifier: GPL-3.0-or-later
// What bounces that are not made would still add. Each brings about the same share of what the one before brought, so
// together they are a geometric series: L + rest * (L - L before), rest = share + share^2 + ...
// Input: face_radiance_tex, after the last bounce; radiance_img, before it.    Output: radiance_img, W/(m2 sr).
// Aitken 1926, "On Bernoulli's Numerical Solution of Algebraic Equations"; differs: one share for all faces.

#include "lib/packed_light.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;
layout(binding = IMG_0, rg32ui) uniform uimage2D radiance_img;

uniform uint face_count;
uniform float rest;

void main()
{
    uint face = invocation_index();
    if (face < face_count) {
        vec3 last = unpack_light(texelFetch(face_radiance_tex, list_texel(face), 0).rg);
        vec3 before = unpack_light(imageLoad(radiance_img, list_texel(face)).rg);
        imageStore(radiance_img, list_texel(face), pack_light(last + rest * (last - before)));
    }
}
