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
    precise float rise_right = -normal[right] / normal[axis], rise_up = -normal[up] / normal[axis];
    around.right = around.up = vec3(0.0);
    around.right[right] = 1.0;
    around.right[axis] = rise_right;
    around.up[up] = 1.0;
    around.up[axis] = rise_up;
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

// One cell further on the surface, as the tangent plane goes on. The same bits in every program: one finds the face there
// (pass partners) that another fetches.
vec3 place_beside(Surroundings around, ivec2 step)
{
    precise vec3 place = around.position + (float(step.x) * around.right + float(step.y) * around.up);
    return place;
}

// The face whose surface is one cell further. Across the border of a level there is none: two faces give each other the same
// share only where each is the other's neighbour.
FoundFace face_beside(Surroundings around, ivec2 step)
{
    vec3 place = place_beside(around, step);
    FoundFace found = find_face(cell_at(place), around.normal, around.position, false);
    found.bit = level_of(place) == around.level ? found.bit : NONE_INDEX;
    return found;
}
