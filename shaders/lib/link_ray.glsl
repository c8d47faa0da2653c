// SPDX-License-Identifier: GPL-3.0-or-later
// Rays of links.
// HAS_SHADING_NORMALS: what rays would lose below the surface is mirrored (lib/received.glsl).

#include "lib/site.glsl"
#include "lib/link_shift.glsl"
#include "lib/received.glsl"

// Direction of ray k of a face; whether it is there. `shift`: link_shift of the face.
bool link_ray(Site site, uint k, uvec2 shift, uint seed, out vec3 direction)
{
    direction = sample_cosine(site.shading_normal, sample_2d(k, shift));
#if HAS_SHADING_NORMALS
    if (dot(site.normal, direction) <= 0.0) {
        direction = mirrored(direction, site.normal);
        return unit_float(hash(seed + k, 0x5BD1E9u)) < mirrored_share(site.shading_normal, site.normal);
    }
#endif
    return true;
}
