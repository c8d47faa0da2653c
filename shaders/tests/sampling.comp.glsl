// SPDX-License-Identifier: GPL-3.0-or-later
// Functions of lib/common.glsl and lib/sampling.glsl for a list of (vector, 0), (u, number, 0).
// Output: (sample_cosine around the vector, 0), (sample_disk, sample_2d of the number), (octahedral round trip, 0),
// (unit_vec3 of the number, 0), (pixel_shift of pixel number & 255, number >> 8, 0, 0).

#include "lib/sampling.glsl"
#include "tests/rows.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    vec3 n = inputs[2u * index].xyz;
    vec3 u = inputs[2u * index + 1u].xyz;
    uint number = uint(u.z);
    results[5u * index] = vec4(sample_cosine(n, u.xy), 0.0);
    results[5u * index + 1u] = vec4(sample_disk(u.xy), sample_2d(number, 7u));
    results[5u * index + 2u] = vec4(octahedral_decode(octahedral_encode(n)), 0.0);
    uvec2 shift = pixel_shift(ivec2(number & 0xFFu, number >> 8), 5u);
    results[5u * index + 3u] = vec4(unit_vec3(number), 0.0);
    results[5u * index + 4u] = vec4(unit_float(shift.x), unit_float(shift.y), 0.0, 0.0);
}
