// SPDX-License-Identifier: GPL-3.0-or-later
// Where on a Morton curve through its cell each triangle of a long list lies: the middle of its part there.
// One thread a run.    Input: work (cell, number of the run), triangles and positions of cells.    Output: keys of 30 bits.

#include "lib/list_bounds.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Work { uvec2 work[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Keys { uint keys[]; };

uniform uint work_count;
uniform uint first_entry;  // that has the first key

// Bits of a number of ten, two zeros after each.
uvec3 spread(uvec3 v)
{
    v = (v | v << 16) & 0x030000FFu;
    v = (v | v << 8) & 0x0300F00Fu;
    v = (v | v << 4) & 0x030C30C3u;
    return (v | v << 2) & 0x09249249u;
}

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    Run run = fetch_run(work[number].x, work[number].y);
    uint k = run.first;
    do {
        vec3 low, high;
        bounds_in_cell(k, run, low, high);
        uvec3 bits = spread(uvec3(clamp(0.5 * (low + high), 0.0, 1.0) * 1023.0));
        keys[k - first_entry] = bits.x | bits.y << 1 | bits.z << 2;
    } while (++k < run.end);
}
