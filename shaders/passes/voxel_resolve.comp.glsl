// SPDX-License-Identifier: GPL-3.0-or-later
// From sums to faces: means, and the point of the surface that each face stands for.
// Input: sums, cells with their positions, triangles.    Output: place_img, reflectance_img of the faces.

#include "lib/grid.glsl"
#include "lib/triangle.glsl"
#include "lib/face.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_CELLS) uniform usampler2D cells_tex;
layout(binding = TEX_CELL_TRIANGLES) uniform usampler2D cell_triangles_tex;
layout(std430, binding = BUF_SUMS) readonly buffer Sums { uint sums[]; };
layout(binding = TEX_CELL_POSITIONS) uniform usampler2D cell_positions_tex;
layout(std430, binding = BUF_WORK) readonly buffer Work { uint work[]; };  // cell | axis << 30
layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D place_img;
layout(binding = IMG_1, rgba16) writeonly uniform image2D reflectance_img;

uniform uint work_count;

struct Face {
    vec3 position;
    vec3 normal;
    vec4 reflectance;  // a: as stored
};

// What the surfaces that face this way bring; `total` is the sum of their weights, not 0.
Face mean_face(uint face, uint facing, vec3 corner, float total)
{
    Face result;
    uint at = face * FACE_SUM_WORDS;
    float inverse = 1.0 / total;
    result.reflectance.rgb = vec3(sums[at + 1u], sums[at + 2u], sums[at + 3u]) * inverse;
    result.reflectance.a = sqrt(min(total / (FIXED_ONE * MAX_FACE_WEIGHT), 1.0));
    result.position = corner + vec3(sums[at + 4u], sums[at + 5u], sums[at + 6u]) * inverse;
    result.normal = facing_vector(facing);
    return result;
}

// The mean of curved or layered surfaces lies inside them: take the outermost surface of the cell in front of it or
// behind it.
void find_surface(inout Face face, uvec4 record, vec3 corner)
{
    vec3 outward = face.normal;
    vec3 origin = face.position;
    float height = -2.0;
    uint highest = NONE_INDEX;
    for (uint k = record.x; k < record.x + record.y; ++k) {
        uint index = texelFetch(cell_triangles_tex, list_texel(k), 0).r;
        Triangle t = fetch_triangle(index);
        vec2 barycentric;
        float distance;
        bool crosses = intersect_plane(t, origin, outward, barycentric, distance);
        vec3 at = origin + outward * distance - corner;
        bool inside = min(barycentric.x, barycentric.y) >= 0.0 && barycentric.x + barycentric.y <= 1.0 &&
                      all(greaterThan(at, vec3(-1e-3))) && all(lessThan(at, vec3(1.001)));
        // Equal heights go to the lower index: the order of the cell's list must not show.
        if (crosses && inside && (distance > height || (distance == height && index < highest))) {
            height = distance;
            highest = index;
            vec3 n = normalize(cross(t.edge_1, t.edge_2));
            face.normal = dot(n, outward) < 0.0 ? -n : n;
            face.position = origin + outward * distance;
        }
    }
}

void store(uint index, Face face)
{
    imageStore(place_img, list_texel(index), pack_face_place(face.position, face.normal));
    imageStore(reflectance_img, list_texel(index), face.reflectance);
}

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    uint index = work[number] & 0x3FFFFFFFu;
    uint facing = 2u * (work[number] >> 30);
    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    uint packed_position = texelFetch(cell_positions_tex, list_texel(index), 0).r;
    vec3 corner = vec3(packed_position & 2047u, packed_position >> 11 & 2047u, packed_position >> 22);
    uint first = face_index(record, facing);
    float totals[2] = float[2](float(sums[first * FACE_SUM_WORDS]), float(sums[(first + 1u) * FACE_SUM_WORDS]));
    if (totals[0] == 0.0 && totals[1] == 0.0) {
        totals[0] = 1.0;  // so little of a surface that it was rounded away: black, at the cell's corner
    }
    uint begin = totals[0] > 0.0 ? 0u : 1u;
    uint end = totals[1] > 0.0 ? 2u : 1u;
    for (uint side = begin; side < end; ++side) {
        Face face = mean_face(first + side, facing + side, corner, totals[side]);
        find_surface(face, record, corner);
        store(first + side, face);
        if (end - begin == 1u) {
            // The side that nothing was made for is the back of a sheet: the same surface, turned over.
            face.normal = -face.normal;
            store(first + 1u - side, face);
        }
    }
}
