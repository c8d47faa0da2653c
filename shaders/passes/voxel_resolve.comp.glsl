// SPDX-License-Identifier: GPL-3.0-or-later
// From sums to faces: means, and the point of the surface that each face stands for.
// Input: sums, cells with their positions, triangles.    Output: faces.

#include "lib/trace.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_SUMS) readonly buffer Sums { uint sums[]; };
layout(std430, binding = BUF_WORK) readonly buffer CellPositions { uint cell_positions[]; };  // x | y << 11 | z << 22
layout(std430, binding = BUF_FACES) writeonly buffer Faces { Face faces[]; };

uniform uint cell_count;
uniform uint sum_words;

void main()
{
    uint index = invocation_index();
    if (index >= cell_count) {
        return;
    }
    uint packed_position = cell_positions[index];
    vec3 corner = vec3(packed_position & 2047u, packed_position >> 11 & 2047u, packed_position >> 22);
    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    for (uint facing = 0u; facing < 6u; ++facing) {
        if ((record.w >> facing & 1u) == 0u) {
            continue;
        }
        uint face = face_index(record, facing);
        uint at = face * sum_words;
        float total = float(sums[at]);
        float inverse = total > 0.0 ? 1.0 / total : 0.0;
        Face result;
        result.weight = total / FIXED_ONE;
        result.reflectance = vec3(sums[at + 1u], sums[at + 2u], sums[at + 3u]) * inverse;
        vec3 n = vec3(int(sums[at + 4u]), int(sums[at + 5u]), int(sums[at + 6u]));
        result.normal = dot(n, n) > 0.0 ? normalize(n) : facing_vector(facing);
        vec3 mean = corner + vec3(sums[at + 7u], sums[at + 8u], sums[at + 9u]) * inverse;
        result.emission = vec3(0.0);
#if HAS_EMISSION
        for (int k = 0; k < 3; ++k) {
            uint word = at + FACE_SUM_WORDS + 2u * uint(k);
            result.emission[k] = (float(sums[word + 1u]) + float(sums[word]) / 4294967296.0) * inverse * FIXED_ONE;
        }
#endif
        // The mean of curved or layered surfaces lies inside them: look back at it from half a cell in front.
        Hit hit = trace(mean + 0.5 * result.normal, -result.normal, 1.0, RAY_ALL, false, 0u);
        result.position_grid = mean;
        if (hit.triangle != NONE_INDEX) {
            result.position_grid = mean + (0.5 - hit.distance) * result.normal;
            if (dot(hit.normal, result.normal) < 0.5) {
                result.normal = hit.normal;
            }
        }
        result.key = hash(packed_position, facing);
        result.cell = index;
        result.facing = facing;
        result.direct = vec3(0.0);
        result.pad = 0.0;
        faces[face] = result;
    }
}
