// SPDX-License-Identifier: GPL-3.0-or-later
// A list of light, packed and unpacked. Output: (unpacked, 0), the two words in halves of 16 bits.

#include "lib/packed_light.glsl"
#include "tests/rows.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    uvec2 stored = pack_light(inputs[index].xyz).xy;
    results[2u * index] = vec4(unpack_light(stored), 0.0);
    results[2u * index + 1u] = vec4(stored.x & 0xFFFFu, stored.x >> 16, stored.y & 0xFFFFu, stored.y >> 16);
}
