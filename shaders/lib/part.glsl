// SPDX-License-Identifier: GPL-3.0-or-later
// What a triangle brings to a cell, while the scene is voxelized.
//
// A pair says which triangle enters which cell, with the area and the centre of what is inside:
//     triangle | cell: x, y << 11, z << 22 | area (float) | centre in the cell, 10 bits each, axis of the normal << 30
// In stacks of LEVELS, which are high, the cell is x, y << 9, z << 18.
// A part is what the pair adds to a face: area, area x reflectance and area x centre, in units of 1 / FIXED_ONE.
// Nothing flat inside a cell is larger than two of its sides, so each takes 17 bits.

#include "lib/common.glsl"

// Bits of x and y in positions of cells: stacks of levels are high.
#if LEVELS
const int CELL_BITS = 9;
#else
const int CELL_BITS = 11;
#endif
const uint CELL_MASK = (1u << CELL_BITS) - 1u;

uvec4 pack_pair(uint triangle, ivec3 cell, float area, vec3 centre, int axis)
{
    uvec3 c = uvec3(clamp(centre, 0.0, 1.0) * 1023.0 + 0.5);
    return uvec4(triangle, uint(cell.x | cell.y << CELL_BITS | cell.z << 2 * CELL_BITS), floatBitsToUint(area),
                 c.x | c.y << 10 | c.z << 20 | uint(axis) << 30);
}

// Positions of cells are packed alike wherever they are listed.
ivec3 unpack_cell(uint packed_cell)
{
    return ivec3(packed_cell & CELL_MASK, packed_cell >> CELL_BITS & CELL_MASK, packed_cell >> 2 * CELL_BITS);
}

ivec3 pair_cell(uvec4 pair)
{
    return unpack_cell(pair.y);
}

vec3 pair_centre(uvec4 pair)
{
    return vec3(pair.w & 1023u, pair.w >> 10 & 1023u, pair.w >> 20 & 1023u) / 1023.0;
}

int pair_axis(uvec4 pair)
{
    return int(pair.w >> 30);
}

struct Part {
    uint facing;
    uint area;
    uvec3 reflectance;
    uvec3 position;
};

uvec4 pack_part(Part part)
{
    uint area = min(part.area, 0x1FFFFu);
    uvec3 r = min(part.reflectance, 0x1FFFFu);
    uvec3 p = min(part.position, 0x1FFFFu);
    uvec3 high = r >> 16 | p >> 16 << 3;
    return uvec4((r & 0xFFFFu) | p << 16,
                 area | high.x << 17 | high.y << 18 | high.z << 19 | part.facing << 23);
}

Part unpack_part(uvec4 stored)
{
    Part part;
    part.area = stored.w & 0x1FFFFu;
    part.reflectance = (stored.xyz & 0xFFFFu) | (stored.www >> uvec3(17u, 18u, 19u) & 1u) << 16;
    part.position = stored.xyz >> 16 | (stored.www >> uvec3(20u, 21u, 22u) & 1u) << 16;
    part.facing = stored.w >> 23;
    return part;
}
