// SPDX-License-Identifier: GPL-3.0-or-later
// Copy every component of every field of a struct into a plain list: the layout that the driver uses.
// Input: STRUCT, COMPONENTS, generated text "fields" (the assignments).    Output: copied.

#include "lib/common.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Records { STRUCT records[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Copied { uint copied[]; };

uniform uint count;

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    STRUCT record = records[index];
    uint at = index * uint(COMPONENTS);
#include "fields"
}
