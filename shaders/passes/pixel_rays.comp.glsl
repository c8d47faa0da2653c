// SPDX-License-Identifier: GPL-3.0-or-later
// Rays that gather diffuse light at the surface that one pixel shows, to be drawn: one thread for each.
// GATHER_CONES: the six cones instead, as far as their axes are free.
// Input: triangles of cells, faces' radiance, the world, emitters.    Output: rays, see passes/view.py.

#include "lib/incoming.glsl"
#include "lib/camera.glsl"
#if GATHER_CONES
#include "lib/cone.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

// Of each ray: its start (w: 1 where there is a surface), its end (w: 1 where it meets one), what it brings (w: its share).
layout(std430, binding = BUF_RESULTS) writeonly buffer Rays { vec4 rays[]; };

uniform ivec2 pixel;
uniform uint ray_count;
uniform uint random_seed;
uniform float farthest;  // cells: where rays that meet nothing end

void main()
{
    uint index = gl_LocalInvocationID.x;
    vec3 eye, view;
    camera_ray(pixel, eye, view);
    Hit seen = trace(eye, view, 1e30, RAY_CAMERA, false, 0u);
    bool is_there = seen.triangle != NONE_INDEX && index < ray_count;
    vec3 normal = is_there ? seen.normal : vec3(0.0, 0.0, 1.0);
    vec3 position = eye + view * seen.distance;
    vec3 origin = position + normal * ray_start(position);
    Incoming found = Incoming(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
    float share = 1.0 / float(ray_count);
#if GATHER_CONES
    vec4 axis = hemisphere_cone(normal, int(min(index, 5u)));
    vec3 direction = axis.xyz;
    share = axis.w;
    if (is_there) {
        vec4 gathered = trace_cone(Cone(origin, direction, normal, 0.57735, max_distance));
        found.bounced = gathered.rgb;
        found.emitted = gathered.a * world_or_black(direction);
        found.distance = trace(origin, direction, max_distance, RAY_DIFFUSE, false, 0u).distance;
    }
#else
    vec3 direction = sample_cosine(normal, sample_2d(index, pixel_shift(pixel, random_seed)));
    if (is_there) {
        found = incoming(origin, direction, RAY_DIFFUSE, 0.0, hash(random_seed, index));
    }
#endif
    bool has_met = found.distance < min(max_distance, 1e29);
    vec3 end = origin + direction * (has_met ? found.distance : farthest);
    rays[3u * index] = vec4(origin, is_there ? 1.0 : 0.0);
    rays[3u * index + 1u] = vec4(end, has_met ? 1.0 : 0.0);
    rays[3u * index + 2u] = vec4(finite_or_zero(found.bounced + found.emitted + found.glow), share);
}
