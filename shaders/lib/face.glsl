// SPDX-License-Identifier: GPL-3.0-or-later
// Voxel faces: a point of the surface that the face stands for, and what it reflects.

#include "lib/common.glsl"

layout(binding = TEX_FACE_PLACE) uniform usampler2D face_place_tex;
layout(binding = TEX_FACE_REFLECTANCE) uniform sampler2D face_reflectance_tex;

uvec4 pack_face_place(vec3 position, vec3 normal)
{
    return uvec4(floatBitsToUint(position), packSnorm2x16(octahedral_encode(normal)));
}

// position: grid space; normal: unit, geometric.
void fetch_face_place(uint face, out vec3 position, out vec3 normal)
{
    uvec4 place = texelFetch(face_place_tex, list_texel(face), 0);
    position = uintBitsToFloat(place.xyz);
    normal = octahedral_decode(unpackSnorm2x16(place.w));
}

// For random numbers: depends on what the face stands for, not on how many faces come before it.
uint face_seed(uint face)
{
    uvec4 place = texelFetch(face_place_tex, list_texel(face), 0);
    return hash(hash(hash(place.x, place.y), place.z), place.w);
}

// rgb: reflectance, diffuse and specular together, as a Lambertian; a: area of the surfaces that are
// nearest to this facing, in sides of cells.
vec4 fetch_face_reflectance(uint face)
{
    vec4 stored = texelFetch(face_reflectance_tex, list_texel(face), 0);
    return vec4(stored.rgb, stored.a * stored.a * MAX_FACE_WEIGHT);  // the root keeps small weights apart
}
