// SPDX-License-Identifier: GPL-3.0-or-later
// Shift of the points that links of a face are drawn by.

#include "lib/grid.glsl"
#include "lib/hemisphere.glsl"
#include "lib/sampling.glsl"

// Neighbouring faces of a plane share the hemisphere evenly. `position`: of the face, grid space.
uvec2 link_shift(vec3 position, vec3 normal, uint random_seed)
{
    ivec3 cell = cell_at(position);
    uint facing = facing_of(normal);
    uint axis = facing >> 1;
    uint layer = uint(axis == 0u ? cell.x : (axis == 1u ? cell.y : cell.z));
    ivec2 at = axis == 0u ? cell.yz : (axis == 1u ? cell.zx : cell.xy);
    return pixel_shift(at, hash(6u * layer + facing, random_seed));
}
