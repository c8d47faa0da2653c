// SPDX-License-Identifier: GPL-3.0-or-later
// Which of the faces beside it does a face share light with? Geometry alone decides.
// FINDS_CHANGED: after an edit; nothing is traced. Faces far from it get what they had, and the others are listed.
// IS_PART: listed faces.
// Input: faces, triangles of cells.    Output: neighbours_img: a bit for each (lib/neighbour.glsl).

#include "lib/neighbour.glsl"
#if FINDS_CHANGED
#include "lib/changed_faces.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

#if FINDS_CHANGED
layout(binding = TEX_NEIGHBOURS) uniform usampler2D neighbours_before_tex;
#elif IS_PART
layout(binding = TEX_FACE_ORDER) uniform usampler2D listed_tex;
#endif
layout(binding = IMG_0, r8ui) writeonly uniform uimage2D neighbours_img;

uniform uint face_first;  // of this dispatch
uniform uint face_count;  // of all, or of those listed

#if FINDS_CHANGED
const float FARTHEST = 4.0;  // cells that are looked up, and the ray to there: two cells away at most, and the cell itself

void main()
{
    uint face = face_first + invocation_index();
    if (face >= face_count) {
        return;
    }
    vec3 position, normal;
    fetch_face_place(face, position, normal);
    uint before = number_before(face);
    if (before == NONE_INDEX || crosses_box(position, normal, 0.0, FARTHEST)) {
        list_changed(face);
    } else {
        imageStore(neighbours_img, list_texel(face), texelFetch(neighbours_before_tex, list_texel(before), 0));
    }
}
#else
void main()
{
    uint face = face_first + invocation_index();
    if (face >= face_count) {
        return;
    }
#if IS_PART
    face = texelFetch(listed_tex, list_texel(face), 0).r;
#endif
    Surroundings around = surroundings(face);
    uint seed = face_seed(face);
    uint sharing = 0u;
    for (int k = 0; k < 8; ++k) {
        uint other = face_beside(around, k);
        sharing |= other != NONE_INDEX && shares_light(around, other, seed) ? 1u << k : 0u;
    }
    imageStore(neighbours_img, list_texel(face), uvec4(sharing));
}
#endif
