// SPDX-License-Identifier: GPL-3.0-or-later
// Indirect light that voxel faces receive, shared with the faces next to them, and what they make of it. A few links for each
// face are noise, and the noise of faces stays in the picture however many passes it gets. Light that comes from far is
// nearly the same a cell further on.
// Two faces give each other the same share of the difference, so that their sum stays what it is (nearly, on slopes, where
// a face may be nobody's neighbour); nothing where one is turned away or hidden from the other.
// Input: faces, cells, face_radiance_tex: indirect light, and injected light.
// Output: radiance_img, W/(m2 sr).

#include "lib/neighbour.glsl"

layout(local_size_x = GROUP_SIZE) in;

#if HAS_INJECTED
layout(binding = TEX_FACE_IRRADIANCE) uniform usampler2D face_irradiance_tex;
#endif
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D radiance_img;

uniform uint face_count;

const float ALIKE = 0.95;       // cosine between normals of faces that share
const float OFF_PLANE = 0.25;   // how far off the tangent plane the other's place may lie, against how far away it is

bool is_alike(Surroundings around, FoundFace here, uint face)
{
    vec3 there;
    vec3 normal_there;
    fetch_face_place(face, there, normal_there);
    vec3 apart = there - around.position;
    bool is_beyond = lies_beyond(here.record, here.cell, there, normal_there);
    bool is_parted = is_aslant(here.record) && is_beyond != (here.bit >= 6u);
    return !is_parted && dot(around.normal, normal_there) > ALIKE &&
           abs(dot(apart, around.normal)) < OFF_PLANE * length(apart);
}

void main()
{
    uint face = invocation_index();
    if (face >= face_count) {
        return;
    }
    Surroundings around = surroundings(face);
    FoundFace here = find_face(cell_at(around.position), around.normal, around.position, true);
    vec3 own = face_radiance(face);
    vec3 incoming = own;
    for (int k = 0; k < 8; ++k) {
        ivec2 at = neighbour_step(k);
        FoundFace beside = face_beside(around, at);
        uint other = face_number(beside);
        bool shares = other != NONE_INDEX && !is_hidden(here, beside) && is_alike(around, here, other);
        float weight = (k < 4 ? 2.0 : 1.0) / 16.0;
        incoming += shares ? weight * (face_radiance(other) - own) : vec3(0.0);
    }
#if HAS_INJECTED
    incoming += unpack_light(texelFetch(face_irradiance_tex, list_texel(face), 0).rg);
#endif
    imageStore(radiance_img, list_texel(face), pack_light(fetch_face_reflectance(face).rgb * incoming));
}
