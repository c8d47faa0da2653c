// SPDX-License-Identifier: GPL-3.0-or-later
// The largest radiance that one sample of indirect light may bring.

#include "lib/common.glsl"

uniform float clamp_indirect;  // W/(m2 sr); 0: no clamping

vec3 limited(vec3 radiance)
{
    float largest = max_component(radiance);
    return clamp_indirect > 0.0 && largest > clamp_indirect ? radiance * (clamp_indirect / largest) : radiance;
}
