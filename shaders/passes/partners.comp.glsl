// SPDX-License-Identifier: GPL-3.0-or-later
// With which of the eight faces around it a voxel face shares indirect light (pass share_faces). Two faces find each other
// (nearly, on slopes, where a face may be nobody's neighbour); none where one is turned away or hidden from the other.
// Input: faces to ask for, faces, cells, triangles of cells.
// Output: partners_img: four bits for each of the eight: 0: not with it; else 1 + the number of its bit in its cell's record.

#include "lib/neighbour.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Asked { uint asked[]; };  // faces, if not all
layout(binding = IMG_0, r32ui) writeonly uniform uimage2D partners_img;

uniform uint work_count;
uniform bool asks_all;

const float ALIKE = 0.95;       // cosine between normals of faces that share
const float OFF_PLANE = 0.25;   // how far off the tangent plane the other's place may lie, against how far away it is

// The face itself, and the plane that cuts its cell, if one does aslant.
struct Here {
    FoundFace found;
    CutPlane cut;
};

Here find_here(Surroundings around)
{
    FoundFace found = find_face(cell_at(around.position), around.normal, around.position, true);
    Here here = Here(found, CutPlane(vec3(0.0), vec3(0.0), 0));
    if (is_aslant(found.record)) {
        here.cut = listed_plane(cut_entry(found.record), around.level);
    }
    return here;
}

bool is_alike(Surroundings around, Here here, uint face)
{
    vec3 there;
    vec3 normal_there;
    fetch_face_place(face, there, normal_there);
    vec3 apart = there - around.position;
    bool is_beyond = height_above(here.cut, there / level_side(around.level) + normal_there * CUT_LIFT) > 0.0;
    bool is_parted = is_aslant(here.found.record) && is_beyond != (here.found.bit >= 6u);
    return !is_parted && dot(around.normal, normal_there) > ALIKE &&
           abs(dot(apart, around.normal)) < OFF_PLANE * length(apart);
}

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    uint face = asks_all ? number : asked[number];
    Surroundings around = surroundings(face);
    Here here = find_here(around);
    uint partners = 0u;
    int k = 0;
    do {
        FoundFace beside = face_beside(around, neighbour_step(k));
        uint other = face_number(beside);
        bool shares = other != NONE_INDEX && !is_hidden(here.found, beside) && is_alike(around, here, other);
        partners |= shares ? beside.bit + 1u << 4 * k : 0u;
    } while (++k < 8);
    imageStore(partners_img, list_texel(face), uvec4(partners));
}
