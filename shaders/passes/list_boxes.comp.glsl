// SPDX-License-Identifier: GPL-3.0-or-later
// Boxes over long lists of triangles, level by level: over runs of entries, then over boxes of the level before.
// Input: work (cell, number of the box in its level), lists.    Output: box_img (lib/cell_list.glsl).

#include "lib/list_bounds.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Work { uvec2 work[]; };
layout(binding = IMG_0, rgba32ui) uniform uimage2D box_img;

uniform uint work_count;
uniform uint level;  // 0: over runs

// Where box `number` of a level lies among those of its list: after all that begin before it, and what holds it.
uint place_of(uint number, uint span, uint runs)
{
    uint place = number * span;
    for (uint other = BOX_FAN; other / BOX_FAN < runs; other *= BOX_FAN) {
        place += number * span / other + (other > span ? 1u : 0u);
    }
    return place;
}

void main()
{
    uint index = invocation_index();
    if (index >= work_count) {
        return;
    }
    uint cell = work[index].x, number = work[index].y;
    uvec4 record = fetch_source(cells_tex, list_texel(cell));
    uint runs = (record.y + BOX_RUN - 1u) / BOX_RUN;
    uint span = 1u;  // runs that a box of this level holds
    for (uint k = 0u; k < level; ++k) {
        span *= BOX_FAN;
    }
    uint place = first_box(record) + place_of(number, span, runs);
    uvec4 box = uvec4(0u);
    if (level == 0u) {
        vec3 low = vec3(2.0), high = vec3(-1.0);
        Run run = fetch_run(cell, number);
        uint k = run.first;
        do {
            vec3 entry_low, entry_high;
            bounds_in_cell(k, run, entry_low, entry_high);
            low = min(low, entry_low);
            high = max(high, entry_high);
        } while (++k < run.end);
        uvec3 from = uvec3(floor((low + BOX_MARGIN) / BOX_UNIT));
        uvec3 to = uvec3(min(ceil((high + BOX_MARGIN) / BOX_UNIT), 65535.0));
        box = uvec4(from | to << 16, BOX_IS_RUN | number);
    } else {
        uvec3 from = uvec3(0xFFFFu), to = uvec3(0u);
        uint next = place + 1u;
        uint part = span / BOX_FAN;
        for (uint k = BOX_FAN * number; k < BOX_FAN * (number + 1u) && k * part < runs; ++k) {
            uvec4 held = imageLoad(box_img, list_texel(next));
            from = min(from, held.xyz & 0xFFFFu);
            to = max(to, held.xyz >> 16);
            next += held.w >= BOX_IS_RUN ? 1u : held.w;
        }
        box = uvec4(from | to << 16, next - place);
    }
    imageStore(box_img, list_texel(place), box);
}
