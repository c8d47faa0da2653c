// SPDX-License-Identifier: GPL-3.0-or-later
// Light that leaves the surfaces of a layer towards where its rays came from, added to the reflections of the picture.
// Input: surface pictures, rays and throughput of the layer, direct and indirect light on it, the world.
// Output: radiance_img. KEEPS_EMITTED: emitted_img: what of it is emission or comes straight from the world.

#include "lib/clamp.glsl"
#include "lib/pixel.glsl"
#include "lib/ray_shares.glsl"
#include "lib/world.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = TEX_EMISSION) uniform sampler2D emission_tex;
#if HAS_DIRECT
layout(binding = TEX_DIRECT_DIFFUSE) uniform sampler2D direct_diffuse_tex;
layout(binding = TEX_DIRECT_GLOSSY) uniform sampler2D direct_glossy_tex;
#endif
#if HAS_DIFFUSE_GATHER
layout(binding = TEX_GATHERED) uniform sampler2D gathered_tex;
#endif
layout(binding = IMG_0, rgba32f) uniform image2D radiance_img;
#if KEEPS_EMITTED
layout(binding = IMG_1, rgba32f) uniform image2D emitted_img;
#endif
layout(binding = IMG_4, rgba32f) readonly uniform image2D throughput_img;

uniform float direct_amount;
uniform float indirect_amount;
uniform float specular_amount;

void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size))) {
        return;
    }
    vec3 throughput = imageLoad(throughput_img, at).rgb;
    if (max_component(throughput) <= 0.0) {
        return;
    }
    Pixel p = fetch_pixel(at);
    vec3 light = vec3(0.0);
    vec3 emitted = vec3(0.0);
    if (p.is_surface) {
        emitted = throughput * texelFetch(emission_tex, at, 0).rgb * (direct_amount * ray_shares(at).x);
#if HAS_DIRECT
        light += direct_amount * (p.diffuse * texelFetch(direct_diffuse_tex, at, 0).rgb +
                                  specular_amount * texelFetch(direct_glossy_tex, at, 0).rgb);
#endif
#if HAS_DIFFUSE_GATHER
        light += indirect_amount * p.diffuse * texelFetch(gathered_tex, at, 0).rgb;
#endif
    } else {
        // All that the ray met let the world's light pass through.
        emitted = throughput * (ray_shares(at).y * limited(world_along(pixel_ray(at).direction)));
    }
    emitted = finite_or_zero(emitted);
    light = finite_or_zero(throughput * limited(light)) + emitted;
    imageStore(radiance_img, at, imageLoad(radiance_img, at) + vec4(light, 0.0));
#if KEEPS_EMITTED
    imageStore(emitted_img, at, imageLoad(emitted_img, at) + vec4(emitted, 0.0));
#endif
}
