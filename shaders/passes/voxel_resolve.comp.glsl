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

// What the surfaces that face this way bring; weight 0 when there are none.
Face mean_face(uint face, uint facing, vec3 corner)
{
    Face result;
    uint at = face * sum_words;
    float total = float(sums[at]);
    float inverse = total > 0.0 ? 1.0 / total : 0.0;
    result.weight = total / FIXED_ONE;
    result.reflectance = vec3(sums[at + 1u], sums[at + 2u], sums[at + 3u]) * inverse;
    result.position_grid = corner + vec3(sums[at + 4u], sums[at + 5u], sums[at + 6u]) * inverse;
    result.normal = facing_vector(facing);
    result.emission = vec3(0.0);
#if HAS_EMISSION
    for (int k = 0; k < 3; ++k) {
        uint word = at + FACE_SUM_WORDS + 2u * uint(k);
        result.emission[k] = (float(sums[word + 1u]) + float(sums[word]) / 4294967296.0) * inverse * FIXED_ONE;
    }
#endif
    if (total > 0.0) {
        // The mean of curved or layered surfaces lies inside them: look back at it from half a cell in front.
        Hit hit = trace(result.position_grid + 0.5 * result.normal, -result.normal, 1.0, RAY_ALL, false, 0u);
        if (hit.triangle != NONE_INDEX) {
            result.position_grid += (0.5 - hit.distance) * result.normal;
            result.normal = hit.normal;
        }
    }
    result.facing = facing;
    result.direct = vec3(0.0);
    result.pad = 0.0;
    return result;
}

void main()
{
    uint index = invocation_index();
    if (index >= cell_count) {
        return;
    }
    uint packed_position = cell_positions[index];
    vec3 corner = vec3(packed_position & 2047u, packed_position >> 11 & 2047u, packed_position >> 22);
    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    for (uint axis = 0u; axis < 3u; ++axis) {
        uint positive = 2u * axis, negative = positive + 1u;
        if ((record.w >> positive & 1u) == 0u) {
            continue;  // both facings of an axis are there, or neither
        }
        uint first = face_index(record, positive);
        Face front = mean_face(first, positive, corner);
        Face back = mean_face(first + 1u, negative, corner);
        // The back of a sheet: the same surface, turned over.
        bool lone_back = front.weight == 0.0 && back.weight > 0.0;
        bool lone_front = back.weight == 0.0 && front.weight > 0.0;
        if (lone_back) {
            front = back;
            front.normal = -back.normal;
        } else if (lone_front) {
            back = front;
            back.normal = -front.normal;
        }
        front.facing = positive;
        back.facing = negative;
        front.cell = back.cell = index;
        front.key = hash(packed_position, positive);
        back.key = hash(packed_position, negative);
        faces[first] = front;
        faces[first + 1u] = back;
    }
}
