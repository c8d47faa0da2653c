// SPDX-License-Identifier: GPL-3.0-or-later
// What is seen at each pixel of one batch of materials: where, which way it faces, what it reflects and emits.
// Partly transparent surfaces are there for their share of the passes; in the others the pixel is marked, and pass
// `advance` looks behind. Of several GGX lobes one is there, each for its share of the passes and in return as much
// stronger.
// IS_LAYERED: some material of the scene is partly transparent.    HAS_OPACITY: one of this batch is.
// Input: pixel list, seen_img, triangles, materials.    Output: the surface pictures.

#include "lib/geometry.glsl"
#include "lib/closure.glsl"
#include "lib/level.glsl"
#include "lib/ray.glsl"
#include "lib/sampling.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = BUF_RESULTS) readonly buffer Bins { uint bins[]; };
layout(binding = IMG_0, r32ui) uniform uimage2D seen_img;
layout(binding = IMG_1, rgba32f) writeonly uniform image2D position_img;
layout(binding = IMG_2, rgba16) writeonly uniform image2D normal_img;
layout(binding = IMG_3, rgba16f) writeonly uniform image2D diffuse_img;
layout(binding = IMG_4, rgba16f) writeonly uniform image2D f0_img;
layout(binding = IMG_5, rgba16f) writeonly uniform image2D f90_img;
layout(binding = IMG_6, rgba32f) writeonly uniform image2D emission_img;

uniform uint batch;
uniform uint random_seed;  // of this pass and of what it looks through
uniform float texture_scale;  // passes look at parts of a pixel: so wide, in sides of it
uniform uint turn_seed;    // of all passes
uniform uint sample_index;
#if HAS_OPACITY
uniform uint behind;       // so many surfaces were looked through
uniform bool last_layer;   // nothing is looked through any more

// What decides whether a pass looks through a surface: even over passes and over pixels side by side, for the first two
// that lie one behind the other. Multiples of roots of 3 and 7 go with none of the other sequences of a pixel.
float random_of_layer(uint packed_pixel)
{
    uvec2 even = pixel_shift(ivec2(packed_pixel & 0xFFFFu, packed_pixel >> 16), turn_seed - behind);
    even += sample_index * uvec2(3144134277u, 2773480762u);
    return unit_float(behind == 0u ? even.x : (behind == 1u ? even.y : hash(packed_pixel, random_seed)));
}
#endif

const uint PENDING = 0x80000000u;

// What the pictures hold of a surface.
struct Shown {
    vec3 diffuse;    // glass: transmission
    vec3 f0;
    vec3 f90;
    float ior;       // negative: glass
    float roughness;
    vec3 normal;
};

// `random`, 0..1, chooses by what each lobe sends to the viewer.
Shown shown_lobe(Surface s, vec3 view, float random)
{
    float cosine = max(dot(s.normal_ws, view), 0.0);
    float specular = luminance(specular_directional_albedo(s.specular_f0, s.specular_f90, s.specular_ior, s.roughness, cosine));
    Shown shown = Shown(s.diffuse, s.specular_f0, s.specular_f90, s.specular_ior, s.roughness, s.normal_ws);
#if HAS_GLASS
    float glass = luminance(s.glass_f0 + s.glass_transmission);
    float opaque = luminance(s.diffuse) + specular + s.coat;
    float share = glass / max(glass + opaque, 1e-20);
    if (random < share) {
        float more = 1.0 / share;
        return Shown(s.glass_transmission * more, s.glass_f0 * more, s.glass_f90 * more, -max(s.glass_ior, 1e-3),
                     s.glass_roughness, s.normal_ws);
    }
    random = (random - share) / max(1.0 - share, 1e-6);
    float rest = 1.0 / max(1.0 - share, 1e-6);
    shown.diffuse *= rest;
    shown.f0 *= rest;
    shown.f90 *= rest;
#else
    const float rest = 1.0;
#endif
#if HAS_COAT
    float coat = s.coat * dielectric_reflectance(fresnel_cosine(max(dot(s.coat_normal_ws, view), 0.0), s.coat_roughness), s.coat_ior);
    float coat_share = coat / max(coat + specular + (s.coat_bends ? luminance(s.diffuse) : 0.0), 1e-20);
    if (random < coat_share) {
        float more = rest / coat_share;
        float ratio = (s.coat_ior - 1.0) / (s.coat_ior + 1.0);
        shown = Shown(s.coat_bends ? vec3(0.0) : shown.diffuse, vec3(s.coat * ratio * ratio * more), vec3(s.coat * more),
                      s.coat_ior, s.coat_roughness, s.coat_normal_ws);
    } else {
        float more = 1.0 / (1.0 - coat_share);
        shown.diffuse *= s.coat_bends ? more : 1.0;
        shown.f0 *= more;
        shown.f90 *= more;
    }
#endif
    return shown;
}

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
    float gap = 2.0 * ray_start(ray.origin + ray.direction * distance);
    weights = max(weights, min(gap / max(longest, 1e-20), 0.3));
    barycentric = weights.yz / (weights.x + weights.y + weights.z);
    vec3 position = t.corner + t.edge_1 * barycentric.x + t.edge_2 * barycentric.y;
    float footprint = texture_scale * (ray.width + ray.spread * length(position - ray.origin));
    ShadingPoint point = shading_point(t, barycentric, -ray.direction, footprint);
    Surface s = surface_at(t, point);

    float opacity = 1.0;
#if HAS_OPACITY
    opacity = 1.0 - clamp(luminance(s.transparency), 0.0, 1.0);
    if (opacity < 1.0 && !last_layer && random_of_layer(packed_pixel) >= opacity) {
        imageStore(seen_img, pixel, uvec4((triangle_index + 1u) | PENDING));
        imageStore(position_img, pixel, vec4(position, 1.0));
        return;
    }
#endif
#if IS_LAYERED
    imageStore(seen_img, pixel, uvec4(triangle_index + 1u));  // no longer marked
#endif
    float inverse = 1.0 / max(opacity, 1e-3);
    // The golden ratio's multiples spread evenly over the passes of a pixel.
    uint turn = hash(packed_pixel, turn_seed) + sample_index * 2654435769u;
    Shown shown = shown_lobe(s, point.incoming_ws, unit_float(turn));
    imageStore(position_img, pixel, vec4(position, 1.0));
    imageStore(normal_img, pixel, 0.5 + 0.5 * vec4(octahedral_encode(normalize(shown.normal)),
                                                   octahedral_encode(point.geometric_normal_ws)));
    imageStore(diffuse_img, pixel, vec4(shown.diffuse * inverse, shown.roughness));
    float holdout = (t.flags & TRIANGLE_HOLDOUT) != 0u ? 1.0 : 0.0;
    imageStore(f0_img, pixel, vec4(shown.f0 * inverse, holdout));
    imageStore(f90_img, pixel, vec4(shown.f90 * inverse, shown.ior));
    imageStore(emission_img, pixel, vec4(s.emission * inverse, 0.0));
}
