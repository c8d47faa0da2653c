// SPDX-License-Identifier: GPL-3.0-or-later
// The sparse voxel grid: cells of side 1 in grid space, bricks of 4x4x4 cells, one bit a cell.
// Grid space is world space shifted and scaled (same axes): cell (0,0,0) fills [0,1]^3.
//     position_ws = position_grid * cell_size + grid_origin_ws
// Occupied cells are numbered brick by brick (x fastest), in a brick by bit: x + 4 y + 16 z.

#include "lib/common.glsl"

uniform ivec3 grid_size;  // cells, a multiple of BRICK on each axis

layout(binding = TEX_BRICK_MASK) uniform usampler3D brick_mask_tex;
layout(binding = TEX_BRICK_BASE) uniform usampler3D brick_base_tex;

uint brick_bit(ivec3 cell)
{
    ivec3 c = cell & (BRICK - 1);
    return uint(c.x | (c.y << 2) | (c.z << 4));
}

// Where the word with the bit of `cell` is in the mask volume.
ivec3 mask_texel(ivec3 cell, uint bit)
{
    ivec3 brick = cell / BRICK;
    return ivec3(2 * brick.x + int(bit >> 5), brick.yz);
}

bool inside_grid(ivec3 cell)
{
    return all(greaterThanEqual(cell, ivec3(0))) && all(lessThan(cell, grid_size));
}

// Index of an occupied cell, whose bit is set in `word`.
uint occupied_cell_index(ivec3 cell, uint bit, uint word)
{
    ivec3 brick = cell / BRICK;
    uint before = bitCount(word & ((1u << (bit & 31u)) - 1u));
    if (bit >= 32u) {
        before += bitCount(texelFetch(brick_mask_tex, ivec3(2 * brick.x, brick.yz), 0).r);
    }
    return texelFetch(brick_base_tex, brick, 0).r + before;
}

// Index of `cell`, or NONE_INDEX when it is empty or outside.
uint cell_index(ivec3 cell)
{
    if (!inside_grid(cell)) {
        return NONE_INDEX;
    }
    uint bit = brick_bit(cell);
    uint word = texelFetch(brick_mask_tex, mask_texel(cell, bit), 0).r;
    if ((word >> (bit & 31u) & 1u) == 0u) {
        return NONE_INDEX;
    }
    return occupied_cell_index(cell, bit, word);
}

// Facings are numbered +x -x +y -y +z -z.
vec3 facing_vector(uint facing)
{
    vec3 axis = vec3(0.0);
    axis[int(facing >> 1)] = (facing & 1u) == 0u ? 1.0 : -1.0;
    return axis;
}

// Index of a cell's face: faces of a cell follow each other in the order of their bits in the mask.
uint face_index(uvec4 cell_record, uint facing)
{
    return cell_record.z + bitCount(cell_record.w & ((1u << facing) - 1u));
}
