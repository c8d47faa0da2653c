// SPDX-License-Identifier: GPL-3.0-or-later
// Links: the face that a ray of a face has met, and from which bin of its facing's guide light came along it.

#include "lib/hemisphere.glsl"

const uint LINK_FACE_MASK = (1u << LINK_BIN_SHIFT) - 1u;  // for a ray that has met none, too

// `direction`: of the ray, grid space.
uint pack_link(uint face, uint facing, vec3 direction)
{
    vec3 local = facing_from_grid(facing, direction);
    ivec2 place = clamp(ivec2(square_from_hemisphere(local) * float(GUIDE_SIDE)), 0, GUIDE_SIDE - 1);
    uint bin = local.z > 0.0 ? uint(place.x + GUIDE_SIDE * place.y) : NO_BIN;
    return face & LINK_FACE_MASK | bin << LINK_BIN_SHIFT;
}

// NONE_INDEX where there is none.
uint linked_face(uint link)
{
    uint face = link & LINK_FACE_MASK;
    return face == LINK_FACE_MASK ? NONE_INDEX : face;
}

uint link_bin(uint link)
{
    return link >> LINK_BIN_SHIFT;
}
