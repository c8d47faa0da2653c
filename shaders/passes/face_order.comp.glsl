// SPDX-License-Identifier: GPL-3.0-or-later
// The list of all faces facing by facing: rays of neighbours in it start alike.
// Input: cells, pairs of faces axis by axis.    Output: order_img.

#include "lib/grid.glsl"
#include "lib/face_work.glsl"

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_CELLS, SOURCE_CELLS, rgba32ui) cells_tex;
layout(binding = IMG_0, r32ui) writeonly uniform uimage2D order_img;

uniform uint work_count;
uniform uvec3 axis_counts;  // work items of each axis

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    uint cell, side, axis;
    fetch_face_work(number, cell, side, axis);
    uint face = face_index(fetch_source(cells_tex, list_texel(cell)), 6u * side + 2u * axis);
    uint place = number + (axis > 0u ? axis_counts.x : 0u) + (axis > 1u ? axis_counts.y : 0u);
    imageStore(order_img, list_texel(place), uvec4(face | 2u * axis << FACING_SHIFT));
    imageStore(order_img, list_texel(place + axis_counts[axis]), uvec4((face + 1u) | (2u * axis + 1u) << FACING_SHIFT));
}
