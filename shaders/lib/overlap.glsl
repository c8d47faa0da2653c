// SPDX-License-Identifier: GPL-3.0-or-later
// Exact overlap of triangles and cells: every cell that a triangle's surface enters, with the area of the part inside
// it and the centre of that part. No cell is missed however the triangle lies, and parts add up to the whole.
//
// The including shader defines
//     void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre, vec3 normal);
// `cell` is a cell of the stack; area and `centre`, which is a place in the cell, are in sides of it.

#include "lib/clipped.glsl"
#include "lib/triangle.glsl"
#include "lib/grid.glsl"

// Columns of cells (along the dominant axis) that one work item handles.
const int COLUMNS_PER_ITEM = 8;

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre, vec3 normal);

// The cells of a level.
ivec3 first_cell(int level)
{
#if LEVELS
    return level_first[level].xyz;
#else
    return ivec3(0);
#endif
}
ivec3 end_cell(int level)
{
#if LEVELS
    return level_end[level];
#else
    return grid_size;
#endif
}

// Columns of a level that the bounds of a triangle, in its cells, cover: first (xy) and count (zw) in turned axes; count 0
// when outside.
ivec4 column_range(Triangle t, int axis, int level)
{
    vec3 b = t.corner + t.edge_1;
    vec3 c = t.corner + t.edge_2;
    vec3 lo = turn(min(t.corner, min(b, c)), axis);
    vec3 hi = turn(max(t.corner, max(b, c)), axis);
    vec3 low = vec3(turn(first_cell(level), axis));
    vec3 high = vec3(turn(end_cell(level), axis));
    if (any(lessThan(hi, low)) || any(greaterThanEqual(lo, high)) || !is_finite(lo + hi)) {
        return ivec4(0);
    }
    ivec2 first = ivec2(max(floor(lo.xy), low.xy));
    ivec2 last = ivec2(min(floor(hi.xy), high.xy - 1.0));
    return ivec4(first, last - first + 1);
}

// Work items of a triangle, in cells of a level, there.
uint item_count(Triangle t, int level)
{
    vec3 n = cross(t.edge_1, t.edge_2);
    if (!(dot(n, n) > 0.0)) {
        return 0u;  // no area: it cannot be seen
    }
    ivec4 range = column_range(t, dominant_axis(n), level);
    return uint((range.z * range.w + COLUMNS_PER_ITEM - 1) / COLUMNS_PER_ITEM);
}

// How many cells a triangle enters, on average over where it lies in the grid: the volume of the triangle's Minkowski
// sum with a cell. Rounded up or down at random, right on average: most are small where there are many.
uint expected_cells(Triangle t)
{
    vec3 extent = max(vec3(0.0), max(t.edge_1, t.edge_2)) - min(vec3(0.0), min(t.edge_1, t.edge_2));
    vec3 areas = 0.5 * abs(cross(t.edge_1, t.edge_2));  // seen along each axis
    uvec3 place = floatBitsToUint(t.corner);
    float random = unit_float(hash(place.x, hash(place.y, place.z)));
    return uint(min(1.0 + dot(extent + areas, vec3(1.0)), 1e9) + random);
}

// Whether an edge of the triangle, seen along an axis, has the unit square on its outer side.
bool is_beside(vec2 a, vec2 b, vec2 c)
{
    vec2 n = vec2(a.y - b.y, b.x - a.x);
    n *= dot(n, c - a) < 0.0 ? -1.0 : 1.0;
    return dot(n, step(vec2(0.0), n) - a) < -1e-4 * (abs(n.x) + abs(n.y));
}
bool is_apart(vec2 a, vec2 b, vec2 c)
{
    return is_beside(a, b, c) || is_beside(b, c, a) || is_beside(c, a, b);
}

// The level that work item `item` of a triangle is about: items follow each other level by level. Changes `item` to its
// number there, and `t` to cells of the level.
int level_of_item(inout Triangle t, inout uint item)
{
#if LEVELS
    Triangle all = t;
    int level = 0;
    t = in_level(all, level);
    uint count = item_count(t, level);
    while (item >= count && level < LEVELS - 1) {
        item -= count;
        ++level;
        t = in_level(all, level);
        count = item_count(t, level);
    }
    return level;
#else
    return 0;
#endif
}

// Visit the cells of work item `item` of a triangle.
void visit_cells(uint triangle_index, uint item)
{
    Triangle t = fetch_triangle(triangle_index);
    int level = level_of_item(t, item);
    vec3 n = cross(t.edge_1, t.edge_2);
    vec3 normal = normalize(n);
    int axis = dominant_axis(n);
    ivec4 range = column_range(t, axis, level);
    vec3 a = turn(t.corner, axis);
    vec3 b = turn(t.corner + t.edge_1, axis);
    vec3 c = turn(t.corner + t.edge_2, axis);
    vec3 m = turn(n, axis);
    vec2 slope = -m.xy / m.z;  // of depth over x and y; at most 1 on the dominant axis
    float z_lo = min(a.z, min(b.z, c.z));
    float z_hi = max(a.z, max(b.z, c.z));
    int z_first = turn(first_cell(level), axis).z;
    int z_last = turn(end_cell(level), axis).z - 1;
    float area_scale = 1.0 / abs(turn(normal, axis).z);
    int first = int(item) * COLUMNS_PER_ITEM;
    int last = min(first + COLUMNS_PER_ITEM, range.z * range.w);
    ivec2 column = range.xy + ivec2(first % range.z, first / range.z);
    float z_half = 0.5 * (abs(slope.x) + abs(slope.y)) + 1e-3;
    // One loop, not one in another: threads side by side wait for each other once a cell, not once a column.
    int z = 0, z_end = -1;
    vec3 base = vec3(0.0);
    int left = last - first;
    if (left > 0) do {
        if (z > z_end) {
            // Depth of the plane at the column's centre, and how far it can differ within the column.
            float z_mid = a.z + dot(slope, vec2(column) + 0.5 - a.xy);
            z = max(int(floor(max(z_lo, z_mid - z_half))), z_first);
            z_end = min(int(floor(min(z_hi, z_mid + z_half))), z_last);
            base.xy = vec2(column);
            ++column.x;
            column = column.x == range.x + range.z ? ivec2(range.x, column.y + 1) : column;
            --left;
        }
        if (z > z_end) {
            continue;
        }
        base.z = float(z);
        vec3 sums = overlap(a - base, b - base, c - base);
        float area = abs(sums.x);
        if (area == 0.0) {
            continue;
        }
        // Where an outline passes a cell at a distance, its segments cancel but for their rounding.
        bool apart = false;
        if (area < 1e-4) {
            vec3 u = a - base, v = b - base, w = c - base;
            apart = is_apart(u.xy, v.xy, w.xy) || is_apart(u.yz, v.yz, w.yz) || is_apart(u.zx, v.zx, w.zx);
        }
        if (apart) {
            continue;
        }
        vec2 centre = clamp(sums.yz / sums.x, 0.0, 1.0);
        vec3 at = vec3(centre + base.xy, 0.0);
        at.z = clamp(a.z + dot(slope, at.xy - a.xy), base.z, base.z + 1.0);
        ivec3 cell = turn_back(ivec3(base), axis);
#if LEVELS
        if (is_in_hole(cell, level)) {
            continue;
        }
#endif
        visit_cell(triangle_index, t, to_stack(cell, level), area * area_scale, turn_back(at, axis) - vec3(cell), normal);
    } while (++z <= z_end || left > 0);
}
