// SPDX-License-Identifier: GPL-3.0-or-later
// Normals that corners of meshes carry, interpolated over triangles: where surfaces are shaded smooth.

#include "lib/triangle.glsl"

layout(binding = TEX_INSTANCES) uniform usampler2D instances_tex;
// For each triangle of each mesh: three corners, material slot.
layout(binding = TEX_CORNERS) uniform usampler2D corners_tex;
layout(binding = TEX_ATTRIBUTES) uniform usampler2D attributes_tex;

uint attribute_word(uint index)
{
    return texelFetch(attributes_tex, list_texel(index), 0).r;
}

vec3 corner_normal(uint first, uint corner)
{
    return octahedral_decode(unpackSnorm2x16(attribute_word(first + corner)));
}

// Object space, unit, on the triangle's front. `corner`: the three corners of the mesh's triangle.
vec3 interpolated_normal(Instance instance, uvec3 corner, vec2 barycentric)
{
    vec3 n = corner_normal(instance.first_normal, corner.x) * (1.0 - barycentric.x - barycentric.y) +
             corner_normal(instance.first_normal, corner.y) * barycentric.x +
             corner_normal(instance.first_normal, corner.z) * barycentric.y;
    return dot(n, n) > 1e-12 ? normalize(n) : vec3(0.0, 0.0, 1.0);
}

// Normals go by the inverse transpose, or, where a scale of 0 leaves no inverse, by what it is a multiple of: the matrix of
// cofactors. Not finite where the surface that has the normal has become a line.
vec3 world_normal(Instance instance, vec3 n)
{
    vec3 x = instance.grid_from_object_x.xyz, y = instance.grid_from_object_y.xyz, z = instance.grid_from_object_z.xyz;
    vec3 turned = vec3(dot(cross(y, z), n), dot(cross(z, x), n), dot(cross(x, y), n));
    return normalize(instance.mirrored != 0u ? -turned : turned);
}
