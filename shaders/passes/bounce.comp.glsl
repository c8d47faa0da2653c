// SPDX-License-Identifier: GPL-3.0-or-later
// One bounce between voxel faces: L <- direct + reflectance * (mean of L over the links + sky).
// Jacobi iteration; it converges, as reflectance is at most 1 and what leaves the scene is lost.
// Input: faces, links, sky_tex, face_radiance_tex.    Output: radiance_img, W/(m2 sr).

#include "lib/common.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_FACE_RADIANCE) uniform sampler2D face_radiance_tex;
layout(std430, binding = BUF_FACES) readonly buffer Faces { Face faces[]; };
layout(std430, binding = BUF_LINKS) readonly buffer Links { uint links[]; };
layout(binding = IMG_0, rgba32f) writeonly uniform image2D radiance_img;
#if HAS_WORLD
layout(binding = TEX_WORLD) uniform sampler2D sky_tex;
#endif

uniform uint face_count;
uniform uint link_count;

void main()
{
    uint index = invocation_index();
    if (index >= face_count) {
        return;
    }
    vec3 sum = vec3(0.0);
    for (uint k = 0u; k < link_count; ++k) {
        uint link = links[index * link_count + k];
        if (link != NONE_INDEX) {
            sum += texelFetch(face_radiance_tex, list_texel(link), 0).rgb;
        }
    }
    vec3 incoming = sum / float(link_count);
#if HAS_WORLD
    incoming += texelFetch(sky_tex, list_texel(index), 0).rgb;
#endif
    vec3 radiance = faces[index].direct + faces[index].reflectance * incoming;
    imageStore(radiance_img, list_texel(index), vec4(finite_or_zero(radiance), 0.0));
}
