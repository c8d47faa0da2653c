// SPDX-License-Identifier: GPL-3.0-or-later
// One bounce between voxel faces: L <- direct + reflectance * (mean of L over the links + sky).
// Jacobi iteration; it converges, as reflectance is at most 1 and what leaves the scene is lost.
// Input: faces, links, sky_tex, face_radiance_tex.    Output: radiance_img, W/(m2 sr).

#include "lib/face.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_FACE_RADIANCE) uniform sampler2D face_radiance_tex;
layout(binding = TEX_FACE_DIRECT) uniform sampler2D face_direct_tex;
layout(binding = TEX_LINKS) uniform usampler2D links_tex;
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
    uint quads = link_count / 4u;
    for (uint q = 0u; q < quads; ++q) {
        uvec4 links = texelFetch(links_tex, list_texel(index * quads + q), 0);
        for (int k = 0; k < 4; ++k) {
            vec3 radiance = texelFetch(face_radiance_tex, list_texel(min(links[k], face_count - 1u)), 0).rgb;
            sum += links[k] == NONE_INDEX ? vec3(0.0) : radiance;
        }
    }
    vec3 incoming = sum / float(link_count);
#if HAS_WORLD
    incoming += texelFetch(sky_tex, list_texel(index), 0).rgb;
#endif
    vec3 radiance = texelFetch(face_direct_tex, list_texel(index), 0).rgb +
                    fetch_face_reflectance(index).rgb * incoming;
    imageStore(radiance_img, list_texel(index), vec4(finite_or_zero(radiance), 0.0));
}
