// SPDX-License-Identifier: GPL-3.0-or-later
// While guides are made: which they are, and their bins.

#include "lib/hemisphere.glsl"

layout(std430, binding = BUF_WORK) readonly buffer GuideWorkList { uint guide_work[]; };  // number of the brick << 3 | facing

uniform ivec3 brick_count;
uniform uint guide_first;  // of this dispatch
uniform uint guide_count;  // of all
// GUIDE_BINS; ends loops, which compilers would unroll if they knew it: that takes LLVM longer than all guides of a scene.
uniform int bin_count;

const int GUIDE_BINS = GUIDE_SIDE * GUIDE_SIDE;

// A bin: sum of what light counts, and over how many links. Packed: their mean, the upper 20 bits of a float that is not below
// 0, and 12 bits of how many; sums of a few links know no more.
uint pack_bin(vec2 bin)
{
    uint mean = floatBitsToUint(bin.x / max(bin.y, 1.0)) + (1u << 10);
    return mean >> 11 << 12 | min(uint(bin.y), 4095u);
}

vec2 unpack_bin(uint packed_bin)
{
    float count = float(packed_bin & 4095u);
    return vec2(uintBitsToFloat(packed_bin >> 12 << 11) * count, count);
}

struct GuideWork {
    ivec3 brick;
    uint facing;
};

GuideWork fetch_guide_work(uint number)
{
    uint entry = guide_work[number];
    int index = int(entry >> 3);
    ivec2 sides = brick_count.xy;
    return GuideWork(ivec3(index % sides.x, index / sides.x % sides.y, index / (sides.x * sides.y)), entry & 7u);
}
