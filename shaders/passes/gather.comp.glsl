// SPDX-License-Identifier: GPL-3.0-or-later
// Diffuse light at each pixel: what leaves the voxel faces that stratified rays meet, and the world's light.
// Input: surface pictures, faces' radiance, triangles of cells.
// Output: incoming_out: mean incoming radiance, to be multiplied by the diffuse reflectance.
// KEEPS_EMITTED: emitted_out: what of it comes straight from the world or an emitter.
// GLOW_IS_DIRECT: diffuse_img of pass `direct`, to which what comes straight from emitters is added: points drawn there
// have brought the rest of it, it is as sharp as direct light, and is not shared between pixels.
// WORLD_IS_DRAWN: directions drawn by the world's light have brought the rest of it in pass `direct`. What is left for rays
// has nothing sharp, and is shared between pixels as all light is.
// FILLS: only for pixels whose light has a negative w; direct light has brought what GLOW_IS_DIRECT is about.
// HAS_GUIDES: half of the rays are drawn by guides, the other half evenly, by the cosine; each is weighed by the chance that
// either would have sent it there. Against what is drawn besides (GLOW_IS_DIRECT, WORLD_IS_DRAWN) rays are weighed as if all
// were drawn evenly: other passes that weigh it know of no guides, and any weights that add up to 1 are right.
// KEEPS_NEARNESS: nearness_img: sum over passes of the mean of 1 / distance, 1/cells; w of incoming_out: its mean.

#include "lib/incoming.glsl"
#include "lib/received.glsl"
#include "lib/sampling.glsl"
#include "lib/pixel.glsl"
#include "lib/camera.glsl"
#if GATHER_CONES
#include "lib/cone.glsl"
#endif
#if HAS_GUIDES
#include "lib/guide.glsl"
#endif

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

#if FILLS
layout(binding = IMG_0, rgba32f) uniform image2D incoming_out;
#else
layout(binding = IMG_0, rgba32f) writeonly uniform image2D incoming_out;
#endif
#if KEEPS_EMITTED
layout(binding = IMG_1, rgba32f) writeonly uniform image2D emitted_out;
#endif

#if GLOW_IS_DIRECT && !FILLS
layout(binding = IMG_3, rgba32f) uniform image2D diffuse_img;
#endif
#if KEEPS_NEARNESS
layout(binding = IMG_2, r32f) uniform image2D nearness_img;
#endif

uniform ivec2 tile_first;
uniform uint sample_index;       // of gathers, counted through frames that take over light
#if KEEPS_NEARNESS
uniform uint pass_index;         // of gathers of this picture
#endif
uniform uint ray_count;          // directions in this pass
uniform uint random_seed;

#if !GATHER_CONES
// One direction of a pixel.
struct Drawn {
    vec3 direction;
    float weight;   // of what it brings: cosine / pi / chance for each steradian; 0 below the surface
    float density;  // rays for each steradian, were all drawn evenly
};

#if HAS_GUIDES
// Veach and Guibas 1995, "Optimally Combining Sampling Techniques": the balance heuristic. Of each pair of rays one is
// guided, which one is random. Either way takes one point after the other of its own sequence.
Drawn draw(Pixel p, Guide guide, uint index, uint seed, uvec2 shift)
{
    bool has_choice = guide.first != NONE_INDEX;
    bool guided = has_choice && ((index ^ hash(seed, index >> 1)) & 1u) == 1u;
    vec2 u = sample_2d(has_choice ? index >> 1 : index, guided ? shift + 0x9E3779B9u : shift);
    vec3 direction = guided ? sample_guide(guide, u) : sample_cosine(p.normal, u);
    if (!guided && dot(direction, p.geometric_normal) <= 0.0) {
        direction = mirrored(direction, p.geometric_normal);
    }
    float even = mirrored_density(p.normal, p.geometric_normal, direction) / PI;
    float chance = has_choice ? 0.5 * even + 0.5 * guide_density(guide, direction) : even;
    float share = received_cosine(p.normal, p.geometric_normal, direction) / PI;
    return Drawn(direction, share / max(chance, 1e-20), float(ray_count) * share);
}
#else
Drawn draw(Pixel p, uint index, uvec2 shift)
{
    vec3 direction = sample_cosine(p.normal, sample_2d(index, shift));
    direction = dot(direction, p.geometric_normal) > 0.0 ? direction : mirrored(direction, p.geometric_normal);
    float even = mirrored_density(p.normal, p.geometric_normal, direction);
    float share = received_cosine(p.normal, p.geometric_normal, direction);
    return Drawn(direction, share / max(even, 1e-20), float(ray_count) * share / PI);
}
#endif
#endif

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
#if FILLS
    if (imageLoad(incoming_out, at).w >= 0.0) {
        return;
    }
#endif
    Pixel p = fetch_pixel(at);
    vec3 bounced = vec3(0.0);
    vec3 emitted = vec3(0.0);
    vec3 glow = vec3(0.0);
    float nearness = 0.0;
    if (p.is_surface && max_component(p.diffuse) > 0.0) {
#if GATHER_CONES
        for (int k = 0; k < 6; ++k) {
            vec4 axis = hemisphere_cone(p.normal, k);
            vec4 found = trace_cone(Cone(p.position, axis.xyz, p.geometric_normal, 0.57735, max_distance));
            bounced += axis.w * found.rgb;
            emitted += axis.w * found.a * world_or_black(axis.xyz);
        }
#else
        vec3 origin = p.position + p.geometric_normal * ray_start(p.position);
        uint seed = hash(uint(at.x) | uint(at.y) << 16, random_seed);
        uvec2 shift = pixel_shift(at, random_seed);
#if HAS_GUIDES
        Guide guide = guide_at(p.position, p.geometric_normal);
#endif
        uint k = 0u;
        do {
            uint index = sample_index * ray_count + k;
#if HAS_GUIDES
            Drawn drawn = draw(p, guide, index, seed, shift);
#else
            Drawn drawn = draw(p, index, shift);
#endif
            if (drawn.weight > 0.0) {
                Incoming found = incoming(origin, drawn.direction, RAY_DIFFUSE, drawn.density, hash(seed, index));
                bounced += drawn.weight * found.bounced;
                emitted += drawn.weight * found.emitted;
                glow += drawn.weight * found.glow;
                nearness += drawn.weight / max(found.distance, 1e-3);
            }
        } while (++k < ray_count);
        float share = 1.0 / float(ray_count);
        bounced *= share;
        emitted *= share;
        glow *= share;
        nearness *= share;
#endif
    }
#if GLOW_IS_DIRECT && FILLS
    // is in the direct light already
#elif GLOW_IS_DIRECT
    imageStore(diffuse_img, at, imageLoad(diffuse_img, at) + vec4(finite_or_zero(glow), 0.0));
#else
    emitted += glow;
#endif
#if KEEPS_NEARNESS
    nearness += pass_index > 0u ? imageLoad(nearness_img, at).r : 0.0;
    imageStore(nearness_img, at, vec4(nearness));
    nearness /= float(pass_index + 1u);
#endif
    imageStore(incoming_out, at, vec4(finite_or_zero(bounced + emitted), nearness));
#if KEEPS_EMITTED
    imageStore(emitted_out, at, vec4(finite_or_zero(emitted), nearness));
#endif
}
