// SPDX-License-Identifier: GPL-3.0-or-later
// Levels of the volume that cones read. FIRST: level 0 from the voxel faces.    Otherwise: a level from the finer one.
// A surface of area A and normal n is opacity A max(0, n.d) / s^2 for facing d in a cell of side s, so a coarser cell holds
// a quarter of the sum of its eight children: means over the columns, sums along the axis.
// Input: cells, faces, their radiance; or the finer level.    Output: level_img: (opacity L, opacity).

#include "lib/grid.glsl"
#include "lib/face.glsl"
#include "lib/packed_light.glsl"

layout(local_size_x = 4, local_size_y = 4, local_size_z = 4) in;

layout(binding = IMG_0, rgba16f) writeonly uniform image3D level_img;
#if FIRST
SOURCE_2D(TEX_CELLS, SOURCE_CELLS, rgba32ui) cells_tex;
layout(binding = TEX_FACE_RADIANCE) uniform usampler2D face_radiance_tex;
#else
layout(binding = TEX_CONES) uniform sampler3D cones_tex;
uniform int finer_level;
#endif

uniform ivec3 level_size;    // cells of this level, one facing
uniform int level_stride;    // from one facing to the next
uniform int children;        // cells on a side that one cell is made of

const float MAX_OPACITY = 4.0;  // layers that one cell can hold

#if FIRST
// Whether any cell of a box is occupied, as far as whole bricks tell.
bool may_be_occupied(ivec3 first, ivec3 last)
{
    ivec3 low = first / BRICK;
    ivec3 high = min(last, grid_size - 1) / BRICK;
    uint found = 0u;
    for (int z = low.z; z <= high.z; ++z)
    for (int y = low.y; y <= high.y; ++y)
    for (int x = low.x; x <= high.x; ++x) {
        uvec4 brick = fetch_source(bricks_tex, ivec3(x, y, z));
        found |= brick.x | brick.y;
    }
    return found != 0u;
}
#endif

void main()
{
    ivec3 cell = ivec3(gl_GlobalInvocationID);
    if (any(greaterThanEqual(cell, level_size))) {
        return;
    }
    vec4 sums[6] = vec4[6](vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    ivec3 first = cell * children;
    int count = children;
#if FIRST
    count = may_be_occupied(first, first + children - 1) ? children : 0;
#endif
    for (int z = 0; z < count; ++z)
    for (int y = 0; y < count; ++y)
    for (int x = 0; x < count; ++x) {
        ivec3 child = first + ivec3(x, y, z);
#if FIRST
        uint index = cell_index(child);
        uvec4 record = index == NONE_INDEX ? uvec4(0u) : fetch_source(cells_tex, list_texel(index));
        uint first = record.z & FIRST_FACE_MASK;
        uint end = first + bitCount(record.w & FACING_MASK);
        for (uint face = first; face < end; ++face) {
            vec3 place, normal;
            fetch_face_place(face, place, normal);
            float area = fetch_face_reflectance(face).a;
            vec4 light = vec4(unpack_light(texelFetch(face_radiance_tex, list_texel(face), 0).rg), 1.0);
            for (int facing = 0; facing < 6; ++facing) {
                sums[facing] += area * max(dot(normal, facing_vector(uint(facing))), 0.0) * light;
            }
        }
#else
        for (int facing = 0; facing < 6; ++facing) {
            sums[facing] += texelFetch(cones_tex, child + ivec3(0, 0, facing * level_stride * children), finer_level);
        }
#endif
    }
    for (int facing = 0; facing < 6; ++facing) {
        vec4 sum = sums[facing] / float(children * children);
        sum *= MAX_OPACITY / max(sum.a, MAX_OPACITY);
        imageStore(level_img, cell + ivec3(0, 0, facing * level_stride), clamp(sum, 0.0, 65000.0));
    }
}
