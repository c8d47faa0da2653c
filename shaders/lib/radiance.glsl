// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that leaves voxel faces, looked up where a ray has met a surface.

#include "lib/trace.glsl"
#include "lib/packed_light.glsl"

layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;

// A face of occupied cell `index` for a surface with normal n: the one that looks most along n; NONE_INDEX when none does
// within 60 degrees. (A normal is within 55 degrees of the axis it is nearest to.)
uint find_face(uint index, vec3 n)
{
    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    uint facing = NONE_INDEX;
    float best = 0.5;
    for (uint other = 0u; other < 6u; ++other) {
        float along = dot(facing_vector(other), n);
        bool better = has_facing(record, other) && along > best;
        facing = better ? other : facing;
        best = better ? along : best;
    }
    return facing == NONE_INDEX ? NONE_INDEX : face_index(record, facing);
}

// The voxel face that stands for the surface at a hit. Looking it up at a point moved by up to half a cell along the
// surface gives, on average, the linear interpolation between neighbouring faces.
uint face_at_hit(vec3 position, Hit hit, uint seed)
{
    vec3 random = unit_vec3(seed);
    vec3 shift = random - 0.5;
    vec3 moved = position + shift - hit.normal * dot(shift, hit.normal);
    uint index = cell_index(ivec3(floor(moved)));
    uint face = index == NONE_INDEX ? NONE_INDEX : find_face(index, hit.normal);
    if (face == NONE_INDEX) {
        index = cell_index(ivec3(floor(position)));
        if (index == NONE_INDEX) {
            index = cell_index(hit.cell);
        }
        face = index == NONE_INDEX ? NONE_INDEX : find_face(index, hit.normal);
    }
    return face;
}

vec3 face_radiance(uint face)
{
    return face == NONE_INDEX ? vec3(0.0) : unpack_light(texelFetch(face_radiance_tex, list_texel(face), 0).rg);
}
