// SPDX-License-Identifier: GPL-3.0-or-later
// Which cells beside it are hidden from the faces of a cell? Light of faces is interpolated and shared along surfaces, and
// shall not pass through a wall that ends on them.
// Input: faces, triangles of cells, cells with their positions, work on pairs of faces.    Output: for each cell a bit for
// each direction, and six more for what lies beyond the plane that cuts the cell (lib/grid.glsl).

#include "lib/neighbour.glsl"
#include "lib/part.glsl"
#include "lib/face_work.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_CELL_POSITIONS) uniform usampler2D cell_positions_tex;
layout(std430, binding = BUF_RESULTS) buffer Hidden { uint hidden[]; };

uniform uint work_first;  // of this dispatch
uniform uint work_count;  // of all: each pair twice, for one face and then for the other

// Cells with surfaces across no more than one axis, not one before the other: nothing stands on them.
bool is_plain(uvec4 record)
{
    uint facings = (record.w | record.w >> 6) & 63u;
    uint axes = (facings | facings >> 1) & 21u;
    return cut_axis(record) < 0 && bitCount(axes) < 2;
}

// Whether nothing stands on the cells between two whose corners touch.
bool is_plain_between(ivec3 one, ivec3 other)
{
    bool is_plain_so_far = true;
    for (int k = 1; k < 7 && is_plain_so_far; ++k) {
        ivec3 share = ivec3(k, k >> 1, k >> 2) & 1;
        is_plain_so_far = is_plain(record_of(one + share * (other - one)));
    }
    return is_plain_so_far;
}

// Where a cell has hardly any of a surface, what little there is tells nothing of the surface beside it.
const float LEAST_WEIGHT = 1e-4;

// Of two opposite steps the later one.
bool is_later(int k)
{
    return k == 1 || k == 3 || k >= 6;
}

// Whether a step from a face leads to this side of a cell: then that face asks.
bool finds(FoundFace from, ivec2 step, ivec3 cell, uint side)
{
    FoundFace found = face_beside(surroundings(face_number(from)), step);
    return found.cell == cell && found.bit != NONE_INDEX && found.bit / 6u == side;
}

void main()
{
    uint number = work_first + invocation_index();
    if (number >= work_count) {
        return;
    }
    uint index, side, axis;
    fetch_face_work(number % (work_count / 2u), index, side, axis);
    ivec3 cell = ivec3(unpack_cell(texelFetch(cell_positions_tex, list_texel(index), 0).r));
    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    uint face = face_index(record, 6u * side + 2u * axis) + 2u * number / work_count;
    Surroundings around = surroundings(face);
    uint seed = face_seed(face);
    uint found = fetch_face_reflectance(face).a < LEAST_WEIGHT ? 63u : 0u;
    bool stands_alone = is_plain(record);
    bool is_open = stands_alone;  // nothing stands on the cell, nor on those beside it, where the surface goes on in them
    int right = (dominant_axis(around.normal) + 1) % 3;
    int up = (right + 1) % 3;
    for (int k = 0; k < 8; ++k) {
        ivec2 at = neighbour_step(k);
        ivec3 along_right = ivec3(0), along_up = ivec3(0);
        along_right[right] = at.x;
        along_up[up] = at.y;
        uint bits_right = bits_towards(along_right), bits_up = bits_towards(along_up);
        FoundFace beside = face_beside(around, at);
        bool is_there = beside.bit != NONE_INDEX && all(lessThan(abs(beside.cell - cell), ivec3(2)));
        bool is_told = (found & (bits_right | bits_up)) != 0u || (is_later(k) && is_there && finds(beside, -at, cell, side));
        bool is_level = beside.cell[dominant_axis(around.normal)] == cell[dominant_axis(around.normal)];
        bool is_clear = is_open && is_level && is_plain(beside.record);
        bool may_be_clear = is_there && !is_told && !is_clear && stands_alone && is_plain(beside.record);
        for (; may_be_clear; may_be_clear = false) {
            is_clear = is_plain_between(cell, beside.cell);
        }
        bool asks = is_there && !is_told && !is_clear;
        is_open = is_open && (k >= 4 || (is_level && is_plain(beside.record)));
        vec3 there, normal_there;
        fetch_face_place(asks ? face_number(beside) : face, there, normal_there);
        // From place to place, or to above it: what bulges hides places from each other.
        vec3 from = around.position + around.normal * ray_start(around.position);
        vec3 straight = there + normal_there * ray_start(there) - from;
        float height = dot(straight, around.normal);
        vec3 along = straight - height * around.normal;
        bool is_free = !asks;
        for (int look = 0; look < 2 && !is_free; ++look) {
            vec3 path = (look == 0) == (height < 0.0) ? along : straight;
            float size = max(length(path), 1e-6);
            is_free = !is_blocked(from, path / size, size, seed);
        }
        // One of two axes tells of what lies across both.
        found |= is_free ? 0u : (at.x != 0 ? bits_right : bits_up);
    }
    found <<= 6u * side;
    if (found != 0u) {
        atomicOr(hidden[index], found);
    }
}
