// SPDX-License-Identifier: GPL-3.0-or-later
// What keeps light from pixels. VIEW says what it shows; see passes/view.py.
//     VIEW_SHADOW             share of the light of all lights that comes to the front of the surface
//     VIEW_AMBIENT_OCCLUSION  share of a pixel's surroundings, by the cosine, that is free as far as max_distance
// Input: surface pictures, triangles of cells, lights.    Output: value_img, w: 1 where there is a surface.

#include "lib/pixel.glsl"
#include "lib/camera.glsl"
#include "lib/trace.glsl"
#include "lib/sampling.glsl"
#if VIEW == VIEW_SHADOW
#include "lib/light.glsl"
#endif

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = IMG_0, rgba32f) writeonly uniform image2D value_img;

uniform ivec2 tile_first;
uniform uint sample_index;
uniform uint random_seed;
uniform uint ray_count;      // directions in this pass
uniform float max_distance;  // cells

#if VIEW == VIEW_SHADOW
float free_share(Pixel p, vec3 origin, uvec2 shift, uint seed)
{
    float all = 0.0, free = 0.0;
    uint i = 0u;
    do {
        Light light = fetch_light(lights_tex, i);
        LightSample s = sample_light(light, p.position, sample_2d(sample_index, shift + hash(i)));
        float value = luminance(s.irradiance);
        all += value;
        if (value > 0.0 && min(dot(p.normal, s.direction), dot(p.geometric_normal, s.direction)) > 0.0) {
            bool casts = (light.flags & LIGHT_CASTS_SHADOW) != 0u;
            start_at(origin, p.position, s.direction, s.distance);
            free += casts && is_blocked(origin, s.direction, s.distance - ray_start(p.position), hash(seed, i)) ? 0.0 : value;
        }
    } while (++i < light_count);
    return all > 0.0 ? free / all : 0.0;
}
#else
float free_share(Pixel p, vec3 origin, uvec2 shift, uint seed)
{
    float free = 0.0;
    uint k = 0u;
    do {
        uint index = sample_index * ray_count + k;
        vec3 direction = sample_cosine(p.normal, sample_2d(index, shift));
        bool leaves = dot(direction, p.geometric_normal) > 0.0;
        uint met = leaves ? trace(origin, direction, max_distance, RAY_DIFFUSE, true, hash(seed, index)).triangle : 0u;
        free += met == NONE_INDEX ? 1.0 : 0.0;
    } while (++k < ray_count);
    return free / float(ray_count);
}
#endif

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
    Pixel p = fetch_pixel(at);
    vec4 value = vec4(0.0);
    if (p.is_surface) {
        vec3 origin = p.position + p.geometric_normal * ray_start(p.position);
        uint seed = hash(uint(at.x) | uint(at.y) << 16, random_seed + sample_index);
        value = vec4(vec3(free_share(p, origin, pixel_shift(at, random_seed), seed)), 1.0);
    }
    imageStore(value_img, at, value);
}
