// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that voxel faces pass on; what they emit themselves is not in it. FIRST: of light straight from where it is
// made: injected, and brought by links from the world and from emitters. Otherwise one bounce more: L <- reflectance *
// (that light + mean of L over the links). Jacobi iteration; it converges, as reflectance is at most 1 and what leaves
// the scene is lost. LAST: what is shared between faces afterwards: that mean and what links bring, without what was
// injected and without reflectance.
// Input: faces, irradiance, links, straight_tex, radiance.    Output, W/(m2 sr): bounced; KEPT: radiance_img.

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
layout(std430, binding = BUF_RADIANCE) readonly buffer Radiance { uvec2 radiance[]; };
layout(binding = TEX_LINKS) uniform usampler2D links_tex;
uniform uint link_count;
#endif
#if KEPT
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D radiance_img;
#else
layout(std430, binding = BUF_RESULTS) writeonly buffer Bounced { uvec2 bounced[]; };
#endif

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
    uint q = 0u;
    do {
        uvec4 links = texelFetch(links_tex, list_texel(face * quads + q), 0);
        for (int k = 0; k < 4; ++k) {
            uint linked = links[k] & LINK_FACE_MASK;
            vec3 light = unpack_light(radiance[min(linked, face_count - 1u)]);
            sum += linked == LINK_FACE_MASK ? vec3(0.0) : light;
        }
    } while (++q < quads);
    incoming += sum / float(link_count);
#endif
#if !LAST
    incoming *= fetch_face_reflectance(face).rgb;
#endif
#if KEPT
    imageStore(radiance_img, list_texel(face), pack_light(incoming));
#else
    bounced[face] = pack_light(incoming).xy;
#endif
}
