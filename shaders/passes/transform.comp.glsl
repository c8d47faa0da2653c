// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles of all instances in grid space: one thread a triangle.
// Input: placements of instances, vertices and positions of meshes, slots.    Output: triangle_img, see lib/triangle.glsl.

#include "lib/common.glsl"
#include "lib/source.glsl"

layout(local_size_x = GROUP_SIZE) in;

// Four texels an instance: the rows of grid_from_object; its first triangle, its mesh's first one, its first slot.
SOURCE_2D(TEX_PLACEMENTS, SOURCE_PLACEMENTS, rgba32ui) placements_tex;
SOURCE_2D(TEX_VERTICES, SOURCE_VERTICES, rgba32ui) vertices_tex;  // w: material slot
SOURCE_2D(TEX_MESH_POSITIONS, SOURCE_MESH_POSITIONS, rgba32ui) positions_tex;
SOURCE_2D(TEX_SLOTS, SOURCE_SLOTS, r32ui) slots_tex;  // material | flags << 24
layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D triangle_img;

uniform uint triangle_count;
uniform uint instance_count;
// What is first in the lists; 0 where they hold all.
uniform uint triangle_first;
uniform uint instance_first;
uniform uint mesh_triangle_first;

uvec4 fetch_placement(uint instance, uint row)
{
    return fetch_source(placements_tex, list_texel(4u * instance + row));
}

vec3 to_grid(vec4 x, vec4 y, vec4 z, uint vertex)
{
    vec4 p = vec4(uintBitsToFloat(fetch_source(positions_tex, list_texel(vertex)).xyz), 1.0);
    precise vec3 at = vec3(dot(x, p), dot(y, p), dot(z, p));
    return at;
}

void main()
{
    uint index = invocation_index();
    if (index >= triangle_count) {
        return;
    }
    index += triangle_first;
    // The last instance that starts at or before this triangle.
    uint lo = 0u, hi = instance_count - 1u;
    if (lo < hi) do {
        uint middle = (lo + hi + 1u) / 2u;
        bool starts_before = fetch_placement(middle, 3u).x <= index;
        lo = starts_before ? middle : lo;
        hi = starts_before ? hi : middle - 1u;
    } while (lo < hi);
    vec4 x = uintBitsToFloat(fetch_placement(lo, 0u));
    vec4 y = uintBitsToFloat(fetch_placement(lo, 1u));
    vec4 z = uintBitsToFloat(fetch_placement(lo, 2u));
    uvec4 firsts = fetch_placement(lo, 3u);
    uint triangle = firsts.y + index - firsts.x;
    uvec4 vertices = fetch_source(vertices_tex, list_texel(triangle - mesh_triangle_first));
    vec3 a = to_grid(x, y, z, vertices.x);
    vec3 b = to_grid(x, y, z, vertices.y);
    vec3 c = to_grid(x, y, z, vertices.z);
    uint slot = fetch_source(slots_tex, list_texel(firsts.z + vertices.w)).r;
    ivec2 at = ivec2(3 * int(index % uint(TRIANGLES_PER_ROW)), int(index / uint(TRIANGLES_PER_ROW)));
    imageStore(triangle_img, at, uvec4(floatBitsToUint(a), slot));
    imageStore(triangle_img, at + ivec2(1, 0), uvec4(floatBitsToUint(b - a), instance_first + lo));
    imageStore(triangle_img, at + ivec2(2, 0), uvec4(floatBitsToUint(c - a), triangle));
}
