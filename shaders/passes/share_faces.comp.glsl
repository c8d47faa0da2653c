// SPDX-License-Identifier: GPL-3.0-or-later
// Indirect light that voxel faces receive, shared with the faces next to them, and what they make of it. A few links for each
// face are noise, and the noise of faces stays in the picture however many passes it gets. Light that comes from far is
// nearly the same a cell further on.
// Two faces give each other the same share of the difference, so that their sum stays what it is (nearly, on slopes, where
// a face may be nobody's neighbour); nothing where one is turned away or hidden from the other.
// Input: faces, triangles of cells, face_radiance_tex: indirect light, and injected light.
// Output: radiance_img, W/(m2 sr).

#include "lib/radiance.glsl"
#include "lib/face.glsl"

layout(local_size_x = GROUP_SIZE) in;

#if HAS_INJECTED
layout(binding = TEX_FACE_IRRADIANCE) uniform usampler2D face_irradiance_tex;
#endif
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D radiance_img;

uniform uint face_first;  // of this dispatch
uniform uint face_count;  // of all

const float ALIKE = 0.95;       // cosine between normals of faces that share
const float OFF_PLANE = 0.25;   // how far off the tangent plane the other's place may lie, against how far away it is

// The face whose surface is one cell further along a step in the tangent plane; NONE_INDEX: none that is alike and seen.
uint neighbour(vec3 position, vec3 normal, vec3 step, uint seed)
{
    ivec3 cell = ivec3(floor(position + step));
    uint index = cell_index(cell);
    uint face = index == NONE_INDEX ? NONE_INDEX : find_face(index, cell, normal, position, false);
    if (face == NONE_INDEX) {
        return NONE_INDEX;
    }
    vec3 there;
    vec3 normal_there;
    fetch_face_place(face, there, normal_there);
    vec3 from = position + normal * RAY_START;
    vec3 apart = there + normal_there * RAY_START - from;
    float distance = max(length(apart), 1e-6);
    bool alike = dot(normal, normal_there) > ALIKE && abs(dot(apart, normal)) < OFF_PLANE * distance;
    return alike && !is_blocked(from, apart / distance, distance, seed) ? face : NONE_INDEX;
}

void main()
{
    uint face = face_first + invocation_index();
    if (face >= face_count) {
        return;
    }
    vec3 position;
    vec3 normal;
    fetch_face_place(face, position, normal);
    // Steps of one cell along two axes of the grid, in the tangent plane.
    int axis = dominant_axis(normal);
    int right = (axis + 1) % 3;
    int up = (axis + 2) % 3;
    vec3 step_right = vec3(0.0);
    vec3 step_up = vec3(0.0);
    step_right[right] = 1.0;
    step_right[axis] = -normal[right] / normal[axis];
    step_up[up] = 1.0;
    step_up[axis] = -normal[up] / normal[axis];

    uint seed = face_seed(face);
    vec3 own = face_radiance(face);
    vec3 incoming = own;
    for (int k = 0; k < 8; ++k) {
        int bin = k < 4 ? k : k + 1;
        ivec2 at = ivec2(bin % 3, bin / 3) - 1;
        uint other = neighbour(position, normal, float(at.x) * step_right + float(at.y) * step_up, seed);
        float weight = other == NONE_INDEX ? 0.0 : (at.x == 0 || at.y == 0 ? 2.0 : 1.0) / 16.0;
        incoming += weight * (face_radiance(other) - own);
    }
#if HAS_INJECTED
    incoming += unpack_light(texelFetch(face_irradiance_tex, list_texel(face), 0).rg);
#endif
    imageStore(radiance_img, list_texel(face), pack_light(fetch_face_reflectance(face).rgb * incoming));
}
