// SPDX-License-Identifier: GPL-3.0-or-later
// What a ray that is followed to the next layer of surfaces is to bring of light straight from where it is made; points on
// emitters and drawn directions of the world bring the rest.
//
// The including program defines RAYS_OF_PIXELS and WORLD_IS_DRAWN.

#include "lib/ray.glsl"

#if WORLD_IS_DRAWN
const float SHARE_UNITS = 4095.0;  // two shares of twelve bits each make a whole number that a float holds
#endif

// Share of the emission of the surface that the ray meets, and of the world's light where it meets none after all.
float pack_shares(float emission, float world)
{
#if WORLD_IS_DRAWN
    return round(emission * SHARE_UNITS) * (SHARE_UNITS + 1.0) + round(world * SHARE_UNITS);
#else
    return emission;
#endif
}

#if RAYS_OF_PIXELS
vec2 ray_shares(ivec2 pixel)
{
    float packed_shares = imageLoad(rays_img, ivec2(2 * pixel.x + 1, pixel.y)).w;
#if WORLD_IS_DRAWN
    float emission = floor(packed_shares / (SHARE_UNITS + 1.0));
    return vec2(emission, packed_shares - emission * (SHARE_UNITS + 1.0)) / SHARE_UNITS;
#else
    return vec2(packed_shares, 1.0);
#endif
}
#endif
