// SPDX-License-Identifier: GPL-3.0-or-later
// The ray along which each pixel of a layer of surface pictures looks, in grid space: the camera's, or one of its own.
//
// The including program defines RAYS_OF_PIXELS: 1 when each pixel's ray is in rays_img, and WORLD_IS_DRAWN.

#include "lib/camera.glsl"

#if RAYS_OF_PIXELS
layout(binding = IMG_RAYS, rgba32f) uniform image2D rays_img;  // two texels a pixel: origin, width; direction (octahedral), spread, emission
#endif

struct Ray {
    vec3 origin;
    vec3 direction;  // unit
    float width;     // side of the area that the ray stands for at its origin, cells
    float spread;    // growth of that side with each cell
};

#if WORLD_IS_DRAWN
// Two shares of twelve bits each, as a whole number that a float holds.
const float SHARE_UNITS = 4095.0;

float pack_shares(float emission, float world)
{
    return round(emission * SHARE_UNITS) * (SHARE_UNITS + 1.0) + round(world * SHARE_UNITS);
}
#endif

#if RAYS_OF_PIXELS
// Shares that a pixel's ray is to bring of the emission of the surface that it meets (x), and of the world's light where it
// meets none (y); points on emitters and drawn directions bring the rest.
vec2 ray_shares(ivec2 pixel)
{
    float shares = imageLoad(rays_img, ivec2(2 * pixel.x + 1, pixel.y)).w;
#if WORLD_IS_DRAWN
    float emission = floor(shares / (SHARE_UNITS + 1.0));
    return vec2(emission, shares - emission * (SHARE_UNITS + 1.0)) / SHARE_UNITS;
#else
    return vec2(shares, 1.0);
#endif
}
#endif

Ray pixel_ray(ivec2 pixel)
{
    Ray ray;
#if RAYS_OF_PIXELS
    vec4 a = imageLoad(rays_img, ivec2(2 * pixel.x, pixel.y));
    vec4 b = imageLoad(rays_img, ivec2(2 * pixel.x + 1, pixel.y));
    ray = Ray(a.xyz, octahedral_decode(b.xy), a.w, b.z);
#else
    camera_ray(pixel, ray.origin, ray.direction);
    ray.width = pixel_footprint(0.0, ray.direction);
    ray.spread = pixel_footprint(1.0, ray.direction) - ray.width;
#endif
    return ray;
}
