// SPDX-License-Identifier: GPL-3.0-or-later
// Light at pixels that is taken over from earlier passes, where they saw the same surface.
// Without LOOKS_UP: this pass's light, in light_img (KINDS pictures, rgb), goes into the mean that this frame leaves.
// TAKES_OVER: after it was blended with what the last frame left in before_*, by how many gathers stand behind each.
// LOOKS_UP: this pass has gathered nothing: its light is what this frame, in before_*, has found so far; w: -1 where that
// is nothing.
// GLOSSY: reflections, without what the surface reflects of them, and with the width of their lobe. Of earlier frames they
// take over the less the narrower the lobe is, and the faster the view of the surface turns.
// Output: light_img; mean_img: means over this frame's gathers, w: how many they were; place_img: whose light it is.

#include "lib/pixel.glsl"
#include "lib/camera.glsl"
#if GLOSSY
#include "lib/lobe.glsl"
#endif

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

#if TAKES_OVER || LOOKS_UP
SOURCE_2D(TEX_BEFORE_PLACE, SOURCE_BEFORE_PLACE, rgba32ui) before_place_tex;
SOURCE_PICTURE(TEX_BEFORE_0, SOURCE_BEFORE_0, rgba32f) before_tex[KINDS];
#endif
layout(binding = IMG_0, rgba32f) uniform image2D light_img[KINDS];
#if !LOOKS_UP
layout(binding = IMG_3, rgba32f) uniform image2D mean_img[KINDS];
layout(binding = IMG_6, rgba32ui) uniform uimage2D place_img;  // position (grid space), normal, passes
#endif

uniform ivec2 tile_first;
#if TAKES_OVER || LOOKS_UP
uniform mat4 before_from_grid;  // clip space of the frame of before_*
#endif
#if LOOKS_UP && GLOSSY
uniform float least_passes;     // gathers that must stand behind what is looked up
#endif
#if TAKES_OVER
uniform float most_passes;      // gathers of earlier frames that count
#if GLOSSY
uniform vec4 before_eye;        // of the last frame; w: 0: at infinity
#endif
#endif
#if !LOOKS_UP
uniform float frame_passes;     // gathers of this frame
uniform bool is_first;          // gather of this frame
#endif

#if GLOSSY
const float NORMAL_STEPS = 1023.0;  // 10 bits for each half of an octahedral normal, 6 for roughness and passes
const uint MOST_COUNT = 63u;
#else
const float NORMAL_STEPS = 2047.0;  // 11 bits for each half of an octahedral normal, 10 for the passes
const uint MOST_COUNT = 1023u;
#endif

// Surfaces are the same where they lie on one tangent plane, up to a pixel's size, and ...
const float SAME_NORMAL = 0.95;  // ... normals differ by less than 18 degrees: irradiance by 5 % of what is seen head on
const float SAME_REACH = 8.0;    // ... they are this near, pixels: one pixel is as wide on a surface seen at 7 degrees

#if GLOSSY
const float MOST_TURN = 0.5;  // of the view, against the width of the lobe, while earlier frames count
#endif

struct Place {
    vec3 position;
    vec3 normal;
    float passes;  // gathers of this frame and earlier ones; 0: no surface
    float roughness;  // of reflections
};

Place unpack_place(uvec4 words)
{
#if GLOSSY
    uvec4 parts = words.wwww >> uvec4(0u, 10u, 20u, 26u) & uvec4(1023u, 1023u, 63u, 63u);
    float roughness = float(parts.z) / 63.0;
#else
    uvec4 parts = uvec4(words.w & 2047u, words.w >> 11 & 2047u, 0u, words.w >> 22);
    float roughness = 0.0;
#endif
    vec3 normal = octahedral_decode(2.0 * vec2(parts.xy) / NORMAL_STEPS - 1.0);
    return Place(uintBitsToFloat(words.xyz), normal, float(parts.w), roughness);
}

uvec4 pack_place(Place place)
{
    uvec2 normal = uvec2(round((0.5 + 0.5 * octahedral_encode(place.normal)) * NORMAL_STEPS));
    uint passes = min(uint(place.passes), MOST_COUNT);
#if GLOSSY
    uint last = normal.x | normal.y << 10 | uint(round(clamp(place.roughness, 0.0, 1.0) * 63.0)) << 20 | passes << 26;
#else
    uint last = normal.x | normal.y << 11 | passes << 22;
#endif
    return uvec4(floatBitsToUint(place.position), last);
}

// Whether light at a place is that of a pixel: same surface, up to the size of a pixel.
bool is_same(Place place, Pixel p, float footprint)
{
    vec3 apart = place.position - p.position;
#if GLOSSY
    // What is mirrored turns twice as fast as normals do; those of a level mirror are alike to the bit.
    float lobe = lobe_width(sqrt(p.alpha));
    Place own = unpack_place(pack_place(Place(p.position, p.normal, 1.0, sqrt(p.alpha))));
    if (!are_lobes_alike(lobe_width(place.roughness), lobe_width(own.roughness)) ||
        2.0 * distance(place.normal, own.normal) > lobe) {
        return false;
    }
#endif
    return place.passes > 0.0 && abs(dot(apart, p.geometric_normal)) < footprint &&
           dot(place.normal, p.normal) > SAME_NORMAL && length(apart) < SAME_REACH * footprint;
}

void main()
{
    ivec2 at = tile_first + ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
    Pixel p = fetch_pixel(at);
#if GLOSSY
    bool has_light = is_shiny(p);
#else
    bool has_light = p.is_surface;
#endif
    if (!has_light) {
#if LOOKS_UP
        for (int kind = 0; kind < KINDS; ++kind) {
            imageStore(light_img[kind], at, vec4(0.0));
        }
#else
        if (is_first) {
            imageStore(place_img, at, uvec4(0u));
        }
#endif
        return;
    }
    vec3 origin, direction;
    camera_ray(at, origin, direction);
    float footprint = pixel_footprint(dot(p.position - origin, direction), direction);

#if GLOSSY
    vec3 color = specular_color(p, direction);
#else
    const vec3 color = vec3(1.0);
#endif

    vec3 found[KINDS];
    for (int kind = 0; kind < KINDS; ++kind) {
        found[kind] = vec3(0.0);
    }
    float passes = 0.0;
    float weights = 0.0;
#if TAKES_OVER || LOOKS_UP
    vec4 clip = before_from_grid * vec4(p.position, 1.0);
    vec2 where = clip.w > 0.0 ? (0.5 * clip.xy / clip.w + 0.5) * vec2(picture_size) - 0.5 : vec2(-2.0);
    ivec2 corner = ivec2(floor(where));
    vec2 share = where - vec2(corner);
#if LOOKS_UP
    const int side = 4;  // at edges, an earlier pass may have seen the surface a pixel away
#else
    const int side = 2;
#endif
    for (int k = 0; k < side * side; ++k) {
        ivec2 offset = ivec2(k % side, k / side) - (side / 2 - 1);
        ivec2 there = corner + offset;
        bool usable = all(greaterThanEqual(there, ivec2(0))) && all(lessThan(there, picture_size));
        there = clamp(there, ivec2(0), picture_size - 1);
        Place place = unpack_place(fetch_source(before_place_tex, there));
#if LOOKS_UP && GLOSSY
        usable = usable && place.passes >= least_passes;
#endif
        vec2 near = max(1.0 - abs(vec2(offset) - share), 1e-3);
        float weight = usable && is_same(place, p, footprint) ? near.x * near.y : 0.0;
        for (int kind = 0; kind < KINDS; ++kind) {
            vec3 value = fetch_source(before_tex[kind], there).rgb;
            found[kind] += weight > 0.0 ? weight * value : vec3(0.0);
        }
        passes += weight * place.passes;
        weights += weight;
    }
#endif
#if LOOKS_UP
    for (int kind = 0; kind < KINDS; ++kind) {
        imageStore(light_img[kind], at, weights > 0.0 ? vec4(color * found[kind] / weights, 0.0) : vec4(-1.0));
    }
#else
#if TAKES_OVER
    passes = min(passes, most_passes);
#if GLOSSY
    vec3 view_before = normalize(before_eye.w * p.position - before_eye.xyz);
    float turn = length(cross(view_before, direction));
    passes = min(passes, frame_passes * MOST_TURN * lobe_width(sqrt(p.alpha)) / max(turn, 1e-6));
#endif
#endif
    float old_share = weights > 0.0 ? passes / (passes + frame_passes) : 0.0;

    Place place = unpack_place(imageLoad(place_img, at));
    bool starts = is_first || place.passes <= 0.0;
    bool joins = starts || is_same(place, p, footprint);
    float before = starts ? 0.0 : imageLoad(mean_img[0], at).w;
    for (int kind = 0; kind < KINDS; ++kind) {
        vec4 light = imageLoad(light_img[kind], at);
        light.rgb /= color;
        light.rgb = old_share > 0.0 ? mix(light.rgb, found[kind] / weights, old_share) : light.rgb;
        imageStore(light_img[kind], at, vec4(color * light.rgb, light.w));
        if (joins) {
            vec3 mean = starts ? light.rgb : imageLoad(mean_img[kind], at).rgb;
            imageStore(mean_img[kind], at, vec4(mean + (light.rgb - mean) / (before + 1.0), before + 1.0));
        }
    }
    if (starts) {
        imageStore(place_img, at, pack_place(Place(p.position, p.normal, passes + 1.0, sqrt(p.alpha))));
    } else if (joins) {
        place.passes += 1.0;
        imageStore(place_img, at, pack_place(place));
    }
#endif
}
