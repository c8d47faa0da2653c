// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that voxel faces pass on; what they emit themselves is not in it. FIRST: of light straight from where it is
// made: injected, and brought by links from the world and from emitters. Otherwise one bounce more: L <- reflectance *
// (that light + mean of L over the links). Jacobi iteration; it converges, as reflectance is at most 1 and what leaves
// the scene is lost. LAST: what is shared between faces afterwards: that mean and what links bring, without what was
// injected and without reflectance.
// Input: faces, irradiance, links, straight_tex, face_radiance_tex.    Output: radiance_img, W/(m2 sr).

#include "lib/face.glsl"
#include "lib/link.glsl"
#include "lib/packed_light.glsl"

layout(local_size_x = GROUP_SIZE) in;

#if HAS_INJECTED
layout(binding = TEX_FACE_IRRADIANCE) uniform usampler2D face_irradiance_tex;
#endif
#if HAS_STRAIGHT
layout(binding = TEX_FACE_STRAIGHT) uniform usampler2D straight_tex;
#endif
#if !FIRST
layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;
layout(binding = TEX_LINKS) uniform usampler2D links_tex;
uniform uint link_count;
#endif
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D radiance_img;

uniform uint face_count;

void main()
{
    uint face = invocation_index();
    if (face >= face_count) {
        return;
    }
    vec3 incoming = vec3(0.0);
#if HAS_INJECTED && !LAST
    incoming += unpack_light(texelFetch(face_irradiance_tex, list_texel(face), 0).rg);
#endif
#if HAS_STRAIGHT
    incoming += unpack_light(texelFetch(straight_tex, list_texel(face), 0).rg);
#endif
#if !FIRST
    vec3 sum = vec3(0.0);
    uint quads = link_count / 4u;
    for (uint q = 0u; q < quads; ++q) {
        uvec4 links = texelFetch(links_tex, list_texel(face * quads + q), 0);
        for (int k = 0; k < 4; ++k) {
            uint linked = links[k] & LINK_FACE_MASK;
            uvec2 stored = texelFetch(face_radiance_tex, list_texel(min(linked, face_count - 1u)), 0).rg;
            sum += linked == LINK_FACE_MASK ? vec3(0.0) : unpack_light(stored);
        }
    }
    incoming += sum / float(link_count);
#endif
#if !LAST
    incoming *= fetch_face_reflectance(face).rgb;
#endif
    imageStore(radiance_img, list_texel(face), pack_light(incoming));
}
