// SPDX-License-Identifier: GPL-3.0-or-later
// Bricks that are made again, where the others are taken over.

#include "lib/grid.glsl"

layout(binding = TEX_CHANGED_BRICKS) uniform usampler3D changed_bricks_tex;

bool is_made_again(ivec3 cell)
{
    return texelFetch(changed_bricks_tex, cell / BRICK, 0).r != 0u;
}
