// SPDX-License-Identifier: GPL-3.0-or-later
// The surface seen at a pixel, as pass `surface` left it.

#include "lib/common.glsl"
#include "lib/source.glsl"
#include "lib/tiles.glsl"

SOURCE_PICTURE(TEX_POSITION, SOURCE_POSITION, rgba32f) position_tex;
SOURCE_PICTURE(TEX_NORMAL, SOURCE_NORMAL, rgba16) normal_tex;
SOURCE_PICTURE(TEX_DIFFUSE, SOURCE_DIFFUSE, rgba16f) diffuse_tex;
layout(binding = TEX_F0) uniform sampler2D f0_tex;
layout(binding = TEX_F90) uniform sampler2D f90_tex;

struct Pixel {
    bool is_surface;
    vec3 position;          // grid space
    vec3 normal;            // shading
    vec3 geometric_normal;
    vec3 diffuse;
    vec3 f0;
    vec3 f90;
    float ior;              // see fresnel_share in lib/fresnel.glsl; of glass: of the far side over the near one
    float alpha;            // GGX: roughness^2
    bool is_glass;          // light that is not reflected goes through ...
    vec3 transmission;      // ... with this factor
    bool is_inside;         // of glass
};

Pixel fetch_pixel(ivec2 at)
{
    Pixel p;
    vec4 position = fetch_source(position_tex, at);
    vec4 normals = 2.0 * fetch_source(normal_tex, at) - 1.0;
    vec4 diffuse = fetch_source(diffuse_tex, at);
    p.is_surface = position.w == 1.0;
    p.position = position.xyz;
    p.normal = octahedral_decode(normals.xy);
    p.geometric_normal = octahedral_decode(normals.zw);
    vec4 f90 = texelFetch(f90_tex, at, 0);
    p.is_glass = f90.w < 0.0;
    p.ior = abs(f90.w);
    p.is_inside = p.is_glass && p.ior < 1.0;
    p.transmission = p.is_glass ? diffuse.rgb : vec3(0.0);
    p.diffuse = p.is_glass ? vec3(0.0) : diffuse.rgb;
    p.f0 = texelFetch(f0_tex, at, 0).rgb;
    p.f90 = f90.rgb;
    p.alpha = max(diffuse.a * diffuse.a, 1e-4);
    return p;
}
