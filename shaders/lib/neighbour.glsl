// SPDX-License-Identifier: GPL-3.0-or-later
// Faces side by side on one surface, which share the light that links have brought to them.

#include "lib/radiance.glsl"
#include "lib/face.glsl"

const float ALIKE = 0.95;       // cosine between normals of faces that share
const float OFF_PLANE = 0.25;   // how far off the tangent plane the other's place may lie, against how far away it is

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

// Steps to the neighbours, k in 0..7.
ivec2 neighbour_step(int k)
{
    int bin = k < 4 ? k : k + 1;
    return ivec2(bin % 3, bin / 3) - 1;
}

// The face whose surface is one cell further; NONE_INDEX: there is none. Across the border of a level there is none: two
// faces give each other the same share only where each is the other's neighbour.
uint face_beside(Surroundings around, int k)
{
    vec2 at = vec2(neighbour_step(k));
    vec3 position = around.position + (at.x * around.right + at.y * around.up);
    ivec3 cell = cell_at(position);
    uint index = level_of(position) == around.level ? cell_index(cell) : NONE_INDEX;
    return index == NONE_INDEX ? NONE_INDEX : find_face(index, cell, around.normal, around.position, false);
}

// Whether a face beside is alike and seen.
bool shares_light(Surroundings around, uint face, uint seed)
{
    vec3 there;
    vec3 normal_there;
    fetch_face_place(face, there, normal_there);
    vec3 from = around.position + around.normal * ray_start(around.position);
    vec3 apart = there + normal_there * ray_start(there) - from;
    float distance = max(length(apart), 1e-6);
    bool alike = dot(around.normal, normal_there) > ALIKE && abs(dot(apart, around.normal)) < OFF_PLANE * distance;
    return alike && !is_blocked(from, apart / distance, distance, seed);
}
