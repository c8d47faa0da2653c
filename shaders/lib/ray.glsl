// SPDX-License-Identifier: GPL-3.0-or-later
// The ray along which each pixel of a layer of surface pictures looks, in grid space: the camera's, or one of its own.
//
// The including program defines RAYS_OF_PIXELS: 1 when each pixel's ray is in rays_img.

#include "lib/camera.glsl"

#if RAYS_OF_PIXELS
// Two texels a pixel: origin, width; direction (octahedral), spread, shares (lib/ray_shares.glsl).
layout(binding = IMG_RAYS, rgba32f) uniform image2D rays_img;
#endif

struct Ray {
    vec3 origin;
    vec3 direction;  // unit
    float width;     // side of the area that the ray stands for at its origin, cells
    float spread;    // growth of that side with each cell
};

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
