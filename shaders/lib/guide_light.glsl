// SPDX-License-Identifier: GPL-3.0-or-later
// What light counts for guides: its luminance to a power.

#include "lib/common.glsl"

const float GUIDE_POWER = 1.5;  // between mean radiance, which rays should follow where a bin is evenly lit, and its root
                                // mean square, where it is not
const float MOST_RADIANCE = 1e15;  // what is brighter counts as this: its power is finite

float guide_light(vec3 radiance)
{
    return pow(clamp(luminance(radiance), 0.0, MOST_RADIANCE), GUIDE_POWER);
}
