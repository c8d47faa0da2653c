// SPDX-License-Identifier: GPL-3.0-or-later
// Rays through pixels, in grid space. Origin and direction are affine in the pixel's place, for perspective
// (the direction moves) and orthographic cameras (the origin moves) alike.

uniform vec3 ray_origin;        // of pixel (0, 0), lower left corner
uniform vec3 ray_origin_x;      // change from one pixel to the next
uniform vec3 ray_origin_y;
uniform vec3 ray_direction;     // not normalized
uniform vec3 ray_direction_x;
uniform vec3 ray_direction_y;
uniform ivec2 picture_size;     // pixels
uniform vec2 pixel_offset;      // where in the pixel this pass samples

void camera_ray(ivec2 pixel, out vec3 origin, out vec3 direction)
{
    vec2 at = vec2(pixel) + pixel_offset;
    origin = ray_origin + ray_origin_x * at.x + ray_origin_y * at.y;
    direction = normalize(ray_direction + ray_direction_x * at.x + ray_direction_y * at.y);
}

// Side of a pixel's footprint at distance t along its ray, cells.
float pixel_footprint(float t, vec3 direction)
{
    vec3 d = ray_direction + ray_direction_x * float(picture_size.x) * 0.5;
    return length(ray_origin_x) + t * length(ray_direction_x) / max(length(d), 1e-20);
}
