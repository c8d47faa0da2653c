// SPDX-License-Identifier: GPL-3.0-or-later
// Light that a Lambertian surface receives where it is shaded by a normal n that is not that of its plane, g. Of directions
// spread by the cosine around n the share (1 - n.g) / 2 lies below the plane, and bounce for bounce so much light would be
// lost between the facets of smooth shapes. Those directions are mirrored at the plane instead: all of them where the
// normals are so near each other as there, none where they are not: bumps, and boxes shaded smooth, are darker, as in
// Cycles.

#include "lib/common.glsl"

const float ALIKE_COSINE = 0.985;   // 10 degrees: normals of a sphere of 18 segments; .75 % would be lost
const float UNLIKE_COSINE = 0.94;   // 20 degrees: 3 % are lost

// Share of the directions below the plane that is mirrored.
float mirrored_share(vec3 n, vec3 g)
{
    return clamp((dot(n, g) - UNLIKE_COSINE) / (ALIKE_COSINE - UNLIKE_COSINE), 0.0, 1.0);
}

vec3 mirrored(vec3 direction, vec3 g)
{
    return direction - 2.0 * dot(direction, g) * g;
}

// Cosine that light from there counts by; 0 below the plane.
float received_cosine(vec3 n, vec3 g, vec3 direction)
{
    float straight = max(dot(n, direction), 0.0);
    float bent = max(dot(n, mirrored(direction, g)), 0.0);
    return dot(g, direction) > 0.0 ? straight + mirrored_share(n, g) * bent : 0.0;
}

// Density of directions spread by the cosine around n when all that lie below are mirrored, times pi.
float mirrored_density(vec3 n, vec3 g, vec3 direction)
{
    return max(dot(n, direction), 0.0) + max(dot(n, mirrored(direction, g)), 0.0);
}
