// SPDX-License-Identifier: GPL-3.0-or-later
// Levels of the volume that cones read. FIRST: level 0 from the voxel faces.    Otherwise: a level from the finer one.
// A surface of area A and normal n is opacity A max(0, n.d) / s^2 for facing d in a cell of side s, so a coarser cell holds
// a quarter of the sum of its eight children: means over the columns, sums along the axis.
// Input: cells, faces, their radiance; or the finer level.    Output: level_img: (opacity L, opacity).

#include "lib/grid.glsl"
#include "lib/face.glsl"

layout(local_size_x = 4, local_size_y = 4, local_size_z = 4) in;

layout(binding = IMG_0, rgba16f) writeonly uniform image3D level_img;
#if FIRST
layout(binding = TEX_CELLS) uniform usampler2D cells_tex;
layout(binding = TEX_FACE_RADIANCE) uniform sampler2D face_radiance_tex;
#else
layout(binding = TEX_CONES) uniform sampler3D cones_tex;
uniform int finer_level;
#endif

uniform ivec3 level_size;    // cells of this level, one facing
uniform int level_stride;    // from one facing to the next
uniform int children;        // cells on a side that one cell is made of

const float MAX_OPACITY = 4.0;  // layers that one cell can hold

void main()
{
    ivec3 at = ivec3(gl_GlobalInvocationID);
    int facing = at.z / level_stride;
    ivec3 cell = ivec3(at.xy, at.z - facing * level_stride);
    if (any(greaterThanEqual(at.xy, level_size.xy)) || facing >= 6) {
        return;
    }
    vec4 sum = vec4(0.0);
    if (cell.z < level_size.z) {
        for (int z = 0; z < children; ++z)
        for (int y = 0; y < children; ++y)
        for (int x = 0; x < children; ++x) {
            ivec3 child = cell * children + ivec3(x, y, z);
#if FIRST
            uint index = cell_index(child);
            if (index != NONE_INDEX) {
                uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
                for (uint other = 0u; other < 6u; ++other) {
                    if (has_facing(record, other)) {
                        uint face = face_index(record, other);
                        vec3 place, normal;
                        fetch_face_place(face, place, normal);
                        float opacity = fetch_face_reflectance(face).a * max(dot(normal, facing_vector(uint(facing))), 0.0);
                        sum += opacity * vec4(texelFetch(face_radiance_tex, list_texel(face), 0).rgb, 1.0);
                    }
                }
            }
#else
            child.z += facing * level_stride * children;
            sum += texelFetch(cones_tex, child, finer_level);
#endif
        }
        sum /= float(children * children);
        if (sum.a > MAX_OPACITY) {
            sum *= MAX_OPACITY / sum.a;
        }
    }
    imageStore(level_img, at, clamp(sum, 0.0, 65000.0));
}
