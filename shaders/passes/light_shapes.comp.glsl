// SPDX-License-Identifier: GPL-3.0-or-later
// Lights that the camera sees: where one is nearer than the surface, the pixel shows the light.
// Input: lights, position_tex.    Output: position_img (w = 2), emission_img, and nothing to reflect.

#include "lib/light.glsl"
#include "lib/camera.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = TEX_POSITION) uniform sampler2D position_tex;
layout(binding = IMG_1, rgba32f) writeonly uniform image2D position_img;
layout(binding = IMG_3, rgba16f) writeonly uniform image2D diffuse_img;
layout(binding = IMG_4, rgba16f) writeonly uniform image2D f0_img;
layout(binding = IMG_5, rgba16f) writeonly uniform image2D f90_img;
layout(binding = IMG_6, rgba32f) writeonly uniform image2D emission_img;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, picture_size))) {
        return;
    }
    vec3 origin, direction;
    camera_ray(pixel, origin, direction);
    vec4 surface = texelFetch(position_tex, pixel, 0);
    float nearest = surface.w > 0.0 ? length(surface.xyz - origin) : 1e29;
    vec3 radiance = vec3(0.0);
    for (uint k = 0u; k < light_count; ++k) {
        Light light = fetch_light(lights_tex, k);
        float distance;
        if ((light.flags & RAY_CAMERA) == 0u) {
            continue;
        }
        vec3 seen = light_along_ray(light, origin, direction, distance);
        bool at_infinity = distance > 1e29 && surface.w == 0.0;
        if (max_component(seen) > 0.0 && (distance < nearest || at_infinity)) {
            nearest = min(distance, nearest);
            radiance = seen;
        }
    }
    if (max_component(radiance) > 0.0) {
        imageStore(position_img, pixel, vec4(origin + direction * min(nearest, 1e6), 2.0));
        imageStore(diffuse_img, pixel, vec4(0.0, 0.0, 0.0, 1.0));
        imageStore(f0_img, pixel, vec4(0.0));
        imageStore(f90_img, pixel, vec4(0.0));
        imageStore(emission_img, pixel, vec4(radiance, 0.0));
    }
}
