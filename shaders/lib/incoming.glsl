// SPDX-License-Identifier: GPL-3.0-or-later
// What arrives along a ray: light that surfaces pass on, and light straight from where it is made.
//
// The including program may define HAS_WORLD, WORLD_IS_DRAWN, HAS_EMITTERS (and then sets emission_amount) and
// GATHER_OCCLUSION.

#include "lib/clamp.glsl"
#include "lib/radiance.glsl"
#include "lib/sampling.glsl"
#if HAS_WORLD
#include "lib/world.glsl"
#endif
#if WORLD_IS_DRAWN
#include "lib/world_weight.glsl"
#endif

#if HAS_EMITTERS
#include "lib/emitter.glsl"

uniform float emission_amount;   // factor on what emitters send
#endif

uniform float max_distance;      // cells

struct Incoming {
    vec3 bounced;    // off a surface, W/(m2 sr)
    vec3 emitted;    // straight from the world: what drawn directions leave of it
    vec3 glow;       // straight from an emitter
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

// What the ray that has met `hit`, or nothing, brings. GATHER_OCCLUSION: surfaces pass nothing on. `density`: rays that
// the caller sends for each steradian there, which weighs the emission they meet against points drawn on emitters, and
// the world against directions drawn by its light.
Incoming incoming_from(Hit hit, vec3 origin, vec3 direction, float density, uint seed)
{
    Incoming found = Incoming(vec3(0.0), vec3(0.0), vec3(0.0), hit.distance);
    if (hit.triangle == NONE_INDEX) {
        found.emitted = limited(world_or_black(direction));
#if WORLD_IS_DRAWN
        found.emitted *= world_ray_weight(direction, density);
#endif
    }
#if !GATHER_OCCLUSION
    else {
        found.bounced = limited(face_radiance(face_at_hit(origin + direction * hit.distance, hit, hash(seed, 0x2545F4u))));
#if HAS_EMITTERS
        Emitted emission = emission_met(hit.triangle, origin, direction, hit.distance, density);
        found.glow = emission_amount * emission.weight * emission.radiance;
#endif
    }
#endif
    return found;
}

Incoming incoming(vec3 origin, vec3 direction, uint ray_mask, float density, uint seed)
{
    // What is nearest, for occlusion too: lists of triangles are in no order, and how near it is decides how far light is
    // shared between pixels.
    Hit hit = trace(origin, direction, max_distance, ray_mask, false, seed);
    return incoming_from(hit, origin, direction, density, seed);
}
