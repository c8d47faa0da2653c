// SPDX-License-Identifier: GPL-3.0-or-later
// Indirect light that voxel faces receive, shared with the faces next to them, and what they make of it. A few links for each
// face are noise, and the noise of faces stays in the picture however many passes it gets. Light that comes from far is
// nearly the same a cell further on.
// Two faces give each other the same share of the difference, so that their sum stays what it is (nearly, on slopes, where
// a face may be nobody's neighbour); nothing where one is turned away or hidden from the other.
// HAS_NEIGHBOURS: pass neighbours has found which share.
// Input: faces, triangles of cells, face_radiance_tex: indirect light, and injected light.
// Output: radiance_img, W/(m2 sr).

#include "lib/neighbour.glsl"

layout(local_size_x = GROUP_SIZE) in;

#if HAS_INJECTED
layout(binding = TEX_FACE_IRRADIANCE) uniform usampler2D face_irradiance_tex;
#endif
#if HAS_NEIGHBOURS
layout(binding = TEX_NEIGHBOURS) uniform usampler2D neighbours_tex;
#endif
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D radiance_img;

uniform uint face_first;  // of this dispatch
uniform uint face_count;  // of all

void main()
{
    uint face = face_first + invocation_index();
    if (face >= face_count) {
        return;
    }
    Surroundings around = surroundings(face);
#if HAS_NEIGHBOURS
    uint sharing = texelFetch(neighbours_tex, list_texel(face), 0).r;
#else
    uint seed = face_seed(face);
#endif
    vec3 own = face_radiance(face);
    vec3 incoming = own;
    for (int k = 0; k < 8; ++k) {
        uint other = face_beside(around, k);
#if HAS_NEIGHBOURS
        bool shares = (sharing >> k & 1u) != 0u;
#else
        bool shares = other != NONE_INDEX && shares_light(around, other, seed);
#endif
        ivec2 at = neighbour_step(k);
        float weight = (at.x == 0 || at.y == 0 ? 2.0 : 1.0) / 16.0;
        incoming += shares ? weight * (face_radiance(other) - own) : vec3(0.0);
    }
#if HAS_INJECTED
    incoming += unpack_light(texelFetch(face_irradiance_tex, list_texel(face), 0).rg);
#endif
    imageStore(radiance_img, list_texel(face), pack_light(fetch_face_reflectance(face).rgb * incoming));
}
