// SPDX-License-Identifier: GPL-3.0-or-later
// What a material is asked (ShadingPoint) and what it answers (Surface). Every compiled material is one function
//     void evaluate_material(in ShadingPoint p, out Surface s);
// run wherever a material is needed: at pixels, at voxels.
//
// The including program defines, before this file:
//   MATERIAL_UV_LAYERS, MATERIAL_COLOR_LAYERS   how many attribute layers the material reads (0 or more)

#ifndef MATERIAL_UV_LAYERS
#error "MATERIAL_UV_LAYERS is not defined: the number of UV layers that the material reads"
#endif
#ifndef MATERIAL_COLOR_LAYERS
#error "MATERIAL_COLOR_LAYERS is not defined: the number of colour attributes that the material reads"
#endif

struct ShadingPoint {
    vec3 position_ws;       // metres, world
    vec3 position_os;       // metres, object
    vec3 generated;         // 0..1 over the mesh's bounds
    vec3 normal_ws;         // unit, interpolated, on the viewer's side
    vec3 geometric_normal_ws;  // unit, of the triangle, on the viewer's side
    vec3 normal_os;         // unit, interpolated, object space, not flipped
    vec3 incoming_ws;       // unit, from the point to the viewer (voxels: at an angle, see voxel_accumulate)
    bool back_facing;       // the triangle is seen from behind
    float object_random;    // 0..1
    float object_index;
    vec3 object_position_ws;
#if MATERIAL_UV_LAYERS > 0
    vec2 uv[MATERIAL_UV_LAYERS];
    vec3 uv_tangent_ws[MATERIAL_UV_LAYERS];    // d position / d u, unit, world (0 when the map is degenerate)
    vec3 uv_bitangent_ws[MATERIAL_UV_LAYERS];  // d position / d v
    float uv_footprint[MATERIAL_UV_LAYERS];    // side of the sampled area in UV units: chooses the mip level
#endif
#if MATERIAL_COLOR_LAYERS > 0
    vec4 color[MATERIAL_COLOR_LAYERS];
#endif
};

// A sum of lobes around one normal; a coat may have its own. Reflectances are weights: they already hold base colour, mix
// factors and layering.
struct Surface {
    vec3 diffuse;       // Lambertian reflectance
    vec3 specular_f0;   // GGX reflectance at normal incidence
    vec3 specular_f90;  // and at grazing incidence
    float specular_ior; // how it goes from one to the other: see fresnel_share in lib/fresnel.glsl
    float roughness;    // of the GGX lobe as artists see it: alpha = roughness^2
    vec3 glass_f0;      // a second lobe, of a dielectric that light enters or leaves
    vec3 glass_f90;
    vec3 glass_transmission;  // factor on what it does not reflect
    float glass_ior;    // of the far side over the near one
    float glass_roughness;
    float coat;         // a third lobe, above the others, grey: factor on the reflectance of its ior
    float coat_ior;
    float coat_roughness;
    bool coat_bends;    // the coat has a normal of its own
    vec3 coat_normal_ws;
    vec3 emission;      // radiance, W/(m2 sr)
    vec3 transparency;  // what passes straight through: 1 - opacity
    vec3 normal_ws;     // unit shading normal
};
