// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles of all instances in grid space.

#include "lib/common.glsl"

const float RAY_START = 1e-3;  // cells: how far along the normal a ray starts above the surface it leaves

layout(binding = TEX_TRIANGLES) uniform usampler2D triangles_tex;

struct Triangle {
    vec3 corner;    // grid space
    vec3 edge_1;    // corner 1 - corner 0
    vec3 edge_2;    // corner 2 - corner 0
    uint material;  // index
    uint flags;     // RAY_* that see it
    uint instance;
    uint mesh_triangle;  // among the triangles of all meshes
};

ivec2 triangle_texel(uint index)
{
    return ivec2(3 * int(index % uint(TRIANGLES_PER_ROW)), int(index / uint(TRIANGLES_PER_ROW)));
}

Triangle fetch_triangle(uint index)
{
    ivec2 at = triangle_texel(index);
    uvec4 a = texelFetch(triangles_tex, at, 0);
    uvec4 b = texelFetch(triangles_tex, at + ivec2(1, 0), 0);
    uvec4 c = texelFetch(triangles_tex, at + ivec2(2, 0), 0);
    return Triangle(uintBitsToFloat(a.xyz), uintBitsToFloat(b.xyz), uintBitsToFloat(c.xyz), a.w & 0xFFFFFFu,
                    a.w >> 24, b.w, c.w);
}

// Barycentric coordinates (of corners 1 and 2) of where a line meets the plane of a triangle, and the distance.
// Moeller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection".
bool intersect_plane(Triangle triangle, vec3 origin, vec3 direction, out vec2 barycentric, out float distance)
{
    vec3 p = cross(direction, triangle.edge_2);
    float determinant = dot(triangle.edge_1, p);
    float inverse = 1.0 / determinant;
    vec3 s = origin - triangle.corner;
    vec3 q = cross(s, triangle.edge_1);
    barycentric = vec2(dot(s, p), dot(direction, q)) * inverse;
    distance = dot(triangle.edge_2, q) * inverse;
    return determinant != 0.0;
}
