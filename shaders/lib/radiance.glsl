// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that leaves voxel faces, looked up where a ray has met a surface.

#include "lib/trace.glsl"
#include "lib/packed_light.glsl"

layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;

// A face of occupied cell `index` for a surface with normal n: the one that looks most along n; NONE_INDEX when none
// does within 60 degrees. (A normal is within 55 degrees of the axis it is nearest to.) In a cell that is cut, one on
// the side where `position` is, which may lie outside the cell; one on the other side only if `any_side`.
uint find_face(uint index, ivec3 cell, vec3 n, vec3 position, bool any_side)
{
    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    uint facing = NONE_INDEX;
    float best = 0.5;
    uint facings = record.w | record.w >> 6;
    for (uint other = 0u; other < 6u; ++other) {
        float along = dot(facing_vector(other), n);
        bool better = (facings >> other & 1u) != 0u && along > best;
        facing = better ? other : facing;
        best = better ? along : best;
    }
    if (facing == NONE_INDEX) {
        return NONE_INDEX;
    }
    int axis = cut_axis(record);
    vec3 inside = place_in_cell(position, cell);
    float along = axis == 0 ? inside.x : (axis == 1 ? inside.y : inside.z);
    uint bit = axis >= 0 && along > cut_place(record) ? facing + 6u : facing;
    if ((record.w >> bit & 1u) == 0u) {
        if (!any_side) {
            return NONE_INDEX;
        }
        bit = bit < 6u ? bit + 6u : bit - 6u;
    }
    return face_index(record, bit);
}

// The voxel face that stands for the surface at a hit. Looking it up at a point moved by up to half a cell along the
// surface gives, on average, the linear interpolation between neighbouring faces. What is on the other side of a wall is
// no neighbour.
uint face_at_hit(vec3 position, Hit hit, uint seed)
{
    vec3 random = unit_vec3(seed);
    vec3 shift = (random - 0.5) * cell_side(position);
    vec3 moved = position + shift - hit.normal * dot(shift, hit.normal);
    ivec3 cell = cell_at(moved);
    uint index = cell_index(cell);
    uint face = index == NONE_INDEX ? NONE_INDEX : find_face(index, cell, hit.normal, position, false);
    if (face == NONE_INDEX) {
        cell = cell_at(position);
        index = cell_index(cell);
        if (index == NONE_INDEX) {
            cell = hit.cell;
            index = cell_index(cell);
        }
        face = index == NONE_INDEX ? NONE_INDEX : find_face(index, cell, hit.normal, position, true);
    }
    return face;
}

vec3 face_radiance(uint face)
{
    return face == NONE_INDEX ? vec3(0.0) : unpack_light(texelFetch(face_radiance_tex, list_texel(face), 0).rg);
}
