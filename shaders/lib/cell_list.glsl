// SPDX-License-Identifier: GPL-3.0-or-later
// The triangles that cells list, and boxes over those of long lists, so that a ray asks few of many.
//
// The including program gets the define
//     HAS_BOXES  1: lists of more than LONG_LIST entries are ordered along a Morton curve, and have a tree of boxes: one
//                over each run of BOX_RUN entries, one over BOX_FAN of those, and so on up to a single one. They are
//                bounds of the triangles' parts around the cell, rounded outwards. The boxes of a list lie in depth
//                first order, so that a ray goes on to the next one, or past all that a box which it misses holds.

#include "lib/grid.glsl"
#include "lib/triangle.glsl"

SOURCE_2D(TEX_CELLS, SOURCE_CELLS, rgba32ui) cells_tex;  // records, then boxes
#if HAS_INSTANCES
SOURCE_2D(TEX_CELL_TRIANGLES, SOURCE_CELL_TRIANGLES, rg32ui) cell_triangles_tex;  // entries: lib/triangle.glsl
#else
SOURCE_2D(TEX_CELL_TRIANGLES, SOURCE_CELL_TRIANGLES, r32ui) cell_triangles_tex;
#endif

// How far (grid space) outside a box a ray from `origin` may meet what is in it: floats have 24 bits, and so have distances
// and corners of triangles that hits are found by.
float list_slack(vec3 origin)
{
#if LEVELS
    vec3 farthest = vec3(max(-level_first[LEVELS - 1].xyz, level_end[LEVELS - 1])) * level_side(LEVELS - 1);
#else
    vec3 farthest = vec3(grid_size);
#endif
    return RAY_START + 2e-6 * max_component(max(abs(origin), farthest));
}

#if HAS_BOXES

uniform uint box_first;  // entry of cells_tex

// A box: x, y, z: low | high << 16; w: BOX_IS_RUN | number of the run, or how many boxes it holds, itself among them.
const uint BOX_IS_RUN = 0x80000000u;
// Its range on each axis: so much (cells) more than the cell on either side.
const float BOX_MARGIN = 1.0 / 32.0;
const float BOX_UNIT = (1.0 + 2.0 * BOX_MARGIN) / 65535.0;

// First box of a cell's list.
uint first_box(uvec4 record)
{
    return box_first + record.x * BOXES_PER_16 / 16u;
}

struct ListWalk {
    uint next, end;     // entries of the run that has been come to
    uint box, box_end;  // boxes that are still to be asked
    uint first, last;   // entries of the list, and what comes after it
    vec3 low_from, high_from, inverse;
};

// The way of a ray through a cell's list. Lengths are sides of the cell: `from`: where the ray starts, from the cell's
// lowest corner; `inverse`: one over its direction; `slack`: how much wider than a line it is, see list_slack().
ListWalk begin_list(uvec4 record, vec3 from, vec3 inverse, vec3 slack)
{
    ListWalk walk;
    bool is_long = record.y > LONG_LIST;
    walk.first = record.x;
    walk.last = record.x + record.y;
    walk.next = record.x;
    walk.end = is_long ? walk.next : walk.last;
    walk.box = first_box(record);
    walk.box_end = walk.box + (is_long ? 1u : 0u);
    walk.low_from = from + (BOX_MARGIN + slack);
    walk.high_from = from + (BOX_MARGIN - slack);
    walk.inverse = inverse;
    return walk;
}

// On to the next run whose box the ray meets nearer than `limit`.
void next_run(inout ListWalk walk, float limit)
{
    if (walk.next >= walk.end && walk.box < walk.box_end) do {
        uvec4 box = fetch_source(cells_tex, list_texel(walk.box));
        vec3 to_low = (vec3(box.xyz & 0xFFFFu) * BOX_UNIT - walk.low_from) * walk.inverse;
        vec3 to_high = (vec3(box.xyz >> 16) * BOX_UNIT - walk.high_from) * walk.inverse;
        vec3 enter = min(to_low, to_high), leave = max(to_low, to_high);
        float near = max(max(enter.x, enter.y), max(enter.z, 0.0));
        bool is_met = near <= min(min(leave.x, leave.y), min(leave.z, limit));
        bool is_run = box.w >= BOX_IS_RUN;
        uint held = is_run ? 1u : box.w;
        walk.box_end = is_met ? max(walk.box_end, walk.box + held) : walk.box_end;
        walk.box += is_met ? 1u : held;
        walk.next = is_met && is_run ? walk.first + BOX_RUN * (box.w & ~BOX_IS_RUN) : walk.next;
        walk.end = is_met && is_run ? min(walk.next + BOX_RUN, walk.last) : walk.end;
    } while (walk.next >= walk.end && walk.box < walk.box_end);
}

bool has_runs(ListWalk walk)
{
    return walk.box < walk.box_end;
}

void end_list(inout ListWalk walk)
{
    walk.next = walk.end;
    walk.box = walk.box_end;
}

#else

struct ListWalk {
    uint next, end;
};

ListWalk begin_list(uvec4 record, vec3 from, vec3 inverse, vec3 slack)
{
    return ListWalk(record.x, record.x + record.y);
}

void next_run(ListWalk walk, float limit) {}

bool has_runs(ListWalk walk)
{
    return false;
}

void end_list(inout ListWalk walk)
{
    walk.next = walk.end;
}

#endif
