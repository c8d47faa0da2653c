// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles of all instances in grid space: one thread a triangle.
// Input: instances, vertices and positions of meshes, slots.    Output: triangle_img, see lib/triangle.glsl.

#include "lib/common.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_INSTANCES) readonly buffer Instances { Instance instances[]; };
layout(std430, binding = BUF_VERTICES) readonly buffer Vertices { uint vertices[]; };
layout(std430, binding = BUF_POSITIONS) readonly buffer Positions { float positions[]; };
layout(binding = TEX_CORNERS) uniform usampler2D corners_tex;  // w: material slot
layout(std430, binding = BUF_MATERIALS) readonly buffer Slots { uint slots[]; };  // material | flags << 24
layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D triangle_img;

uniform uint triangle_count;
uniform uint instance_count;
// What is first in the buffers; 0 where they hold all.
uniform uint triangle_first;
uniform uint instance_first;
uniform uint mesh_triangle_first;
uniform uint slot_first;

vec3 to_grid(Instance instance, uint vertex)
{
    vec4 p = vec4(positions[3u * vertex], positions[3u * vertex + 1u], positions[3u * vertex + 2u], 1.0);
    precise vec3 at = vec3(dot(instance.grid_from_object_x, p), dot(instance.grid_from_object_y, p),
                           dot(instance.grid_from_object_z, p));
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
        bool starts_before = instances[middle].first_triangle <= index;
        lo = starts_before ? middle : lo;
        hi = starts_before ? hi : middle - 1u;
    } while (lo < hi);
    Instance instance = instances[lo];
    uint triangle = instance.first_mesh_triangle + index - instance.first_triangle;
    uint vertex = 3u * (triangle - mesh_triangle_first);
    vec3 a = to_grid(instance, vertices[vertex]);
    vec3 b = to_grid(instance, vertices[vertex + 1u]);
    vec3 c = to_grid(instance, vertices[vertex + 2u]);
    uint slot = slots[instance.first_slot - slot_first + texelFetch(corners_tex, list_texel(triangle), 0).w];
    ivec2 at = ivec2(3 * int(index % uint(TRIANGLES_PER_ROW)), int(index / uint(TRIANGLES_PER_ROW)));
    imageStore(triangle_img, at, uvec4(floatBitsToUint(a), slot));
    imageStore(triangle_img, at + ivec2(1, 0), uvec4(floatBitsToUint(b - a), instance_first + lo));
    imageStore(triangle_img, at + ivec2(2, 0), uvec4(floatBitsToUint(c - a), triangle));
}
