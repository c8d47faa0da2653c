// SPDX-License-Identifier: GPL-3.0-or-later
// Which faces an edit of the scene may have changed the light of, where the others are taken over: those that are new,
// and those with a ray that crosses a box around what was edited. They are listed.

#include "lib/changed_boxes.glsl"

layout(binding = TEX_NUMBERS_BEFORE) uniform usampler2D numbers_before_tex;
layout(binding = IMG_1, r32ui) writeonly uniform uimage2D changed_img;
layout(std430, binding = BUF_COUNTS) buffer Counters { uint changed_count; };

// Number of a face in the lists before; NONE_INDEX: it is new.
uint number_before(uint face)
{
    return texelFetch(numbers_before_tex, list_texel(face), 0).r;
}

// As the order of all faces lists them (lib/site.glsl).
void list_changed(uint face, uint facing)
{
    imageStore(changed_img, list_texel(atomicAdd(changed_count, 1u)), uvec4(face | facing << FACING_SHIFT));
}
