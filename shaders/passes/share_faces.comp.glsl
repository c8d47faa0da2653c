// SPDX-License-Identifier: GPL-3.0-or-later
// Indirect light that voxel faces receive, shared with the faces next to them, and what they make of it. A few links for each
// face are noise, and the noise of faces stays in the picture however many passes it gets. Light that comes from far is
// nearly the same a cell further on.
// Two faces give each other the same share of the difference, so that their sum stays what it is.
// Input: faces, cells, with whom each shares (pass partners), face_radiance_tex: indirect light, and injected light.
// Output: radiance_img, W/(m2 sr).

#include "lib/neighbour.glsl"

layout(local_size_x = GROUP_SIZE) in;

#if HAS_INJECTED
layout(binding = TEX_FACE_IRRADIANCE) uniform usampler2D face_irradiance_tex;
#endif
layout(binding = TEX_PARTNERS) uniform usampler2D partners_tex;
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D radiance_img;

uniform uint face_count;

void main()
{
    uint face = invocation_index();
    if (face >= face_count) {
        return;
    }
    Surroundings around = surroundings(face);
    uint partners = texelFetch(partners_tex, list_texel(face), 0).r;
    vec3 own = face_radiance(face);
    vec3 incoming = own;
    int k = 0;
    do {
        uint code = partners >> 4 * k & 15u, bit = max(code, 1u) - 1u;
        uvec4 record = record_of(cell_at(place_beside(around, neighbour_step(k))));
        bool is_there = code != 0u && (record.w >> bit & 1u) != 0u;
        uint other = is_there ? face_index(record, bit) : face;
        incoming += (k < 4 ? 2.0 : 1.0) / 16.0 * (face_radiance(other) - own);
    } while (++k < 8);
#if HAS_INJECTED
    incoming += unpack_light(texelFetch(face_irradiance_tex, list_texel(face), 0).rg);
#endif
    imageStore(radiance_img, list_texel(face), pack_light(fetch_face_reflectance(face).rgb * incoming));
}
