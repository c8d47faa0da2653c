// SPDX-License-Identifier: GPL-3.0-or-later
// The plane that cuts a cell: across an axis, or that of one of its triangles. Both sides have faces of their own.
//
// The including program gets the define
//     HAS_ASLANT_CUTS  1: there are cells that are cut by the planes of triangles

#include "lib/cell_list.glsl"

const uint ONE_CUT = 3u;
const uint MOST_CUT_ENTRY = (1u << CUT_ENTRY_BITS) - 1u;
const uint MOST_CORNER_ENTRY = 31u;  // of two planes

bool is_aslant(uvec4 record)
{
#if HAS_ASLANT_CUTS
    return (record.w & CUT_IS_ASLANT) != 0u;
#else
    return false;
#endif
}

// Whether a cell that is cut aslant is so by two planes.
bool is_corner(uvec4 record)
{
    return is_aslant(record) && (record.w >> 12 & 3u) != ONE_CUT;
}

// Entries of the lists of cells: the triangles in whose planes a cell is cut aslant.
uint cut_entry(uvec4 record)
{
    return record.x + (record.w >> 14 & (is_corner(record) ? MOST_CORNER_ENTRY : MOST_CUT_ENTRY));
}
uint second_cut_entry(uvec4 record)
{
    return record.x + (record.w >> 19 & MOST_CORNER_ENTRY);
}

// The same, and the first entry of all lists where a cell has no such plane: what an `if` fetches for threads that it leaves out
// shall not come from afar. (Made of numbers: compilers know what an `if` asks inside of it, and drop what depends on that.)
uint cut_entry_or_first(uvec4 record)
{
    return cut_entry(record) * (record.w / CUT_IS_ASLANT & 1u);
}
uint second_cut_entry_or_first(uvec4 record)
{
    uint planes = record.w >> 12;  // lowest bits: both set where there is one
    return second_cut_entry(record) * (record.w / CUT_IS_ASLANT & ~(planes & planes >> 1) & 1u);
}

// Whether faces before, or beyond, the first of two planes lie beyond the second.
bool lies_beyond_second(uvec4 record, bool is_beyond)
{
    return is_beyond ? (record.w >> 12 & 3u) == 2u : (record.w >> 24 & 1u) != 0u;
}

// A triangle's plane; its normal goes up along the axis that it is nearest to.
struct CutPlane {
    vec3 place;
    vec3 normal;  // unit
    int axis;
};

// How far (sides of cells) off a surface, along its normal, it is asked on which side the surface lies: what lies in the
// very plane is on the side that it faces. More than what places are rounded by.
const float CUT_LIFT = 1.0 / 512.0;

CutPlane plane_of(Triangle t)
{
    vec3 n = normalize(cross(t.edge_1, t.edge_2));
    int axis = dominant_axis(n);
    return CutPlane(t.corner, n[axis] < 0.0 ? -n : n, axis);
}

// Of the triangle at an entry of the lists of cells, in cells of a level.
CutPlane listed_plane(uint entry, int level)
{
    return plane_of(in_level(fetch_listed(fetch_source(cell_triangles_tex, list_texel(entry)).rg), level));
}

float height_above(CutPlane plane, vec3 place)
{
    return dot(plane.normal, place - plane.place);
}

// Where two places are in a cell, or around it, by the planes that cut it.
struct Sides {
    bvec2 beyond;  // the plane
    bvec2 strays;  // there the cell has no faces of its own: the second plane is between them and the place
    vec3 away;     // a cell's side along the surface, from the wall between the first place and faces of the other side
};

// The places are on surfaces with normal n.
Sides sides_of(uvec4 record, ivec3 cell, vec3 one, vec3 other, vec3 n)
{
    int axis = cut_axis(record);
    vec3 inside = place_in_cell(one, cell);
    float along = axis == 0 ? inside.x : (axis == 1 ? inside.y : inside.z);
    Sides sides = Sides(bvec2(axis >= 0 && along > cut_place(record)), bvec2(false), vec3(0.0));
    if (is_aslant(record)) {
        int level = level_of_cell(cell);
        vec3 first = one / level_side(level) + n * CUT_LIFT;
        vec3 second = other / level_side(level) + n * CUT_LIFT;
        CutPlane plane = listed_plane(cut_entry_or_first(record), level);
        sides.beyond = bvec2(height_above(plane, first) > 0.0, height_above(plane, second) > 0.0);
        sides.away = sides.beyond.x ? plane.normal : -plane.normal;
        if (is_corner(record)) {
            CutPlane next = listed_plane(second_cut_entry_or_first(record), level);
            int facing = dominant_axis(n);
            bvec2 above = bvec2(height_above(next, first) > 0.0, height_above(next, second) > 0.0);
            bool is_across = facing != plane.axis && facing != next.axis;
            sides.strays.x = is_across && above.x != lies_beyond_second(record, sides.beyond.x);
            sides.strays.y = is_across && above.y != lies_beyond_second(record, sides.beyond.y);
            sides.away = sides.strays.x ? (above.x ? next.normal : -next.normal) : sides.away;
        }
        sides.away -= n * dot(sides.away, n);
        sides.away *= level_side(level) * inversesqrt(max(dot(sides.away, sides.away), 1e-12));
    }
    return sides;
}

bool lies_beyond(uvec4 record, ivec3 cell, vec3 place, vec3 n)
{
    return sides_of(record, cell, place, place, n).beyond.x;
}
