// SPDX-License-Identifier: GPL-3.0-or-later
// Nested levels: boxes of cells around the camera, each of cells twice as wide as those of the one inside it. A place
// belongs to the finest level whose box holds it: what a finer one covers is a hole in the others, of whole bricks.
// Level k has cells of side 2^k, numbered from the origin of grid space, so that cell c of level k + 1 holds 2 c and 2 c + 1.
// The boxes are stacked along z, and everything that is listed cell by cell knows cells of that stack alone.
//
// The including program gets the define
//     LEVELS  how many there are; 0: a single grid, of cells of side 1

#include "lib/common.glsl"

#if LEVELS
uniform ivec4 level_first[LEVELS];  // lowest cell; w: z in the stack
uniform ivec3 level_end[LEVELS];    // beyond the highest

// The finest level that holds a place; the last one where none does.
int level_of(vec3 position)
{
    int level = LEVELS - 1;
    for (int k = LEVELS - 2; k >= 0; --k) {
        ivec3 cell = ivec3(floor(position / float(1 << k)));
        bool holds = all(greaterThanEqual(cell, level_first[k].xyz)) && all(lessThan(cell, level_end[k]));
        level = holds ? k : level;
    }
    return level;
}

// Level of a cell of the stack.
int level_of_cell(ivec3 cell)
{
    int level = 0;
    for (int k = 1; k < LEVELS; ++k) {
        level = cell.z >= level_first[k].w ? k : level;
    }
    return level;
}

// From the stack to the level's own numbers, and back.
ivec3 from_stack(ivec3 cell, int level)
{
    return cell - ivec3(0, 0, level_first[level].w) + level_first[level].xyz;
}
ivec3 to_stack(ivec3 cell, int level)
{
    return cell - level_first[level].xyz + ivec3(0, 0, level_first[level].w);
}

// Whether a cell of a level lies where a finer level is.
bool is_in_hole(ivec3 cell, int level)
{
    int finer = max(level - 1, 0);
    return level > 0 && all(greaterThanEqual(cell, level_first[finer].xyz >> 1)) &&
           all(lessThan(cell, level_end[finer] >> 1));
}
#else
int level_of(vec3 position) { return 0; }
int level_of_cell(ivec3 cell) { return 0; }
ivec3 from_stack(ivec3 cell, int level) { return cell; }
ivec3 to_stack(ivec3 cell, int level) { return cell; }
#endif

// Side of a level's cells.
float level_side(int level)
{
    return float(1 << level);
}

// Side of the cell that holds a place.
float cell_side(vec3 position)
{
    return level_side(level_of(position));
}

// How far along the normal a ray starts above the surface that it leaves there.
float ray_start(vec3 position)
{
    return RAY_START * cell_side(position);
}
