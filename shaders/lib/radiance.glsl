// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that leaves voxel faces, looked up where a ray has met a surface.

#include "lib/trace.glsl"
#include "lib/cut.glsl"
#include "lib/packed_light.glsl"

layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;

struct FoundFace {
    ivec3 cell;
    uvec4 record;  // of the cell; 0 where nothing is
    uint bit;      // NONE_INDEX: there is no such face
};

// 0 where nothing is.
uvec4 record_of(ivec3 cell)
{
    uint index = cell_index(cell);
    uvec4 record = fetch_source(cells_tex, list_texel(index == NONE_INDEX ? 0u : index));
    return index == NONE_INDEX ? uvec4(0u) : record;
}

// The face of a cell for a surface with normal n: the one that looks most along n; none when none does within 60
// degrees. (A normal is within 55 degrees of the axis it is nearest to.) In a cell that is cut, one on that side.
// `any_side`: one on the other side, or in another corner, if there is none.
FoundFace find_face_of(uvec4 record, ivec3 cell, vec3 n, bool is_beyond, bool strays, bool any_side)
{
    uint facings = record.w | record.w >> 6;
    uint facing = NONE_INDEX;
    float best = 0.5;
    for (uint other = 0u; other < 6u; ++other) {
        float along = dot(facing_vector(other), n);
        bool better = (facings >> other & 1u) != 0u && along > best;
        facing = better ? other : facing;
        best = better ? along : best;
    }
    uint beyond = is_beyond ? 6u : 0u;
    uint bit = facing + beyond;
    if (facing != NONE_INDEX && (strays || (record.w >> bit & 1u) == 0u)) {
        bool is_there = (record.w >> bit & 1u) != 0u;
        bit = any_side ? (is_there ? bit : facing + 6u - beyond) : NONE_INDEX;
    }
    return FoundFace(cell, record, facing == NONE_INDEX ? NONE_INDEX : bit);
}

// On the side where `position` is, which may lie outside the cell.
FoundFace find_face(ivec3 cell, vec3 n, vec3 position, bool any_side)
{
    uvec4 record = record_of(cell);
    Sides sides = sides_of(record, cell, position, position, n);
    return find_face_of(record, cell, n, sides.beyond.x, sides.strays.x, any_side);
}

uint face_number(FoundFace found)
{
    return found.bit == NONE_INDEX ? NONE_INDEX : face_index(found.record, found.bit);
}

// Whether something stands, or may stand, between faces of two cells. Only cells that are the same or beside each other, of
// one level, have been asked about.
bool is_hidden(FoundFace a, FoundFace b)
{
    ivec3 apart = b.cell - a.cell;
    uint hidden = (hidden_cells(a.record, a.bit) & bits_towards(apart)) | (hidden_cells(b.record, b.bit) & bits_towards(-apart));
    return hidden != 0u || any(greaterThan(abs(apart), ivec3(1))) || level_of_cell(a.cell) != level_of_cell(b.cell);
}

// The voxel face that stands for the surface at a hit. Looking it up at a point moved by up to half a cell along the
// surface gives, on average, the linear interpolation between neighbouring faces. What is on the other side of a wall, or
// stands for another facing, is no neighbour. Where a surface has no face of its own on its side of a wall, as there is so
// little of it, or in its corner of the cell, it goes on away from the wall.
uint face_at_hit(vec3 position, Hit hit, uint seed)
{
    vec3 random = unit_vec3(seed);
    vec3 shift = (random - 0.5) * cell_side(position);
    shift -= hit.normal * dot(shift, hit.normal);
    ivec3 cell = cell_at(position);
    cell = cell_index(cell) == NONE_INDEX ? hit.cell : cell;
    uvec4 record = record_of(cell);
    Sides sides = sides_of(record, cell, position, position + shift, hit.normal);
    FoundFace own = find_face_of(record, cell, hit.normal, sides.beyond.x, sides.strays.x, true);
    bool is_lost = is_aslant(record) && own.bit != NONE_INDEX && (sides.strays.x || own.bit >= 6u != sides.beyond.x);
    bool is_parted = sides.beyond.x != sides.beyond.y || sides.strays.x != sides.strays.y;
    vec3 way = is_lost ? (0.5 + 0.5 * random.x) * sides.away : shift;
    FoundFace beside = find_face(cell_at(position + way), hit.normal, position, false);
    is_parted = facing_of_bit(beside.bit) != facing_of_bit(own.bit) || (!is_lost && (is_parted || is_hidden(own, beside)));
    bool is_seen = beside.bit != NONE_INDEX && (own.bit == NONE_INDEX || !is_parted);
    return face_number(is_seen ? beside : own);
}

vec3 face_radiance(uint face)
{
    return face == NONE_INDEX ? vec3(0.0) : unpack_light(texelFetch(face_radiance_tex, list_texel(face), 0).rg);
}
