// SPDX-License-Identifier: GPL-3.0-or-later
// Which faces does each cell get? Surfaces that see different parts of space must not share one: the floors on both
// sides of a thin wall, a picture and the wall behind it. A cell that holds such is cut in two, and each side has faces of
// its own: by the plane of a wall, where that lies aslant to the grid, or else by one across an axis. A plane along a wall
// also tells on which side of it a point lies.
// IS_CROWDED: of one crowded cell, in steps (CROWD_STEP): three in which threads sum up runs of its list, each of which
// needs what the one before found, and one in which a single thread does the rest.
// Input: which cells, of those that may be cut (pass voxel_walls), their parts and triangles.
//   Output: for each cell the last word of its record (lib/grid.glsl).

#include "lib/clipped.glsl"
#include "lib/cut.glsl"
#include "lib/walls.glsl"
#include "lib/crowd.glsl"

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_CELL_POSITIONS, SOURCE_CELL_POSITIONS, r32ui) cell_positions_tex;
layout(std430, binding = BUF_COUNTS) buffer Cells { uint cells[]; };
#if !IS_CROWDED
layout(std430, binding = BUF_WORK) readonly buffer Work { uint work[]; };  // cells
#endif

#if IS_CROWDED
uniform uint crowd_cell;
#else
uniform uint work_count;
#endif

// Areas in sides of cells. What is smaller is not worth faces of its own, on a side of a cell that is cut anyway.
const float SIDE_AREA = 0.1;
// A wall, whose plane is noted though nothing lies behind it.
const float WALL_AREA = 0.25;
// Areas on both sides of a wall that lies aslant: they tell where floors end, exactly.
const float LEAST_ASLANT_AREA = 0.03;
// Less is rounding.
const float NOTED_AREA = 1.5 / FIXED_ONE;
// Sine of the angle between a wall's normal and an axis: less is rounding.
const float ASLANT = 1e-4;

// Extent of a triangle's bounds inside the cell.
void bounds_inside(Triangle t, vec3 corner, out vec3 low, out vec3 high)
{
    vec3 a = t.corner - corner;
    low = clamp(a + min(vec3(0.0), min(t.edge_1, t.edge_2)), 0.0, 1.0);
    high = clamp(a + max(vec3(0.0), max(t.edge_1, t.edge_2)), 0.0, 1.0);
}

// What lies beyond a wall in each axis, of the surfaces that face the other axes; and areas seen along the axes.
struct Seen {
    uvec3 beyond_x, beyond_y, beyond_z, plus, minus;
};

Seen sum_seen(uint first, uint end, vec3 wall, vec3 corner, int level)
{
    Seen seen = Seen(uvec3(0u), uvec3(0u), uvec3(0u), uvec3(0u), uvec3(0u));
    uint k = first;
    if (k < end) do {
        Part part = unpack_part(fetch_source(parts_tex, list_texel(k)));
        Triangle t = in_level(fetch_listed(fetch_source(cell_triangles_tex, list_texel(k)).rg), level);
        uvec3 mask = axis_mask(part.facing);
        vec3 low, high;
        bounds_inside(t, corner, low, high);
        vec3 share = clamp((high - wall) / max(high - low, 1e-6), 0.0, 1.0);
        uvec3 area = uvec3(share * float(part.area) + 0.5);
        seen.beyond_x += area.x & mask;
        seen.beyond_y += area.y & mask;
        seen.beyond_z += area.z & mask;
        vec3 n = abs(normalize(cross(t.edge_1, t.edge_2)));
        uvec3 across = uvec3(n * float(part.area)) & mask;
        bool is_minus = (part.facing & 1u) != 0u;
        seen.plus += is_minus ? uvec3(0u) : across;
        seen.minus += is_minus ? across : uvec3(0u);
    } while (++k < end);
    return seen;
}

struct Cut {
    int axis;      // -1: none
    uint units;    // where, in CUT_UNITS
    float gain;    // area that it divides; 0: it is only noted
    vec3 gains;    // those of planes of walls that face each axis
    bool is_aslant;
    uint word;     // if it is: that part of the record's last word
};

// Across an axis. `rise`: of walls that lie aslant, along the axis that they face, over the cell; where they are is told no
// better than that by their means.
Cut find_cut(Areas sums, Walls walls, Seen seen, vec3 rise)
{
    walls.gap *= vec3(greaterThan(walls.minus_mean - walls.plus_mean, max(rise, vec3(1.0 / CUT_UNITS))));
    uvec3 all = sums.plus + sums.minus;
    uvec3 both_x = min(seen.beyond_x, all - min(all, seen.beyond_x));
    uvec3 both_y = min(seen.beyond_y, all - min(all, seen.beyond_y));
    uvec3 both_z = min(seen.beyond_z, all - min(all, seen.beyond_z));
    vec3 divided = vec3(both_x.y + both_x.z, both_y.x + both_y.z, both_z.x + both_z.y) / FIXED_ONE;
    // Layers: surfaces that face alike, one over the other, have more area than the cell's side.
    vec3 layered = vec3(max(seen.plus, seen.minus)) / FIXED_ONE - 1.0;
    vec3 between = mix(walls.minus_mean, walls.plus_mean, greaterThanEqual(seen.plus, seen.minus));

    int cut = -1;
    float place = 0.0;
    float most = LEAST_AREA;
    for (int a = 0; a < 3; ++a) {
        float gain = rise[a] > 0.0 ? 0.0 : min(divided[a], walls.area[a]);
        float layers = walls.may_be_cut ? max(layered[a], walls.gap[a]) : 0.0;
        if (max(gain, layers) > most) {
            most = max(gain, layers);
            cut = a;
            place = gain >= layers ? walls.place[a] : (layered[a] >= walls.gap[a] ? between[a] : walls.middle[a]);
        }
    }
    float found = cut < 0 ? 0.0 : most;
    if (cut < 0 && !walls.is_single) {
        most = WALL_AREA;
        for (int a = 0; a < 3; ++a) {
            if (walls.area[a] > most && rise[a] == 0.0) {
                most = walls.area[a];
                cut = a;
                place = walls.place[a];
            }
        }
    }
    return Cut(cut, uint(clamp(place, 0.0, 1.0) * CUT_UNITS + 0.5), found, min(divided, walls.area), false, 0u);
}

// Areas on the sides of a cut: surfaces that face along its axis lie where their middle is.
struct SideAreas {
    uvec3 near, far;
};

SideAreas sum_sides(uint first, uint end, Cut cut, vec3 corner, int level)
{
    SideAreas sides = SideAreas(uvec3(0u), uvec3(0u));
    float place = float(cut.units) / CUT_UNITS;
    uint k = first;
    if (k < end) do {
        Part part = unpack_part(fetch_source(parts_tex, list_texel(k)));
        Triangle t = in_level(fetch_listed(fetch_source(cell_triangles_tex, list_texel(k)).rg), level);
        uvec3 mask = axis_mask(part.facing);
        vec3 low, high;
        bounds_inside(t, corner, low, high);
        float share = clamp((high[cut.axis] - place) / max(high[cut.axis] - low[cut.axis], 1e-6), 0.0, 1.0);
        if (int(part.facing >> 1) == cut.axis) {
            share = float(part.position[cut.axis]) > place * float(part.area) ? 1.0 : 0.0;
        }
        uint beyond = uint(share * float(part.area) + 0.5);
        sides.far += beyond & mask;
        sides.near += (part.area - min(part.area, beyond)) & mask;
    } while (++k < end);
    return sides;
}

// The last word of the cell's record.
uint facing_word(Areas sums, Cut cut, SideAreas sides)
{
    uint facings = 0u;
    for (int a = 0; a < 3; ++a) {
        float area = cut.is_aslant ? LEAST_ASLANT_AREA : SIDE_AREA;
        uint least = min(uint(area * FIXED_ONE), max(sides.near[a], sides.far[a]));
        uint wanted = (sides.near[a] >= least ? 3u : 0u) | (sides.far[a] >= least ? 3u << 6 : 0u);
        bool is_far = sides.near[a] == 0u && sides.far[a] > 0u;
        wanted = cut.axis < 0 ? 3u : (is_far ? 3u << 6 : (sides.far[a] == 0u ? 3u : wanted));
        facings |= (sums.axes >> a & 1u) != 0u ? wanted << 2 * a : 0u;
    }
    return facings | (cut.is_aslant ? cut.word : uint(cut.axis + 1) << 12 | cut.units << 14);
}

#if !IS_CROWDED
// Of each axis the part that is largest of those that face along it, as entries of the cell's list.
uvec3 find_largest(uint first, uint end)
{
    uvec3 area = uvec3(0u), entry = uvec3(NONE_INDEX);
    uvec2 listed[3] = uvec2[3](uvec2(0u), uvec2(0u), uvec2(0u));
    uint k = first;
    if (k < end) do {
        Part part = unpack_part(fetch_source(parts_tex, list_texel(k)));
        uvec2 at = fetch_source(cell_triangles_tex, list_texel(k)).rg;
        for (uint a = 0u; a < 3u; ++a) {
            bool is_larger = part.area > area[a] || (part.area == area[a] && comes_before(at, listed[a]));
            is_larger = is_larger && part.facing >> 1 == a;
            area[a] = is_larger ? part.area : area[a];
            entry[a] = is_larger ? k : entry[a];
            listed[a] = is_larger ? at : listed[a];
        }
    } while (++k < end);
    return entry;
}

// Shares of a triangle's part in the cell that lie beyond a plane, beyond another, and beyond both.
vec3 shares_above(CutPlane plane, CutPlane other, Triangle t, int axis, vec3 corner)
{
    vec3 a = t.corner, b = a + t.edge_1, c = a + t.edge_2;
    vec3 heights = vec3(height_above(plane, a), height_above(plane, b), height_above(plane, c));
    vec3 others = vec3(height_above(other, a), height_above(other, b), height_above(other, c));
    a = turn(a - corner, axis);
    b = turn(b - corner, axis);
    c = turn(c - corner, axis);
    vec3 all = overlap(a, b, c);
    vec3 areas = vec3(overlap_above(a, b, c, heights, all).x, overlap_above(a, b, c, others, all).x,
                      overlap_above_both(a, b, c, heights, others, all).x);
    return all.x != 0.0 ? clamp(areas / all.x, 0.0, 1.0) : vec3(0.0);
}

// A bit for each.
uint axis_bits(bvec3 axes)
{
    return uint(axes.x) | uint(axes.y) << 1 | uint(axes.z) << 2;
}

// Share of a triangle's part in the cell that lies beyond a plane.
float share_above(CutPlane plane, Triangle t, int axis, vec3 corner)
{
    vec3 a = t.corner, b = a + t.edge_1, c = a + t.edge_2;
    vec3 heights = vec3(height_above(plane, a), height_above(plane, b), height_above(plane, c));
    float share = max_component(heights) > 0.0 ? 1.0 : 0.0;
    if (is_divided(heights)) {
        a = turn(a - corner, axis);
        b = turn(b - corner, axis);
        c = turn(c - corner, axis);
        vec3 all = overlap(a, b, c);
        share = all.x != 0.0 ? clamp(overlap_above(a, b, c, heights, all).x / all.x, 0.0, 1.0) : 0.0;
    }
    return share;
}

// Areas before and beyond a plane. What faces its axis lies, as a whole, where its middle is.
SideAreas sum_sides_of(CutPlane plane, int axis, uint first, uint end, vec3 corner, int level)
{
    SideAreas sides = SideAreas(uvec3(0u), uvec3(0u));
    uint k = first;
    if (k < end) do {
        Part part = unpack_part(fetch_source(parts_tex, list_texel(k)));
        Triangle t = in_level(fetch_listed(fetch_source(cell_triangles_tex, list_texel(k)).rg), level);
        vec3 n = normalize(cross(t.edge_1, t.edge_2));
        int facing = int(part.facing >> 1);
        vec3 middle = corner + vec3(part.position) / max(float(part.area), 1.0);
        middle[facing] -= dot(n, middle - t.corner) / n[facing];  // sums are rounded
        float share = height_above(plane, middle + n * CUT_LIFT) > 0.0 ? 1.0 : 0.0;
        if (facing != axis) {
            share = share_above(plane, t, facing, corner);
        }
        uint beyond = uint(share * float(part.area) + 0.5);
        uvec3 mask = axis_mask(part.facing);
        sides.far += beyond & mask;
        sides.near += (part.area - min(part.area, beyond)) & mask;
    } while (++k < end);
    return sides;
}

// By the plane of a wall that lies aslant, if that divides more than the cut across an axis does, or the wall is to be noted.
// `entries`: of the largest triangles that face each axis.
void find_aslant_cut(inout Cut cut, inout SideAreas sides, uvec3 entries, vec3 rise, Walls walls, uint first, uint end,
                     vec3 corner, int level)
{
    float most = max(cut.gain, NOTED_AREA);
    float noted = cut.gain > 0.0 ? 1e30 : (cut.axis >= 0 ? walls.area[cut.axis] : NOTED_AREA);
    uint axes = axis_bits(greaterThan(rise, vec3(0.0)));
    if (axes != 0u) do {
        int a = findLSB(axes);
        SideAreas found = sum_sides_of(listed_plane(entries[a], level), a, first, end, corner, level);
        uvec3 both = min(found.near, found.far);
        both[a] = 0u;
        float gain = min(float(both.x + both.y + both.z) / FIXED_ONE, walls.area[a]);
        bool divides = gain > most;
        cut.gains[a] = gain;
        if (divides || walls.area[a] > noted) {
            noted = divides ? 1e30 : walls.area[a];
            most = max(most, gain);
            cut = Cut(a, 0u, most, cut.gains, true, ONE_CUT << 12 | (entries[a] - first) << 14 | CUT_IS_ASLANT);
            sides = found;
        }
        axes &= axes - 1u;
    } while (axes != 0u);
}

// Where walls meet, a second plane: each side's faces are for the larger part, before or beyond it. Of what faces the third
// axis; the walls themselves face the others.
void find_second_cut(inout Cut cut, uvec3 entries, Walls walls, uint first, uint end, vec3 corner, int level)
{
    CutPlane plane = listed_plane(entries[cut.axis], level);
    float most = NOTED_AREA;
    uint others = axis_bits(lessThan(entries, uvec3(end))) & ~(1u << cut.axis);
    uint axes = others & axis_bits(greaterThan(cut.gains, vec3(NOTED_AREA)));
    if (axes != 0u) do {
        int a = findLSB(axes);
        CutPlane next = listed_plane(entries[a], level);
        uvec3 areas = uvec3(0u);  // beyond the first, beyond the second, beyond both
        uint all = 0u;
        uint k = first;
        if (k < end) do {
            Part part = unpack_part(fetch_source(parts_tex, list_texel(k)));
            int facing = int(part.facing >> 1);
            if (facing != cut.axis && facing != a) {
                Triangle t = in_level(fetch_listed(fetch_source(cell_triangles_tex, list_texel(k)).rg), level);
                areas += uvec3(shares_above(plane, next, t, facing, corner) * float(part.area) + 0.5);
                all += part.area;
            }
        } while (++k < end);
        // Before the first plane, and beyond it: what lies beyond the second, and what lies before.
        vec2 beyond = vec2(float(areas.y) - float(areas.z), float(areas.z)) / FIXED_ONE;
        vec2 before = vec2(float(all) - float(areas.x), float(areas.x)) / FIXED_ONE - beyond;
        vec2 both = min(beyond, before);
        float gain = min(both.x + both.y, walls.area[a]);
        if (gain > most) {
            most = gain;
            uint field = beyond.y > before.y ? 2u : 1u, near = beyond.x > before.x ? 1u : 0u;
            uint both_entries = (entries[cut.axis] - first) << 14 | (entries[a] - first) << 19;
            cut.word = field << 12 | both_entries | near << 24 | CUT_IS_ASLANT;
        }
        axes &= axes - 1u;
    } while (axes != 0u);
}
#endif

#if IS_CROWDED

Areas crowd_areas()
{
    Areas sums;
    for (uint a = 0u; a < 3u; ++a) {
        FacingSums plus = crowd_facing(2u * a), minus = crowd_facing(2u * a + 1u);
        sums.plus[a] = plus.area;
        sums.minus[a] = minus.area;
        sums.plus_place[a] = plus.position[a];
        sums.minus_place[a] = minus.position[a];
    }
    sums.axes = crowd_sum(CROWD_AXES);
    return sums;
}

void main()
{
    uint run = invocation_index();
    uvec4 record = fetch_source(cells_tex, list_texel(crowd_cell));
    uint first = record.x + CROWD_RUN * run, end = min(first + CROWD_RUN, record.x + record.y);
    if (first >= end) {
        return;
    }
    ivec3 cell = unpack_cell(fetch_source(cell_positions_tex, list_texel(crowd_cell)).r);
    int level = level_of_cell(cell);
    vec3 corner = vec3(from_stack(cell, level));
#if CROWD_STEP == 0
    for (uint k = first; k < end; ++k) {
        add_to_crowd(unpack_part(fetch_source(parts_tex, list_texel(k))));
    }
#else
    Areas sums = crowd_areas();
    Walls walls = find_walls(sums);
#if CROWD_STEP == 1
    Seen seen = sum_seen(first, walls.may_be_cut ? end : first, walls.place, corner, level);
    add_to_crowd(CROWD_CUT, seen.beyond_x);
    add_to_crowd(CROWD_CUT + 3u, seen.beyond_y);
    add_to_crowd(CROWD_CUT + 6u, seen.beyond_z);
    add_to_crowd(CROWD_CUT + 9u, seen.plus);
    add_to_crowd(CROWD_CUT + 12u, seen.minus);
#else
    Seen seen = Seen(crowd_sum3(CROWD_CUT), crowd_sum3(CROWD_CUT + 3u), crowd_sum3(CROWD_CUT + 6u),
                     crowd_sum3(CROWD_CUT + 9u), crowd_sum3(CROWD_CUT + 12u));
    Cut cut = find_cut(sums, walls, seen, vec3(0.0));
#if CROWD_STEP == 2
    SideAreas sides = sum_sides(first, cut.axis >= 0 ? end : first, cut, corner, level);
    add_to_crowd(CROWD_CUT + 15u, sides.near);
    add_to_crowd(CROWD_CUT + 18u, sides.far);
#else
    if (run == 0u) {
        cells[crowd_cell] = facing_word(sums, cut, SideAreas(crowd_sum3(CROWD_CUT + 15u), crowd_sum3(CROWD_CUT + 18u)));
    }
#endif
#endif
#endif
}

#else

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    number = work[number];
    uvec4 record = fetch_source(cells_tex, list_texel(number));
    uint first = record.x, end = record.x + record.y;
    ivec3 cell = unpack_cell(fetch_source(cell_positions_tex, list_texel(number)).r);
    int level = level_of_cell(cell);
    vec3 corner = vec3(from_stack(cell, level));
    Areas sums = sum_areas(first, end);
    Walls walls = find_walls(sums);
    Seen seen = sum_seen(first, end, walls.place, corner, level);
    uvec3 entries = find_largest(first, walls.is_single ? first : end);
    vec3 rise = vec3(0.0);
    for (int a = 0; a < 3; ++a) {
        if (entries[a] < end && record.y <= ASLANT_LIST) {
            vec3 n = listed_plane(entries[a], level).normal;
            float sine = sqrt(max(1.0 - n[a] * n[a], 0.0));
            rise[a] = sine > ASLANT ? sine / n[a] : 0.0;
        }
    }
    Cut cut = find_cut(sums, walls, seen, rise);
    SideAreas sides = sum_sides(first, cut.axis >= 0 ? end : first, cut, corner, level);
    find_aslant_cut(cut, sides, entries, rise, walls, first, end, corner, level);
    if (cut.is_aslant && cut.gain > NOTED_AREA && record.y <= MOST_CORNER_ENTRY + 1u) {
        find_second_cut(cut, entries, walls, first, end, corner, level);
    }
    cells[number] = facing_word(sums, cut, sides);
}

#endif
