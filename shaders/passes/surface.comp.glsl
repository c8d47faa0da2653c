// SPDX-License-Identifier: GPL-3.0-or-later
// What is seen at each pixel of one batch of materials: where, which way it faces, what it reflects and emits.
// Partly transparent surfaces are there for their share of the passes; in the others the pixel is marked, and pass
// `advance` looks behind.
// IS_LAYERED: some material of the scene is partly transparent.    HAS_OPACITY: one of this batch is.
// Input: pixel list, seen_img, triangles, materials.    Output: the surface pictures.

#include "lib/geometry.glsl"
#include "lib/ray.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = BUF_SUMS) readonly buffer Bins { uint bins[]; };
layout(binding = IMG_0, r32ui) uniform uimage2D seen_img;
layout(binding = IMG_1, rgba32f) writeonly uniform image2D position_img;
layout(binding = IMG_2, rgba16) writeonly uniform image2D normal_img;
layout(binding = IMG_3, rgba16f) writeonly uniform image2D diffuse_img;
layout(binding = IMG_4, rgba16f) writeonly uniform image2D f0_img;
layout(binding = IMG_5, rgba16f) writeonly uniform image2D f90_img;
layout(binding = IMG_6, rgba32f) writeonly uniform image2D emission_img;

uniform uint batch;
uniform uint random_seed;  // of this pass and layer
#if HAS_OPACITY
uniform bool last_layer;   // nothing is looked through any more
#endif

const uint PENDING = 0x80000000u;

void main()
{
    uint index = invocation_index();
    if (index >= bins[5u * batch + 4u]) {
        return;
    }
    uint packed_pixel = pixels[bins[5u * batch + 3u] + index];
    ivec2 pixel = ivec2(packed_pixel & 0xFFFFu, packed_pixel >> 16);
    uint triangle_index = (imageLoad(seen_img, pixel).r & ~PENDING) - 1u;
    Triangle t = fetch_triangle(triangle_index);

    Ray ray = pixel_ray(pixel);
    vec2 barycentric;
    float distance;
    intersect_plane(t, ray.origin, ray.direction, barycentric, distance);
    // Kept off the triangle's edges by as much as rays start above it: a point that lies exactly where walls meet would see
    // past one of them.
    float longest = max(max(length(t.edge_1), length(t.edge_2)), length(t.edge_2 - t.edge_1));
    vec3 weights = vec3(1.0 - barycentric.x - barycentric.y, barycentric);
    weights = max(weights, min(2.0 * RAY_START / max(longest, 1e-20), 0.3));
    barycentric = weights.yz / (weights.x + weights.y + weights.z);
    vec3 position = t.corner + t.edge_1 * barycentric.x + t.edge_2 * barycentric.y;
    float footprint = ray.width + ray.spread * length(position - ray.origin);
    ShadingPoint point = shading_point(t, barycentric, -ray.direction, footprint);
    Surface s = surface_at(t, point);

    float opacity = 1.0;
#if HAS_OPACITY
    opacity = 1.0 - clamp(luminance(s.transparency), 0.0, 1.0);
    if (opacity < 1.0 && !last_layer && unit_float(hash(packed_pixel, random_seed)) >= opacity) {
        imageStore(seen_img, pixel, uvec4((triangle_index + 1u) | PENDING));
        imageStore(position_img, pixel, vec4(position, 1.0));
        return;
    }
#endif
#if IS_LAYERED
    imageStore(seen_img, pixel, uvec4(triangle_index + 1u));  // no longer marked
#endif
    float inverse = 1.0 / max(opacity, 1e-3);
    imageStore(position_img, pixel, vec4(position, 1.0));
    imageStore(normal_img, pixel, 0.5 + 0.5 * vec4(octahedral_encode(normalize(s.normal_ws)),
                                                   octahedral_encode(point.geometric_normal_ws)));
    imageStore(diffuse_img, pixel, vec4(s.diffuse * inverse, s.roughness));
    float holdout = (t.flags & TRIANGLE_HOLDOUT) != 0u ? 1.0 : 0.0;
    imageStore(f0_img, pixel, vec4(s.specular_f0 * inverse, holdout));
    imageStore(f90_img, pixel, vec4(s.specular_f90 * inverse, 0.0));
    imageStore(emission_img, pixel, vec4(s.emission * inverse, 0.0));
}
