// SPDX-License-Identifier: GPL-3.0-or-later
// What this pass brings to one of the film's pictures. OUTPUT says to which; see passes/compose.py.
// Input: surface pictures, direct and indirect light.    Output: value_img (w: alpha).

#include "lib/pixel.glsl"
#include "lib/camera.glsl"
#include "lib/world.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = TEX_EMISSION) uniform sampler2D emission_tex;
// Light at pixels, as composition is given it: a function for each kind, which returns 0 where there is none (HAS_).
#define LIGHT(name, picture) vec3 name(ivec2 at) { return texelFetch(picture, at, 0).rgb; }
#define NO_LIGHT(name) vec3 name(ivec2 at) { return vec3(0.0); }
#if HAS_DIRECT_DIFFUSE
layout(binding = TEX_DIRECT_DIFFUSE) uniform sampler2D direct_diffuse_tex;
LIGHT(direct_diffuse, direct_diffuse_tex)
#else
NO_LIGHT(direct_diffuse)
#endif
#if HAS_DIRECT_GLOSSY
layout(binding = TEX_DIRECT_GLOSSY) uniform sampler2D direct_glossy_tex;
LIGHT(direct_glossy, direct_glossy_tex)
#else
NO_LIGHT(direct_glossy)
#endif
#if HAS_GATHERED
layout(binding = TEX_GATHERED) uniform sampler2D gathered_tex;
LIGHT(gathered, gathered_tex)
#else
NO_LIGHT(gathered)
#endif
#if HAS_GATHERED_EMITTED
layout(binding = TEX_GATHERED_EMITTED) uniform sampler2D gathered_emitted_tex;
LIGHT(gathered_emitted, gathered_emitted_tex)
#else
NO_LIGHT(gathered_emitted)
#endif
#if HAS_REFLECTED
layout(binding = TEX_REFLECTED) uniform sampler2D reflected_tex;
LIGHT(reflected, reflected_tex)
#else
NO_LIGHT(reflected)
#endif
#if HAS_REFLECTED_EMITTED
layout(binding = TEX_REFLECTED_EMITTED) uniform sampler2D reflected_emitted_tex;
LIGHT(reflected_emitted, reflected_emitted_tex)
#else
NO_LIGHT(reflected_emitted)
#endif
layout(binding = IMG_0, rgba32f) writeonly uniform image2D value_img;

uniform float direct_amount;
uniform float indirect_amount;
uniform float specular_amount;
uniform float exposure;
uniform bool film_transparent;
uniform vec3 camera_forward;   // unit, grid space
uniform vec3 camera_position;  // grid space
uniform float cell_size;
uniform vec3 grid_origin_ws;
uniform float share_of_samples;  // passes with this one, of those asked for

// Diffuse: irradiance / pi. Direct: from lights, and what rays bring straight from where light is
// made; indirect: what surfaces pass on. Cycles divides its passes so.

vec3 emitted_diffuse(ivec2 at) { return indirect_amount * gathered_emitted(at); }
vec3 emitted_glossy(ivec2 at) { return specular_amount * reflected_emitted(at); }
vec3 from_lights_diffuse(ivec2 at) { return direct_amount * direct_diffuse(at); }
vec3 from_lights_glossy(ivec2 at) { return specular_amount * direct_amount * direct_glossy(at); }
vec3 gathered_diffuse(ivec2 at) { return indirect_amount * gathered(at); }
vec3 gathered_glossy(ivec2 at) { return specular_amount * reflected(at); }

vec4 of_surface(bool is_surface, vec3 radiance)
{
    return is_surface ? vec4(radiance * exposure, 1.0) : vec4(0.0);
}

vec4 composed(ivec2 at)
{
    vec4 position = fetch_source(position_tex, at);
    bool is_surface = position.w == 1.0;
    Pixel p = fetch_pixel(at);
    vec3 emission = position.w > 0.0 ? texelFetch(emission_tex, at, 0).rgb : vec3(0.0);
    bool holdout = is_surface && texelFetch(f0_tex, at, 0).w > 0.5;
    vec3 origin, direction;
    camera_ray(at, origin, direction);

#if OUTPUT == OUTPUT_COMBINED
    if (holdout) {
        return vec4(0.0);
    }
    if (position.w == 0.0) {
        return (film_transparent ? vec4(0.0) : vec4(world_along(direction) * exposure, 1.0));
    }
    vec3 diffuse = from_lights_diffuse(at) + gathered_diffuse(at);
    vec3 glossy = from_lights_glossy(at) + gathered_glossy(at);
    return vec4((emission + p.diffuse * diffuse + glossy) * exposure, 1.0);
#elif OUTPUT == OUTPUT_DIFFUSE_DIRECT
    return of_surface(is_surface, p.diffuse * (from_lights_diffuse(at) + emitted_diffuse(at)));
#elif OUTPUT == OUTPUT_DIFFUSE_INDIRECT
    return of_surface(is_surface, p.diffuse * (gathered_diffuse(at) - emitted_diffuse(at)));
#elif OUTPUT == OUTPUT_GLOSSY_DIRECT
    return of_surface(is_surface, from_lights_glossy(at) + emitted_glossy(at));
#elif OUTPUT == OUTPUT_GLOSSY_INDIRECT
    return of_surface(is_surface, gathered_glossy(at) - emitted_glossy(at));
#elif OUTPUT == OUTPUT_DIRECT
    vec3 diffuse = from_lights_diffuse(at) + emitted_diffuse(at);
    vec3 glossy = from_lights_glossy(at) + emitted_glossy(at);
    return of_surface(position.w > 0.0, emission + (is_surface ? p.diffuse * diffuse + glossy : vec3(0.0)));
#elif OUTPUT == OUTPUT_INDIRECT
    return of_surface(is_surface, p.diffuse * (gathered_diffuse(at) - emitted_diffuse(at)) +
                                      gathered_glossy(at) - emitted_glossy(at));
#elif OUTPUT == OUTPUT_SPECULAR
    return of_surface(is_surface, from_lights_glossy(at) + gathered_glossy(at));
#elif OUTPUT == OUTPUT_SAMPLE_COUNT
    return vec4(vec3(share_of_samples), 1.0);
#elif OUTPUT == OUTPUT_DIFFUSE_COLOR
    return (is_surface ? vec4(p.diffuse, 1.0) : vec4(0.0));
#elif OUTPUT == OUTPUT_GLOSSY_COLOR
    return (is_surface ? vec4(1.0) : vec4(0.0));
#elif OUTPUT == OUTPUT_EMISSION
    return vec4(emission * exposure, 1.0);
#elif OUTPUT == OUTPUT_ENVIRONMENT
    return (position.w == 0.0 ? vec4(world_along(direction) * exposure, 1.0) : vec4(0.0));
#elif OUTPUT == OUTPUT_DEPTH
    float depth = dot(position.xyz - camera_position, camera_forward) * cell_size;
    return vec4(vec3(position.w > 0.0 ? depth : 1e10), 1.0);
#elif OUTPUT == OUTPUT_NORMAL
    return vec4(is_surface ? p.normal : vec3(0.0), 1.0);
#elif OUTPUT == OUTPUT_POSITION
    return vec4(is_surface ? position.xyz * cell_size + grid_origin_ws : vec3(0.0), 1.0);
#else
#error "OUTPUT is not one of the film's passes"
#endif
}

void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size)) || !is_active(at)) {
        return;
    }
    vec4 value = composed(at);
    imageStore(value_img, at, vec4(finite_or_zero(value.rgb), value.a));
}
