// SPDX-License-Identifier: GPL-3.0-or-later
// Which cells may have to be cut in two (pass voxel_cut)? Most are not: their surfaces all face along one axis, a single
// layer, and do not face each other.
// Input: which cells, their parts.    Output: for each cell the last word of its record (lib/grid.glsl); NONE_INDEX where it
// may be cut.

#include "lib/walls.glsl"
#include "lib/cell_list.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_COUNTS) writeonly buffer Cells { uint cells[]; };
layout(std430, binding = BUF_WORK) readonly buffer Work { uint work[]; };  // cells

uniform uint work_count;

// Both facings of each axis that surfaces face.
uint uncut_word(Areas sums)
{
    uint plus = (sums.axes & 1u) | (sums.axes & 2u) << 1 | (sums.axes & 4u) << 2;
    return plus | plus << 1;
}

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    number = work[number];
    uvec4 record = fetch_source(cells_tex, list_texel(number));
    Areas sums = sum_areas(record.x, record.x + record.y);
    cells[number] = find_walls(sums).may_be_cut ? NONE_INDEX : uncut_word(sums);
}
