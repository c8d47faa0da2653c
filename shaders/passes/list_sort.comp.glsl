// SPDX-License-Identifier: GPL-3.0-or-later
// Entries of long lists in their order.
// Input: work (entry, place of what belongs there in copies of the lists), copies.    Output: lists of cells.

#include "lib/common.glsl"
#include "lib/source.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Work { uvec2 work[]; };
#if HAS_INSTANCES
SOURCE_2D(TEX_CELL_TRIANGLES, SOURCE_CELL_TRIANGLES, rg32ui) cell_triangles_tex;
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D cell_triangle_img;
#else
SOURCE_2D(TEX_CELL_TRIANGLES, SOURCE_CELL_TRIANGLES, r32ui) cell_triangles_tex;
layout(binding = IMG_0, r32ui) writeonly uniform uimage2D cell_triangle_img;
#endif
#if HAS_FACES
SOURCE_2D(TEX_PARTS, SOURCE_PARTS, rgba32ui) parts_tex;
layout(binding = IMG_1, rgba32ui) writeonly uniform uimage2D part_img;
#endif
#if HAS_OUTLINES
layout(binding = TEX_CELL_OPACITIES) uniform usampler2D cell_opacities_tex;
layout(binding = IMG_2, rg32ui) writeonly uniform uimage2D cell_opacity_img;
#elif HAS_OPACITY
layout(binding = TEX_CELL_OPACITIES) uniform sampler2D cell_opacities_tex;
layout(binding = IMG_2, r8) writeonly uniform image2D cell_opacity_img;
#endif

uniform uint work_count;

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    ivec2 to = list_texel(work[number].x), from = list_texel(work[number].y);
    imageStore(cell_triangle_img, to, fetch_source(cell_triangles_tex, from));
#if HAS_FACES
    imageStore(part_img, to, fetch_source(parts_tex, from));
#endif
#if HAS_OPACITY
    imageStore(cell_opacity_img, to, texelFetch(cell_opacities_tex, from, 0));
#endif
}
