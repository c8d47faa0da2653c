// SPDX-License-Identifier: GPL-3.0-or-later
// Faces side by side on one surface.

#include "lib/radiance.glsl"
#include "lib/face.glsl"

struct Surroundings {
    vec3 position;  // of a face
    vec3 normal;
    vec3 right;     // steps of one cell along two axes of the grid, in the tangent plane
    vec3 up;
    int level;      // whose cells
};

Surroundings surroundings(uint face)
{
    Surroundings around;
    fetch_face_place(face, around.position, around.normal);
    vec3 normal = around.normal;
    int axis = dominant_axis(normal);
    int right = (axis + 1) % 3;
    int up = (axis + 2) % 3;
    around.level = level_of(around.position);
    around.right = around.up = vec3(0.0);
    around.right[right] = 1.0;
    around.right[axis] = -normal[right] / normal[axis];
    around.up[up] = 1.0;
    around.up[axis] = -normal[up] / normal[axis];
    around.right *= level_side(around.level);
    around.up *= level_side(around.level);
    return around;
}

// Steps to the neighbours, k in 0..7: those along one axis first.
ivec2 neighbour_step(int k)
{
    ivec2 along = ivec2(k < 2 ? 1 - 2 * k : 0, k < 2 ? 0 : 5 - 2 * k);
    return k < 4 ? along : ivec2(1 - 2 * (k & 1), 1 - (k & 2));
}

// One cell further on the surface, as the tangent plane goes on.
vec3 place_beside(Surroundings around, ivec2 step)
{
    return around.position + (float(step.x) * around.right + float(step.y) * around.up);
}

// The face that has the surface in the cell of such a place. Across the border of a level there is none: two faces give each
// other the same share only where each is the other's neighbour.
FoundFace face_in(Surroundings around, ivec3 cell, uvec4 record)
{
    Sides sides = sides_of(record, cell, around.position, around.position, around.normal);
    FoundFace found = find_face_of(record, cell, around.normal, sides.beyond.x, sides.strays.x, false);
    found.bit = level_of_cell(cell) == around.level ? found.bit : NONE_INDEX;
    return found;
}

FoundFace face_beside(Surroundings around, ivec2 step)
{
    ivec3 cell = cell_at(place_beside(around, step));
    return face_in(around, cell, record_of(cell));
}
