// SPDX-License-Identifier: GPL-3.0-or-later
// From a point of a triangle to everything a material may ask about it.
//
// The including program provides generated text "material" (evaluate_material), the defines of lib/surface.glsl, and
//     FLAT_SHADING   1: surfaces as their triangles are, without interpolated normals (voxels)

#include "lib/surface.glsl"
#include "lib/shading_normal.glsl"

uniform float cell_size;
uniform vec3 grid_origin_ws;

// Entry m, component x, holds the number of material m's first parameter; parameters follow.
layout(binding = TEX_MATERIALS) uniform sampler2D materials_tex;

uint current_parameter_base;

vec4 material_parameter(int index)
{
    return texelFetch(materials_tex, list_texel(current_parameter_base + uint(index)), 0);
}

#if MATERIAL_UV_LAYERS > 0
uniform uint material_uv_layers[MATERIAL_UV_LAYERS];
#endif
#if MATERIAL_COLOR_LAYERS > 0
uniform uint material_color_layers[MATERIAL_COLOR_LAYERS];
#endif

#include "material"

vec2 corner_uv(uint first, uint corner)
{
    if (first == NONE_INDEX) {
        return vec2(0.0);
    }
    return vec2(uintBitsToFloat(attribute_word(first + 2u * corner)), uintBitsToFloat(attribute_word(first + 2u * corner + 1u)));
}

vec4 corner_color(uint first, uint corner)
{
    if (first == NONE_INDEX) {
        return vec4(0.0);
    }
    return vec4(unpackHalf2x16(attribute_word(first + 2u * corner)), unpackHalf2x16(attribute_word(first + 2u * corner + 1u)));
}

// The point with these barycentric coordinates. `incoming` points to the viewer; `footprint` is the side of the area
// that the answer stands for, in cells.
ShadingPoint shading_point(Triangle t, vec2 barycentric, vec3 incoming, float footprint)
{
    Instance instance = fetch_instance(instances_tex, t.instance);
    vec3 weights = vec3(1.0 - barycentric.x - barycentric.y, barycentric);
    vec3 position_grid = t.corner + t.edge_1 * barycentric.x + t.edge_2 * barycentric.y;
    uvec3 corner = texelFetch(corners_tex, list_texel(t.mesh_triangle), 0).xyz;

    ShadingPoint p;
    p.position_ws = position_grid * cell_size + grid_origin_ws;
    vec4 homogeneous = vec4(position_grid, 1.0);
    p.position_os = vec3(dot(instance.object_from_grid_x, homogeneous), dot(instance.object_from_grid_y, homogeneous),
                         dot(instance.object_from_grid_z, homogeneous));
    p.generated = p.position_os * instance.generated_scale + instance.generated_offset;
    p.incoming_ws = incoming;
    p.object_random = instance.random;
    p.object_index = instance.object_index;
    p.object_position_ws = vec3(instance.grid_from_object_x.w, instance.grid_from_object_y.w,
                                instance.grid_from_object_z.w) * cell_size + grid_origin_ws;

    vec3 face_cross = cross(t.edge_1, t.edge_2) * (instance.mirrored != 0u ? -1.0 : 1.0);
    p.geometric_normal_ws = normalize(face_cross);
#if FLAT_SHADING
    vec3 face_os = vec3(instance.grid_from_object_x.x * p.geometric_normal_ws.x +
                        instance.grid_from_object_y.x * p.geometric_normal_ws.y +
                        instance.grid_from_object_z.x * p.geometric_normal_ws.z,
                        instance.grid_from_object_x.y * p.geometric_normal_ws.x +
                        instance.grid_from_object_y.y * p.geometric_normal_ws.y +
                        instance.grid_from_object_z.y * p.geometric_normal_ws.z,
                        instance.grid_from_object_x.z * p.geometric_normal_ws.x +
                        instance.grid_from_object_y.z * p.geometric_normal_ws.y +
                        instance.grid_from_object_z.z * p.geometric_normal_ws.z);
    p.normal_os = dot(face_os, face_os) > 0.0 ? normalize(face_os) : vec3(0.0, 0.0, 1.0);
    p.normal_ws = p.geometric_normal_ws;
#else
    p.normal_os = interpolated_normal(instance, corner, barycentric);
    p.normal_ws = world_normal(instance, p.normal_os);
    if (!is_finite(p.normal_ws)) {
        p.normal_ws = p.geometric_normal_ws;
    }
#endif
    p.back_facing = dot(p.geometric_normal_ws, incoming) < 0.0;
    if (p.back_facing) {
        p.geometric_normal_ws = -p.geometric_normal_ws;
        p.normal_ws = -p.normal_ws;
    }
    // A corner normal that points to the other side stays so, and the surface is dark there: as in Cycles and EEVEE.

#if MATERIAL_UV_LAYERS > 0
    float area = length(face_cross);
    for (int k = 0; k < MATERIAL_UV_LAYERS; ++k) {
        uint first = attribute_word(instance.first_layer + material_uv_layers[k]);
        vec2 a = corner_uv(first, corner.x);
        vec2 ab = corner_uv(first, corner.y) - a;
        vec2 ac = corner_uv(first, corner.z) - a;
        p.uv[k] = a + ab * barycentric.x + ac * barycentric.y;
        float uv_area = ab.x * ac.y - ab.y * ac.x;
        p.uv_footprint[k] = footprint * sqrt(abs(uv_area) / max(area, 1e-30));
        bool flat_map = abs(uv_area) < 1e-20;
        float side = uv_area < 0.0 ? -1.0 : 1.0;
        vec3 u = (t.edge_1 * ac.y - t.edge_2 * ab.y) * side;
        vec3 v = (t.edge_2 * ab.x - t.edge_1 * ac.x) * side;
        p.uv_tangent_ws[k] = flat_map ? vec3(0.0) : normalize(u);
        p.uv_bitangent_ws[k] = flat_map ? vec3(0.0) : normalize(v);
    }
#endif
#if MATERIAL_COLOR_LAYERS > 0
    for (int k = 0; k < MATERIAL_COLOR_LAYERS; ++k) {
        uint first = attribute_word(instance.first_layer + material_color_layers[k]);
        p.color[k] = corner_color(first, corner.x) * weights.x + corner_color(first, corner.y) * weights.y +
                     corner_color(first, corner.z) * weights.z;
    }
#endif
    return p;
}

// What the triangle's material says there, made safe: finite, reflectances not negative, a usable normal.
Surface surface_at(Triangle t, ShadingPoint p)
{
    current_parameter_base = uint(texelFetch(materials_tex, list_texel(t.material), 0).x);
    Surface s;
    evaluate_material(p, s);
    s.diffuse = max(finite_or_zero(s.diffuse), 0.0);
    s.specular_f0 = max(finite_or_zero(s.specular_f0), 0.0);
    s.specular_f90 = max(finite_or_zero(s.specular_f90), 0.0);
    s.emission = max(finite_or_zero(s.emission), 0.0);
    s.transparency = clamp(finite_or_zero(s.transparency), 0.0, 1.0);
    s.roughness = isnan(s.roughness) ? 1.0 : clamp(s.roughness, 0.0, 1.0);
    s.glass_f0 = max(finite_or_zero(s.glass_f0), 0.0);
    s.glass_f90 = max(finite_or_zero(s.glass_f90), 0.0);
    s.glass_transmission = max(finite_or_zero(s.glass_transmission), 0.0);
    s.coat = max(finite_or_zero(vec3(s.coat)).x, 0.0);
    if (!is_finite(s.normal_ws) || dot(s.normal_ws, s.normal_ws) < 0.25) {
        s.normal_ws = p.normal_ws;
    }
    if (!is_finite(s.coat_normal_ws) || dot(s.coat_normal_ws, s.coat_normal_ws) < 0.25) {
        s.coat_normal_ws = s.normal_ws;
    }
    return s;
}
