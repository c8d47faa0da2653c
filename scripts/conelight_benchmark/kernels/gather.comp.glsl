// SPDX-License-Identifier: GPL-3.0-or-later
// Diffuse light at each pixel by a published set of cones, through the levels that lib/cone.glsl reads. It stands in for
// passes/gather.comp.glsl with GATHER_CONES, whose input and output it has.
//
// KERNEL is one of
// KERNEL_SEED_6:  six cones of tan(half-angle) 0.577: one along the normal, five towards normal + 0.866 of the tangent
//                 plane, so tilted by 41 degrees; shares 1/4 and 3/20 (VCTRenderer, and after it Masterclass-VXGI-Sponza).
//                 Their shares sum to pi there, on radiance already multiplied by it; here to 1, as energy asks.
// KERNEL_SIX_60:  the same with the five tilted by 60 degrees (Crassin et al. 2011; Godot's VoxelGI at high quality).
// KERNEL_SIXTEEN: sixteen directions spread over the sphere, fixed in space, full angle 50 degrees; of those above the
//                 surface each counts by its cosine, over the sum of cosines (The Tomorrow Children; Wicked Engine).

#include "lib/incoming.glsl"
#include "lib/pixel.glsl"
#include "lib/camera.glsl"
#include "lib/cone.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = IMG_0, rgba32f) writeonly uniform image2D incoming_out;
#if KEEPS_EMITTED
layout(binding = IMG_1, rgba32f) writeonly uniform image2D emitted_out;
#endif

uniform ivec2 tile_first;
// What a gather by random rays is told; cones are the same in every pass.
uniform uint sample_index;
uniform uint ray_count;
uniform uint random_seed;

#if KERNEL == KERNEL_SIXTEEN
const int CONE_COUNT = 16;
const float TAN_HALF = 0.4663077;  // 25 degrees

// Electrons on a sphere (Thomson's problem, N = 16): a tetrahedron, and the twelve places to which its rotations bring
// one point.
vec4 cone(vec3 normal, int index)
{
    const vec3 POINT = vec3(0.243404, -0.910192, 0.335119);
    int corner = index % 4, turn = index / 4;
    vec3 direction = turn == 0 ? POINT.xyz : turn == 1 ? POINT.yzx : turn == 2 ? POINT.zxy : vec3(0.5773503);
    direction *= vec3(corner < 2 ? 1.0 : -1.0, corner % 2 == 0 ? 1.0 : -1.0, corner == 0 || corner == 3 ? 1.0 : -1.0);
    return vec4(direction, max(dot(normal, direction), 0.0));
}
#else
const int CONE_COUNT = 6;
const float TAN_HALF = 0.5773503;  // 30 degrees

vec4 cone(vec3 normal, int index)
{
    if (index == 0) {
        return vec4(normal, 0.25);
    }
    vec3 t, b;
    basis(normal, t, b);
    float phi = 2.0 * PI * float(index - 1) / 5.0;
    float up = KERNEL == KERNEL_SEED_6 ? 1.0 : 0.5;
    return vec4(normalize(up * normal + 0.8660254 * (cos(phi) * t + sin(phi) * b)), 0.15);
}
#endif

// Mean radiance of the world in a cone.
vec3 world_in_cone(vec3 axis)
{
#if HAS_WORLD && WORLD_IS_TEXTURE
    const int POINTS = 16;
    vec3 t, b;
    basis(axis, t, b);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < POINTS; ++i) {
        float radius = TAN_HALF * sqrt((float(i) + 0.5) / float(POINTS));
        float phi = 2.3999632 * float(i);  // Vogel's spiral
        sum += world_along(normalize(axis + radius * (cos(phi) * t + sin(phi) * b)));
    }
    return sum / float(POINTS);
#else
    return world_or_black(axis);
#endif
}

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
    Pixel p = fetch_pixel(at);
    vec3 bounced = vec3(0.0);
    vec3 emitted = vec3(0.0);
    if (p.is_surface && max_component(p.diffuse) > 0.0) {
        float shares = 0.0;
        for (int k = 0; k < CONE_COUNT; ++k) {
            vec4 axis = cone(p.normal, k);
            if (axis.w > 0.0) {
                vec4 found = trace_cone(Cone(p.position, axis.xyz, p.geometric_normal, TAN_HALF, max_distance));
                bounced += axis.w * found.rgb;
                emitted += axis.w * found.a * world_in_cone(axis.xyz);
                shares += axis.w;
            }
        }
        bounced /= shares;
        emitted /= shares;
    }
    imageStore(incoming_out, at, vec4(finite_or_zero(bounced + emitted), 0.0));
#if KEEPS_EMITTED
    imageStore(emitted_out, at, vec4(finite_or_zero(emitted), 0.0));
#endif
}
