// SPDX-License-Identifier: GPL-3.0-or-later
// Parts of a triangle for a list of (part, parts of an edge, u).
// Output: (corner, edge 1), (edge 2, number of the part that the point u of it lies in, 0).

#include "lib/common.glsl"
#include "lib/emitter_part.glsl"
#include "tests/rows.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    vec4 given = inputs[index];
    vec2 corner, edge_1, edge_2;
    emitter_part(uint(given.x), uint(given.y), corner, edge_1, edge_2);
    results[2u * index] = vec4(corner, edge_1);
    uint found = emitter_part_at(corner + edge_1 * given.z + edge_2 * given.w, uint(given.y));
    results[2u * index + 1u] = vec4(edge_2, float(found), 0.0);
}
