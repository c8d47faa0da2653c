// SPDX-License-Identifier: GPL-3.0-or-later
// The sparse voxel grid: cells of side 1 in grid space, bricks of 4x4x4 cells, one bit a cell.
// Grid space is world space shifted and scaled (same axes): cell (0,0,0) fills [0,1]^3.
//     position_ws = position_grid * cell_size + grid_origin_ws
// Where there are nested levels, the cells are those of their stack (lib/level.glsl).
// Occupied cells are numbered brick by brick (x fastest), in a brick by bit: x + 4 y + 16 z.

#include "lib/common.glsl"
#include "lib/source.glsl"
#include "lib/level.glsl"

uniform ivec3 grid_size;  // cells, a multiple of BRICK on each axis

// Of each brick: two words with a bit for each cell, index of its first occupied cell, and how far it is empty from there
// on: the side (bricks) of an empty cube that begins with it, four bits for each octant it may extend into, which bits of
// the octant's number stand for: 1 down along x, 2 down along y, 4 down along z.
SOURCE_3D(TEX_BRICKS, SOURCE_BRICKS, rgba32ui) bricks_tex;

// First bit of the size of that cube, for rays that go down along these axes.
int octant_bit(bvec3 down)
{
    return 4 * (int(down.x) + 2 * int(down.y) + 4 * int(down.z));
}

uint brick_bit(ivec3 cell)
{
    ivec3 c = cell & (BRICK - 1);
    return uint(c.x | (c.y << 2) | (c.z << 4));
}

bool inside_grid(ivec3 cell)
{
    return all(lessThan(uvec3(cell), uvec3(grid_size)));  // what is below 0 is large without a sign
}

// The cell that holds a place. Nested levels: that next to it where none does.
ivec3 cell_at(vec3 position)
{
#if LEVELS
    int level = level_of(position);
    ivec3 cell = ivec3(floor(position / level_side(level)));
    return to_stack(clamp(cell, level_first[level].xyz, level_end[level] - 1), level);
#else
    return ivec3(floor(position));
#endif
}

// The cell that holds a place, or that next to it.
ivec3 nearest_cell(vec3 position)
{
    return clamp(cell_at(position), ivec3(0), grid_size - 1);
}

// Where in a cell a place lies, in sides of the cell; it may lie outside.
vec3 place_in_cell(vec3 position, ivec3 cell)
{
    int level = level_of_cell(cell);
    return position / level_side(level) - vec3(from_stack(cell, level));
}

// Index of the occupied cell that `bit` of `brick` stands for: occupied cells before it, plus the brick's first.
uint occupied_cell_index(uvec4 brick, uint bit)
{
    uint below = (1u << (bit & 31u)) - 1u;
    return brick.z + (bit < 32u ? bitCount(brick.x & below) : bitCount(brick.x) + bitCount(brick.y & below));
}

// Index of `cell`, or NONE_INDEX when it is empty or outside.
uint cell_index(ivec3 cell)
{
    if (!inside_grid(cell)) {
        return NONE_INDEX;
    }
    uint bit = brick_bit(cell);
    uvec4 brick = fetch_source(bricks_tex, cell / BRICK);
    uint word = bit < 32u ? brick.x : brick.y;
    return (word >> (bit & 31u) & 1u) == 0u ? NONE_INDEX : occupied_cell_index(brick, bit);
}

// Facings are numbered +x -x +y -y +z -z.
vec3 facing_vector(uint facing)
{
    vec3 axis = vec3(0.0);
    axis[int(facing >> 1)] = (facing & 1u) == 0u ? 1.0 : -1.0;
    return axis;
}

// Cells have a record (rgba32ui): first triangle, triangle count, first face, and what faces there are: a bit for each
// facing, and six more for those beyond the plane that cuts the cell, if one does; axis + 1 of the cut << 12, where it is
// << 14, in 1 / CUT_UNITS of the cell's side. With CUT_IS_ASLANT it is the plane of a triangle: instead of axis + 1 there
// is ONE_CUT, and then which triangle of the cell's list it is, or else there is a second plane: 1 + whether beyond the first
// faces lie beyond the second, then which triangle of the list each is (5 bits), then whether before the first faces lie
// beyond the second (lib/cut.glsl). From HIDDEN_SHIFT on the last two words say, for faces before the plane and
// for those beyond it, which of the cells beside are hidden from them: a bit for each, by the facing that looks there.

const float CUT_UNITS = 255.0;

// Index of a cell's face, given the number of its bit: faces of a cell follow each other in the order of their bits.
uint face_index(uvec4 record, uint bit)
{
    return (record.z & FIRST_FACE_MASK) + bitCount(record.w & ((1u << bit) - 1u));
}

uint facing_of_bit(uint bit)
{
    return bit < 6u ? bit : bit - 6u;
}

// What is hidden from the faces on the side of the cell that `bit` is on.
uint hidden_cells(uvec4 record, uint bit)
{
    return (bit < 6u ? record.z : record.w) >> HIDDEN_SHIFT;
}

// Bits of the cells beside along the axes on which a cell lies `apart`.
uint bits_towards(ivec3 apart)
{
    uvec3 up = uvec3(greaterThan(apart, ivec3(0))), down = uvec3(lessThan(apart, ivec3(0)));
    uvec3 bits = uvec3(1u, 4u, 16u) * (up | down << 1);
    return bits.x | bits.y | bits.z;
}

// Axis that the cut is perpendicular to; -1: the cell is not cut. (What it is where a cell is cut aslant means nothing.)
int cut_axis(uvec4 record)
{
    return int(record.w >> 12 & 3u) - 1;
}

float cut_place(uvec4 record)
{
    return float(record.w >> 14 & 255u) / CUT_UNITS;
}
