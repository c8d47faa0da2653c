// SPDX-License-Identifier: GPL-3.0-or-later
// Light of voxel faces in two words: three whole numbers of 18 bits and the exponent that they share. What is off is at
// most 2^-18 of the largest of the three.

#include "lib/common.glsl"

const float LIGHT_STEPS = 262144.0;  // 2^18
// Exponents as floats have them; of smaller numbers the scale would be no normal float.
const uint LEAST_LIGHT_EXPONENT = 20u;

// Never below 0; not a number becomes 0.
uvec4 pack_light(vec3 light)
{
    light = clamp(finite_or_zero(light), 0.0, 3e38);
    uint exponent = max(floatBitsToUint(max_component(light)) >> 23, LEAST_LIGHT_EXPONENT);
    float scale = uintBitsToFloat(271u - exponent << 23);  // the largest becomes LIGHT_STEPS / 2 to LIGHT_STEPS
    uvec3 whole = uvec3(min(light * scale + 0.5, LIGHT_STEPS - 1.0));
    return uvec4(whole.x | whole.y << 18, whole.y >> 14 | whole.z << 4 | exponent << 22, 0u, 0u);
}

vec3 unpack_light(uvec2 stored)
{
    uvec3 whole = uvec3(stored.x & 0x3FFFFu, stored.x >> 18 | (stored.y & 15u) << 14, stored.y >> 4 & 0x3FFFFu);
    return vec3(whole) * uintBitsToFloat((stored.y >> 22) - 17u << 23);
}
