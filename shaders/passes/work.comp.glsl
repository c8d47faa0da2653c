// SPDX-License-Identifier: GPL-3.0-or-later
// Cut the triangles into work items of about equal size, batch by batch.
// COUNT: how many items each batch has, and about how many pairs of triangle and cell there will be.
// Otherwise: write the items, each batch from its own start.
// IS_PART: items that may enter bricks that are made again, and no others.
// Input: triangles, batch of each material.    Output: counters, work items (triangle, item number).

#include "lib/overlap.glsl"
#if IS_PART
#include "lib/changed_bricks.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_MATERIALS) readonly buffer Batches { uint batch_of_material[]; };
layout(std430, binding = BUF_COUNTS) buffer Counters { uint counters[]; };  // of each batch; last: the estimate of pairs
#if !COUNT
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D work_img;
#endif

uniform uint triangle_count;
uniform uint ray_mask;  // triangles that none of these rays sees are left out
uniform uint batch_count;
#if IS_PART
uniform vec3 part_low;  // a box around the bricks that are made again, grid space
uniform vec3 part_high;
#endif

void visit_cell(uint triangle_index, Triangle triangle, ivec3 cell, float area, vec3 centre, vec3 normal) {}

#if IS_PART
bool may_enter_part(Triangle t)
{
    vec3 low = t.corner + min(vec3(0.0), min(t.edge_1, t.edge_2));
    vec3 high = t.corner + max(vec3(0.0), max(t.edge_1, t.edge_2));
    return all(greaterThan(high, part_low)) && all(lessThan(low, part_high));
}
#endif

// Whether an item is to be done. Cells of a column lie around the triangle's plane, in two bricks at most.
bool is_wanted(Triangle t, uint item)
{
#if IS_PART
    int level = level_of_item(t, item);
    vec3 n = cross(t.edge_1, t.edge_2);
    int axis = dominant_axis(n);
    ivec4 range = column_range(t, axis, level);
    vec3 a = turn(t.corner, axis);
    vec3 m = turn(n, axis);
    vec2 slope = -m.xy / m.z;
    float half_depth = 0.5 * (abs(slope.x) + abs(slope.y)) + 0.1;
    int first_depth = turn(first_cell(level), axis).z;
    int last_depth = turn(end_cell(level), axis).z - 1;
    int end = min(int(item + 1u) * COLUMNS_PER_ITEM, range.z * range.w);
    bool wanted = false;
    for (int k = int(item) * COLUMNS_PER_ITEM; k < end && !wanted; ++k) {
        ivec2 column = range.xy + ivec2(k % range.z, k / range.z);
        float depth = a.z + dot(slope, vec2(column) + 0.5 - a.xy);
        int low = clamp(int(floor(depth - half_depth)), first_depth, last_depth);
        int high = clamp(int(floor(depth + half_depth)), first_depth, last_depth);
        wanted = is_made_again(to_stack(turn_back(ivec3(column, low), axis), level)) ||
                 is_made_again(to_stack(turn_back(ivec3(column, high), axis), level));
    }
    return wanted;
#else
    return true;
#endif
}

void main()
{
    uint index = invocation_index();
    if (index >= triangle_count) {
        return;
    }
    Triangle t = fetch_triangle(index);
    if ((t.flags & ray_mask) == 0u) {
        return;
    }
#if LEVELS
    uint items = 0u, expected = 0u;
    for (int level = 0; level < LEVELS; ++level) {
        Triangle there = in_level(t, level);
        uint count_there = item_count(there, level);
        items += count_there;
        expected += min(expected_cells(there), 3u * uint(COLUMNS_PER_ITEM) * count_there);
    }
#else
    uint items = item_count(t, 0);
#endif
#if IS_PART
    items = may_enter_part(t) ? items : 0u;
    uint count = 0u;
    uint k = 0u;
    if (items > 0u) do {
        count += is_wanted(t, k) ? 1u : 0u;
    } while (++k < items);
#else
    uint count = items;
#endif
    if (count == 0u) {
        return;
    }
    uint first = atomicAdd(counters[batch_of_material[t.material]], count);
#if COUNT
#if !LEVELS
    uint expected = min(expected_cells(t), 3u * uint(COLUMNS_PER_ITEM) * count);
#endif
    atomicAdd(counters[batch_count], expected);
#else
    uint item = 0u;
    do {
        if (is_wanted(t, item)) {
            imageStore(work_img, list_texel(first++), uvec4(index, item, 0u, 0u));
        }
    } while (++item < items);
#endif
}
