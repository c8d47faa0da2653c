// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that leaves voxel faces, looked up where a ray has met a surface.

#include "lib/trace.glsl"
#include "lib/packed_light.glsl"

layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;

struct FoundFace {
    ivec3 cell;
    uvec4 record;  // of the cell; 0 where nothing is
    uint bit;      // NONE_INDEX: there is no such face
};

// The face of a cell for a surface with normal n: the one that looks most along n; none when none does within 60
// degrees. (A normal is within 55 degrees of the axis it is nearest to.) In a cell that is cut, one on the side where
// `position` is, which may lie outside the cell; one on the other side only if `any_side`.
FoundFace find_face(ivec3 cell, vec3 n, vec3 position, bool any_side)
{
    uint index = cell_index(cell);
    uvec4 record = texelFetch(cells_tex, list_texel(index == NONE_INDEX ? 0u : index), 0);
    record = index == NONE_INDEX ? uvec4(0u) : record;
    uint facings = record.w | record.w >> 6;
    uint facing = NONE_INDEX;
    float best = 0.5;
    for (uint other = 0u; other < 6u; ++other) {
        float along = dot(facing_vector(other), n);
        bool better = (facings >> other & 1u) != 0u && along > best;
        facing = better ? other : facing;
        best = better ? along : best;
    }
    int axis = cut_axis(record);
    vec3 inside = place_in_cell(position, cell);
    float along = axis == 0 ? inside.x : (axis == 1 ? inside.y : inside.z);
    uint beyond = axis >= 0 && along > cut_place(record) ? 6u : 0u;
    uint bit = facing + beyond;
    if (facing != NONE_INDEX && (record.w >> bit & 1u) == 0u) {
        bit = any_side ? facing + 6u - beyond : NONE_INDEX;
    }
    return FoundFace(cell, record, facing == NONE_INDEX ? NONE_INDEX : bit);
}

uint face_number(FoundFace found)
{
    return found.bit == NONE_INDEX ? NONE_INDEX : face_index(found.record, found.bit);
}

// Whether something stands, or may stand, between faces of two cells that are the same or beside each other. Cells of
// another level are not asked about.
bool is_hidden(FoundFace a, FoundFace b)
{
    ivec3 apart = b.cell - a.cell;
    uint hidden = (hidden_cells(a.record, a.bit) & bits_towards(apart)) | (hidden_cells(b.record, b.bit) & bits_towards(-apart));
    return hidden != 0u || level_of_cell(a.cell) != level_of_cell(b.cell);
}

// The voxel face that stands for the surface at a hit. Looking it up at a point moved by up to half a cell along the
// surface gives, on average, the linear interpolation between neighbouring faces. What is on the other side of a wall is
// no neighbour.
uint face_at_hit(vec3 position, Hit hit, uint seed)
{
    vec3 random = unit_vec3(seed);
    vec3 shift = (random - 0.5) * cell_side(position);
    vec3 moved = position + shift - hit.normal * dot(shift, hit.normal);
    FoundFace beside = find_face(cell_at(moved), hit.normal, position, false);
    ivec3 cell = cell_at(position);
    FoundFace own = find_face(cell_index(cell) == NONE_INDEX ? hit.cell : cell, hit.normal, position, true);
    bool is_seen = beside.bit != NONE_INDEX && (own.bit == NONE_INDEX || !is_hidden(own, beside));
    return face_number(is_seen ? beside : own);
}

vec3 face_radiance(uint face)
{
    return face == NONE_INDEX ? vec3(0.0) : unpack_light(texelFetch(face_radiance_tex, list_texel(face), 0).rg);
}
