// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance that leaves voxel faces, looked up where a ray has met a surface.

#include "lib/trace.glsl"

layout(binding = TEX_FACE_RADIANCE) uniform sampler2D face_radiance_tex;

// The facing that stands for unit normal n: chosen with probability n_axis^2, which sums to 1.
uint choose_facing(vec3 n, float random)
{
    vec3 p = n * n;
    int axis = random < p.x ? 0 : (random < p.x + p.y ? 1 : 2);
    return uint(2 * axis) + (n[axis] < 0.0 ? 1u : 0u);
}

// A face of occupied cell `index` for a surface with normal n; NONE_INDEX when the cell has none that looks that way.
uint find_face(uint index, vec3 n, float random)
{
    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    uint facing = choose_facing(n, random);
    if ((record.w >> facing & 1u) == 0u) {
        // Rounding can leave out the least of three facings: take the one that looks most along n.
        facing = choose_facing(n, 0.0);
        float best = 0.0;
        for (uint other = 0u; other < 6u; ++other) {
            float along = dot(facing_vector(other), n);
            if ((record.w >> other & 1u) != 0u && along > best) {
                best = along;
                facing = other;
            }
        }
        if (best == 0.0) {
            return NONE_INDEX;
        }
    }
    return face_index(record, facing);
}

// The voxel face that stands for the surface at a hit. Looking it up at a point moved by up to half a cell along the
// surface gives, on average, the linear interpolation between neighbouring faces.
uint face_at_hit(vec3 position, Hit hit, uint seed)
{
    vec3 random = unit_vec3(seed);
    float choice = unit_float(hash(seed, 0x51ED27u));
    vec3 shift = random - 0.5;
    vec3 moved = position + shift - hit.normal * dot(shift, hit.normal);
    uint index = cell_index(ivec3(floor(moved)));
    uint face = index == NONE_INDEX ? NONE_INDEX : find_face(index, hit.normal, choice);
    if (face == NONE_INDEX) {
        index = cell_index(ivec3(floor(position)));
        if (index == NONE_INDEX) {
            index = cell_index(hit.cell);
        }
        face = index == NONE_INDEX ? NONE_INDEX : find_face(index, hit.normal, choice);
    }
    return face;
}

vec3 face_radiance(uint face)
{
    return face == NONE_INDEX ? vec3(0.0) : texelFetch(face_radiance_tex, list_texel(face), 0).rgb;
}
