// SPDX-License-Identifier: GPL-3.0-or-later
// From parts to faces: sums and means, and the point of the surface that each face stands for. One thread for each axis
// that a cell has faces on. Sums are integers: the order of a cell's list cannot show.
// Input: parts and triangles of cells, cells with their positions. HAS_SHADING_NORMALS: meshes' corners.
// Output: place_img, reflectance_img of the faces; order_img, the list of all faces facing by facing, with their shading
// normals where there are some.

#include "lib/grid.glsl"
#include "lib/triangle.glsl"
#include "lib/face.glsl"
#include "lib/part.glsl"
#if HAS_SHADING_NORMALS
#include "lib/shading_normal.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_CELLS) uniform usampler2D cells_tex;
layout(binding = TEX_CELL_TRIANGLES) uniform usampler2D cell_triangles_tex;
layout(binding = TEX_CELL_POSITIONS) uniform usampler2D cell_positions_tex;
layout(binding = TEX_PARTS) uniform usampler2D parts_tex;
layout(std430, binding = BUF_WORK) readonly buffer Work { uint work[]; };  // cell | axis << 30, axis by axis
layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D place_img;
layout(binding = IMG_1, rgba16) writeonly uniform image2D reflectance_img;
#if HAS_SHADING_NORMALS
layout(binding = IMG_2, rg32ui) writeonly uniform uimage2D order_img;
#else
layout(binding = IMG_2, r32ui) writeonly uniform uimage2D order_img;
#endif

uniform uint work_count;
uniform uvec3 axis_counts;  // work items of each axis

struct Sums {
    uint area;
    uvec3 reflectance;
    uvec3 position;
};

struct Face {
    vec3 position;
    vec3 normal;
    vec4 reflectance;  // a: as stored
#if HAS_SHADING_NORMALS
    vec3 shading_normal;
#endif
};

// Add a part where `mask` is all ones, nothing where it is 0.
void add_part(inout Sums sums, Part part, uint mask)
{
    sums.area += part.area & mask;
    sums.reflectance += part.reflectance & mask;
    sums.position += part.position & mask;
}

// What the surfaces of a cell bring to the two facings of an axis.
void sum_parts(uvec4 record, uint axis, out Sums plus, out Sums minus)
{
    plus = Sums(0u, uvec3(0u), uvec3(0u));
    minus = plus;
    for (uint k = record.x; k < record.x + record.y; ++k) {
        Part part = unpack_part(texelFetch(parts_tex, list_texel(k), 0));
        uint to_plus = part.facing == 2u * axis ? 0xFFFFFFFFu : 0u;
        uint to_minus = part.facing == 2u * axis + 1u ? 0xFFFFFFFFu : 0u;
        add_part(plus, part, to_plus);
        add_part(minus, part, to_minus);
    }
}

// What the surfaces that face this way bring; of no use when there are none.
Face mean_face(Sums sums, uint facing, vec3 corner)
{
    Face result;
    float total = float(sums.area);
    float inverse = 1.0 / total;
    result.reflectance.rgb = vec3(sums.reflectance) * inverse;
    result.reflectance.a = sqrt(min(total / (FIXED_ONE * MAX_FACE_WEIGHT), 1.0));
    result.position = corner + vec3(sums.position) * inverse;
    result.normal = facing_vector(facing);
    return result;
}

// The surface of a cell that is outermost along a line.
struct Outermost {
    float height;     // above where the line starts
    uint triangle;    // NONE_INDEX: the line meets nothing
    vec3 face_cross;  // the triangle's normal, not unit
};

void consider(inout Outermost outermost, Face face, Triangle t, uint index, vec3 corner)
{
    vec2 barycentric;
    float distance;
    bool crosses = intersect_plane(t, face.position, face.normal, barycentric, distance);
    vec3 at = face.position + face.normal * distance - corner;
    bool inside = min(barycentric.x, barycentric.y) >= 0.0 && barycentric.x + barycentric.y <= 1.0 &&
                  all(greaterThan(at, vec3(-1e-3))) && all(lessThan(at, vec3(1.001)));
    // Equal heights go to the lower index: the order of the cell's list must not show.
    if (crosses && inside && (distance > outermost.height ||
                              (distance == outermost.height && index < outermost.triangle))) {
        outermost = Outermost(distance, index, cross(t.edge_1, t.edge_2));
    }
}

#if HAS_SHADING_NORMALS
// Of triangle `index` at the face's place: the mean over its part of the cell, where that is all there is.
vec3 shading_normal(Face face, uint index)
{
    Triangle t = fetch_triangle(index);
    Instance instance = fetch_instance(instances_tex, t.instance);
    vec2 barycentric;
    float distance;
    intersect_plane(t, face.position, face.normal, barycentric, distance);
    uvec3 corner = texelFetch(corners_tex, list_texel(t.mesh_triangle), 0).xyz;
    vec3 n = world_normal(instance, interpolated_normal(instance, corner, barycentric));
    bool is_front = (dot(cross(t.edge_1, t.edge_2), face.normal) > 0.0) == (instance.mirrored == 0u);
    n = is_front ? n : -n;
    return is_finite(n) && dot(n, face.normal) < FLAT_COSINE ? n : face.normal;
}
#endif

void move_to(inout Face face, Outermost outermost)
{
    if (outermost.triangle != NONE_INDEX) {
        vec3 n = normalize(outermost.face_cross);
        face.position += face.normal * outermost.height;
        face.normal = dot(n, face.normal) < 0.0 ? -n : n;
    }
#if HAS_SHADING_NORMALS
    face.shading_normal = face.normal;
    if (outermost.triangle != NONE_INDEX) {
        face.shading_normal = shading_normal(face, outermost.triangle);
    }
#endif
}

// The same surface seen from its other side.
Face turned_over(Face face)
{
    face.normal = -face.normal;
#if HAS_SHADING_NORMALS
    face.shading_normal = -face.shading_normal;
#endif
    return face;
}

// The mean of curved or layered surfaces lies inside them: take the outermost surface of the cell in front of it or
// behind it. (Both faces in one loop, though one is mostly not wanted: fetching the triangles is what takes time.)
void find_surfaces(inout Face plus, inout Face minus, uvec4 record, vec3 corner)
{
    Outermost above = Outermost(-2.0, NONE_INDEX, vec3(0.0));
    Outermost below = above;
    for (uint k = record.x; k < record.x + record.y; ++k) {
        uint index = texelFetch(cell_triangles_tex, list_texel(k), 0).r;
        Triangle t = fetch_triangle(index);
        consider(above, plus, t, index, corner);
        consider(below, minus, t, index, corner);
    }
    move_to(plus, above);
    move_to(minus, below);
}

void store(uint index, Face face, uint place_in_order)
{
#if HAS_SHADING_NORMALS
    uint shading = packSnorm2x16(octahedral_encode(face.shading_normal));
    imageStore(order_img, list_texel(place_in_order), uvec4(index, shading, 0u, 0u));
#else
    imageStore(order_img, list_texel(place_in_order), uvec4(index));
#endif
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
    uint axis = work[number] >> 30;
    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    uint first = face_index(record, 2u * axis);
    uint before = (axis > 0u ? axis_counts.x : 0u) + (axis > 1u ? axis_counts.y : 0u);

    vec3 corner = vec3(unpack_cell(texelFetch(cell_positions_tex, list_texel(index), 0).r));
    Sums plus, minus;
    sum_parts(record, axis, plus, minus);
    if (plus.area == 0u && minus.area == 0u) {
        plus.area = 1u;  // so little of a surface that it was rounded away: black, at the cell's corner
    }
    Face front = mean_face(plus, 2u * axis, corner);
    Face back = mean_face(minus, 2u * axis + 1u, corner);
    find_surfaces(front, back, record, corner);
    // The side that nothing was made for is the back of a sheet: the same surface, turned over.
    if (plus.area == 0u) {
        front = turned_over(back);
    } else if (minus.area == 0u) {
        back = turned_over(front);
    }
    store(first, front, number + before);
    store(first + 1u, back, number + before + axis_counts[axis]);
}
