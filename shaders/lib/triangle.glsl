// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles of all instances in grid space. They are numbered instance by instance.
//
// The including program gets the define
//     HAS_INSTANCES  1: triangles_tex holds each mesh's triangles once, in object space, and where instances stand; a
//                    triangle is transformed whenever it is asked for, so everything that asks gets the same numbers.
//                    0: it holds the triangles of all instances.
// Which triangle it is, is told in two ways: by its number, and, where cells list it, by an entry that needs no search
// for the instance.

#include "lib/common.glsl"
#include "lib/source.glsl"

SOURCE_2D(TEX_TRIANGLES, SOURCE_TRIANGLES, rgba32ui) triangles_tex;

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

#if HAS_INSTANCES

// Placements of instances come first, four texels each: the rows of grid_from_object; the instance's first triangle, place
// in the texture of its mesh's first triangle, place of its first material slot, how many instances there are.
// Then triangles of meshes, three texels each: corners; w: material slot, number among the triangles of all meshes.
// Then material slots, a word each: material | flags << 24.

ivec2 placement_texel(uint instance)
{
    return ivec2(4 * int(instance % uint(PLACEMENTS_PER_ROW)), int(instance / uint(PLACEMENTS_PER_ROW)));
}

uvec4 fetch_placement(uint instance)
{
    return fetch_source(triangles_tex, placement_texel(instance) + ivec2(3, 0));
}

// Entries of cells' lists: instance, place in the texture | flags << 24. The one with the lower number comes first.
bool comes_before(uvec2 a, uvec2 b)
{
    return a.x < b.x || (a.x == b.x && (a.y & 0xFFFFFFu) < (b.y & 0xFFFFFFu));
}

uint entry_flags(uvec2 entry, uvec3 words)
{
    return entry.y >> 24;
}

uint triangle_number(uvec2 entry)
{
    uvec4 placement = fetch_placement(entry.x);
    return placement.x + (entry.y & 0xFFFFFFu) - placement.y;
}

uint instance_of(uint index)
{
    // The last instance that starts at or before this triangle.
    uint lo = 0u, hi = fetch_placement(0u).w - 1u;
    while (lo < hi) {
        uint middle = (lo + hi + 1u) / 2u;
        bool starts_before = fetch_placement(middle).x <= index;
        lo = starts_before ? middle : lo;
        hi = starts_before ? hi : middle - 1u;
    }
    return lo;
}

// Corner and edges of an entry's triangle, and the words that are stored with them.
void fetch_corners(uvec2 entry, out uvec3 words, out vec3 corner, out vec3 edge_1, out vec3 edge_2)
{
    ivec2 at = placement_texel(entry.x);
    vec4 x = uintBitsToFloat(fetch_source(triangles_tex, at));
    vec4 y = uintBitsToFloat(fetch_source(triangles_tex, at + ivec2(1, 0)));
    vec4 z = uintBitsToFloat(fetch_source(triangles_tex, at + ivec2(2, 0)));
    at = triangle_texel(entry.y & 0xFFFFFFu);
    uvec4 t0 = fetch_source(triangles_tex, at);
    uvec4 t1 = fetch_source(triangles_tex, at + ivec2(1, 0));
    uvec4 t2 = fetch_source(triangles_tex, at + ivec2(2, 0));
    vec4 a = vec4(uintBitsToFloat(t0.xyz), 1.0);
    vec4 b = vec4(uintBitsToFloat(t1.xyz), 1.0);
    vec4 c = vec4(uintBitsToFloat(t2.xyz), 1.0);
    // Every program must get the same bits, or rays could slip past what was voxelized; those of pass `transform`, too.
    precise vec3 p = vec3(dot(x, a), dot(y, a), dot(z, a));
    precise vec3 to_q = vec3(dot(x, b), dot(y, b), dot(z, b)) - p;
    precise vec3 to_r = vec3(dot(x, c), dot(y, c), dot(z, c)) - p;
    words = uvec3(t0.w, t1.w, t2.w);
    corner = p;
    edge_1 = to_q;
    edge_2 = to_r;
}

Triangle fetch_listed(uvec2 entry)
{
    Triangle t;
    uvec3 words;
    fetch_corners(entry, words, t.corner, t.edge_1, t.edge_2);
    uint word = fetch_placement(entry.x).z + words.x;
    const uint row_words = 4u * 3u * uint(TRIANGLES_PER_ROW);
    ivec2 at = ivec2(int(word % row_words / 4u), int(word / row_words));
    uint slot = fetch_source(triangles_tex, at)[word & 3u];
    t.material = slot & 0xFFFFFFu;
    t.flags = slot >> 24;
    t.instance = entry.x;
    t.mesh_triangle = words.y;
    return t;
}

Triangle fetch_triangle(uint index)
{
    uint instance = instance_of(index);
    uvec4 placement = fetch_placement(instance);
    return fetch_listed(uvec2(instance, placement.y + index - placement.x));
}

// What a cell's list says of triangle `index`.
uvec2 list_entry(uint index, Triangle t)
{
    uvec4 placement = fetch_placement(t.instance);
    return uvec2(t.instance, (placement.y + index - placement.x) | t.flags << 24);
}

#else

// Entries of cells' lists are numbers of triangles.
bool comes_before(uvec2 a, uvec2 b)
{
    return a.x < b.x;
}

uint entry_flags(uvec2 entry, uvec3 words)
{
    return words.x >> 24;
}

uint triangle_number(uvec2 entry)
{
    return entry.x;
}

// Corner and edges of an entry's triangle, and the words that are stored with them.
void fetch_corners(uvec2 entry, out uvec3 words, out vec3 corner, out vec3 edge_1, out vec3 edge_2)
{
    ivec2 at = triangle_texel(entry.x);
    uvec4 a = fetch_source(triangles_tex, at);
    uvec4 b = fetch_source(triangles_tex, at + ivec2(1, 0));
    uvec4 c = fetch_source(triangles_tex, at + ivec2(2, 0));
    words = uvec3(a.w, b.w, c.w);
    corner = uintBitsToFloat(a.xyz);
    edge_1 = uintBitsToFloat(b.xyz);
    edge_2 = uintBitsToFloat(c.xyz);
}

Triangle fetch_listed(uvec2 entry)
{
    Triangle t;
    uvec3 words;
    fetch_corners(entry, words, t.corner, t.edge_1, t.edge_2);
    t.material = words.x & 0xFFFFFFu;
    t.flags = words.x >> 24;
    t.instance = words.y;
    t.mesh_triangle = words.z;
    return t;
}

Triangle fetch_triangle(uint index)
{
    return fetch_listed(uvec2(index, 0u));
}

// What a cell's list says of triangle `index`.
uvec2 list_entry(uint index, Triangle t)
{
    return uvec2(index, 0u);
}

#endif

// A triangle in cells of a level (lib/level.glsl): powers of two change no digit.
Triangle in_level(Triangle t, int level)
{
#if LEVELS
    float scale = 1.0 / float(1 << level);
    t.corner *= scale;
    t.edge_1 *= scale;
    t.edge_2 *= scale;
#endif
    return t;
}

// Barycentric coordinates (of corners 1 and 2) of where a line meets the plane of a triangle, and the distance.
// Moeller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection".
bool intersect_plane(Triangle triangle, vec3 origin, vec3 direction, out vec2 barycentric, out float distance)
{
    // With or without HAS_INSTANCES, the same bits.
    precise vec3 p = cross(direction, triangle.edge_2);
    precise float determinant = dot(triangle.edge_1, p);
    precise float inverse = 1.0 / determinant;
    precise vec3 s = origin - triangle.corner;
    precise vec3 q = cross(s, triangle.edge_1);
    precise vec2 uv = vec2(dot(s, p), dot(direction, q)) * inverse;
    precise float w = dot(triangle.edge_2, q) * inverse;
    barycentric = uv;
    distance = w;
    return determinant != 0.0;
}
