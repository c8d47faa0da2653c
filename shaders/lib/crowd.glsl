// SPDX-License-Identifier: GPL-3.0-or-later
// Sums over the triangles of a crowded cell: one that lists more than CROWD. Threads add up a run of the list each, and
// add that to the cell's sums; they are integers, so that it does not matter who comes first.
//
// The including program defines
//     IS_CROWDED  1: works on one crowded cell, whose sums are in a buffer; 0: on all others

#include "lib/part.glsl"

// What the surfaces of a cell that are nearest to a facing bring to it.
struct FacingSums {
    uint area;
    uvec3 reflectance;
    uvec3 position;
};

const FacingSums NO_SUMS = FacingSums(0u, uvec3(0u), uvec3(0u));

#if IS_CROWDED

uniform uint crowd;  // number of the cell among the crowded ones

// CROWD_WORDS for each cell: seven for each facing, those of FacingSums; axes that surfaces face, a bit each; then what
// pass voxel_cut sums up besides.
layout(std430, binding = BUF_RESULTS) buffer CrowdSums { uint crowd_sums[]; };

const uint CROWD_AXES = 42u;
const uint CROWD_CUT = 43u;

void add_to_crowd(uint word, uint value)
{
    if (value != 0u) {
        atomicAdd(crowd_sums[CROWD_WORDS * crowd + word], value);
    }
}

void add_to_crowd(uint word, uvec3 value)
{
    for (uint k = 0u; k < 3u; ++k) {
        add_to_crowd(word + k, value[k]);
    }
}

void add_to_crowd(Part part)
{
    uint word = 7u * part.facing;
    add_to_crowd(word, part.area);
    add_to_crowd(word + 1u, part.reflectance);
    add_to_crowd(word + 4u, part.position);
    atomicOr(crowd_sums[CROWD_WORDS * crowd + CROWD_AXES], 1u << (part.facing >> 1));
}

uint crowd_sum(uint word)
{
    return crowd_sums[CROWD_WORDS * crowd + word];
}

uvec3 crowd_sum3(uint word)
{
    return uvec3(crowd_sum(word), crowd_sum(word + 1u), crowd_sum(word + 2u));
}

FacingSums crowd_facing(uint facing)
{
    uint word = 7u * facing;
    return FacingSums(crowd_sum(word), crowd_sum3(word + 1u), crowd_sum3(word + 4u));
}

#endif
