// SPDX-License-Identifier: GPL-3.0-or-later
// What arrives along a ray: light that surfaces pass on, and light straight from where it is made.

#include "lib/clamp.glsl"
#include "lib/radiance.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif

uniform float max_distance;      // cells

struct Incoming {
    vec3 bounced;    // off a surface, W/(m2 sr)
    vec3 emitted;    // straight from the world
    float distance;  // of the surface, cells; max_distance when none was met
};

vec3 world_or_black(vec3 direction)
{
#if HAS_WORLD
    return world_along(direction);
#else
    return vec3(0.0);
#endif
}

// What the ray that has met `hit`, or nothing, brings. GATHER_OCCLUSION: surfaces pass nothing on.
Incoming incoming_from(Hit hit, vec3 origin, vec3 direction, uint seed)
{
    Incoming found = Incoming(vec3(0.0), vec3(0.0), hit.distance);
    if (hit.triangle == NONE_INDEX) {
        found.emitted = limited(world_or_black(direction));
    }
#if !GATHER_OCCLUSION
    else {
        found.bounced = limited(face_radiance(face_at_hit(origin + direction * hit.distance, hit, hash(seed, 0x2545F4u))));
    }
#endif
    return found;
}

Incoming incoming(vec3 origin, vec3 direction, uint ray_mask, uint seed)
{
    Hit hit = trace(origin, direction, max_distance, ray_mask, GATHER_OCCLUSION != 0, seed);
    return incoming_from(hit, origin, direction, seed);
}
