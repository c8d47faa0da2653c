// SPDX-License-Identifier: GPL-3.0-or-later
// Nothing but fetches: each thread makes FETCHES of one KIND, from entries all over the source, and keeps what they sum
// up to. What a tracing kernel can reach at most.
//
// KIND is one of KIND_LIST: four words of a list, as rays read cells and triangles (lib/source.glsl); KIND_BYTE: one byte of
// a 3D texture; KIND_TRILINEAR: eight texels of a 3D texture of half floats, interpolated; KIND_BUFFER: a word of a buffer.

#include "lib/common.glsl"
#include "lib/source.glsl"

layout(local_size_x = GROUP_SIZE) in;

#if KIND == KIND_LIST
SOURCE_2D(TEX_CELLS, SOURCE_CELLS, rgba32ui) source;
#elif KIND == KIND_BYTE
layout(binding = TEX_CELLS) uniform usampler3D source;
#elif KIND == KIND_TRILINEAR
layout(binding = TEX_CELLS) uniform sampler3D source;
#else
layout(std430, binding = BUF_WORK) readonly buffer Source { uint source[]; };
#endif
layout(std430, binding = BUF_RESULTS) writeonly buffer Results { uint results[]; };

uniform uint entries;  // a power of two

void main()
{
    uint thread = invocation_index();
    uint at = hash(thread);
    uint sum = 0u;
    for (uint i = 0u; i < uint(FETCHES); ++i) {
        at += 0x9E3779B1u;
        uint entry = at & (entries - 1u);
#if KIND == KIND_LIST
        uvec4 found = fetch_source(source, list_texel(entry));
        sum += found.x + found.y + found.z + found.w;
#elif KIND == KIND_BYTE
        sum += texelFetch(source, ivec3(entry & 127u, entry >> 7 & 127u, entry >> 14), 0).r;
#elif KIND == KIND_TRILINEAR
        vec4 found = textureLod(source, vec3(entry & 127u, entry >> 7 & 127u, entry >> 14) / 127.3, 0.0);
        sum += floatBitsToUint(found.x + found.y + found.z + found.w);
#else
        sum += source[entry];
#endif
    }
    results[thread] = sum;
}
