// SPDX-License-Identifier: GPL-3.0-or-later
// What the light of each face counts for guides, once for all links that lead to it.
// Input: faces' radiance.    Output: light_img.

#include "lib/guide_light.glsl"
#include "lib/packed_light.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;
layout(binding = IMG_0, r32f) writeonly uniform image2D light_img;

uniform uint face_count;

void main()
{
    uint face = invocation_index();
    if (face >= face_count) {
        return;
    }
    vec3 radiance = unpack_light(texelFetch(face_radiance_tex, list_texel(face), 0).rg);
    imageStore(light_img, list_texel(face), vec4(guide_light(radiance)));
}
