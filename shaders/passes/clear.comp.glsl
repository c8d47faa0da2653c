// SPDX-License-Identifier: GPL-3.0-or-later
// Nothing is seen yet: no triangle and no place at any pixel. Every other surface picture is read only where there is one.
// Output: seen_img, position_img.

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = IMG_0, r32ui) writeonly uniform uimage2D seen_img;
layout(binding = IMG_1, rgba32f) writeonly uniform image2D position_img;

uniform ivec2 picture_size;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, picture_size))) {
        imageStore(seen_img, pixel, uvec4(0u));
        imageStore(position_img, pixel, vec4(0.0));
    }
}
