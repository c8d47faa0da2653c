// SPDX-License-Identifier: GPL-3.0-or-later
// One level of an edge-avoiding wavelet filter over light at pixels: each pixel takes the mean of nine pixels, `stride`
// apart, weighted by how alike their light can be.
// Dammertz et al. 2010, "Edge-Avoiding A-Trous Wavelet Transform for Fast Global Illumination Filtering". Differs:
// - Weights follow the error bound of irradiance caching: light is shared widely in the open, and hardly where surfaces
//   are near. Ward et al. 1988, "A Ray Tracing Solution for Diffuse Interreflection".
// - Pixels on opposite sides get the same weight, the smaller one, so that gradients stay what they are up to edges.
// STEP 0 shares nothing but w, without regard to edges: weights that follow what a pixel's own rays have met would favour
// what is far, and with it bright or dark light.    STEP 1: a level.    STEP 2: the last one.
// GLOSSY: reflections. Light is shared as radiance that arrives within the lobe: what the surface reflects is taken out in
// STEP 0 and put back in STEP 2. The narrower the lobe, the less may directions differ: w is divided by its width.
// Input: surface pictures, gathered_tex (w: mean of 1 / distance to surfaces, 1/cells).    Output: gathered_out, the same.

#include "lib/pixel.glsl"
#include "lib/camera.glsl"
#if GLOSSY
#include "lib/lobe.glsl"
#endif

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

SOURCE_PICTURE(TEX_GATHERED, SOURCE_GATHERED, rgba32f) gathered_tex;
layout(binding = IMG_0, rgba32f) writeonly uniform image2D gathered_out;

uniform ivec2 tile_first;
uniform int stride;            // pixels
uniform float tolerance;       // error at which a weight becomes zero: a share of the light
uniform float least_radius;    // pixels: light is shared so far even where surfaces are near
#if GLOSSY
vec3 specular_color(ivec2 at)
{
    vec3 origin, direction;
    camera_ray(at, origin, direction);
    return specular_color(fetch_pixel(at), direction);
}
#endif

float lobe_width(ivec2 at)
{
#if GLOSSY
    return lobe_width(fetch_source(diffuse_tex, at).w);
#else
    return 1.0;
#endif
}

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
    vec4 position = fetch_source(position_tex, at);
    if (position.w != 1.0) {
        imageStore(gathered_out, at, vec4(0.0));  // nothing else is known of a pixel that sees no surface
        return;
    }
#if STEP == 0
    vec4 light = fetch_source(gathered_tex, at);
    vec2 nearness = vec2(0.0);
    for (int k = 0; k < 25; ++k) {
        ivec2 there = clamp(at + 2 * ivec2(k % 5 - 2, k / 5 - 2), ivec2(0), picture_size - 1);
        bool usable = fetch_source(position_tex, there).w == 1.0;
        nearness += usable ? vec2(fetch_source(gathered_tex, there).w, 1.0) : vec2(0.0);
    }
    light.w = nearness.x / max(nearness.y, 1.0);
#if GLOSSY
    // The eye is near too: from point to point it looks another way.
    vec3 eye, view;
    camera_ray(at, eye, view);
    light.w += 1.0 / max(distance(eye, position.xyz), 1e-3);
    light /= vec4(specular_color(at), lobe_width(at));
#endif
    imageStore(gathered_out, at, light);
#else
    vec4 normals = 2.0 * fetch_source(normal_tex, at) - 1.0;
    vec3 normal = octahedral_decode(normals.xy);
    vec3 geometric = octahedral_decode(normals.zw);
    vec4 center = fetch_source(gathered_tex, at);
    float lobe = lobe_width(at);
    vec3 origin, direction;
    camera_ray(at, origin, direction);
    float away = dot(position.xyz - origin, direction);
    float most = tolerance / max(pixel_footprint(away, direction) * least_radius * min(lobe, 1.0), 1e-12);

    vec4 sum = center * 4.0;  // weights 1 2 1, 2 4 2, 1 2 1
    float weights = 4.0;
    for (int k = 0; k < 4; ++k) {
        ivec2 step = k == 0 ? ivec2(1, 0) : (k == 1 ? ivec2(0, 1) : ivec2(1, 5 - 2 * k));
        float weight = 1.0;
        vec4 pair = vec4(0.0);
        for (int side = -1; side <= 1; side += 2) {
            ivec2 there = clamp(at + step * (side * stride), ivec2(0), picture_size - 1);
            vec4 other_position = fetch_source(position_tex, there);
            vec3 other_normal = octahedral_decode(2.0 * fetch_source(normal_tex, there).xy - 1.0);
            vec4 other = fetch_source(gathered_tex, there);
            // The error that light from there may have, as a share of it: how far that point is, against the distance of
            // what surrounds it, how much it turns, and how far off the tangent plane it lies, beyond what the turn explains.
            vec3 apart = other_position.xyz - position.xyz;
            float distance = length(apart);
            float turn = sqrt(max(0.0, 1.0 - dot(normal, other_normal)));
            float off_plane = 4.0 * max(0.0, abs(dot(apart, geometric)) / max(distance, 1e-6) - turn);
            float nearness = min(most, sqrt(center.w * other.w));
#if GLOSSY
            // Directions differ by the parallax of what is mirrored, and twice as much as normals do.
            float error = distance * nearness + 2.0 * sqrt(2.0) * turn / lobe + off_plane;
#else
            float error = distance * nearness + turn + off_plane;
#endif
            bool usable = there == at + step * (side * stride) && other_position.w == 1.0;
#if GLOSSY
            usable = usable && are_lobes_alike(lobe, lobe_width(there));
#endif
            weight = usable ? min(weight, max(0.0, 1.0 - error / tolerance)) : 0.0;
            pair += other;
        }
        weight *= k < 2 ? 2.0 : 1.0;
        sum += weight > 0.0 ? pair * weight : vec4(0.0);
        weights += 2.0 * weight;
    }
    sum /= weights;
#if GLOSSY && STEP == 2
    sum.rgb *= specular_color(at);
#endif
    imageStore(gathered_out, at, sum);
#endif
}
