// SPDX-License-Identifier: GPL-3.0-or-later
// The surface seen at a pixel, as pass `surface` left it.

#include "lib/common.glsl"
#include "lib/tiles.glsl"

layout(binding = TEX_POSITION) uniform sampler2D position_tex;
layout(binding = TEX_NORMAL) uniform sampler2D normal_tex;
layout(binding = TEX_DIFFUSE) uniform sampler2D diffuse_tex;
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
    float alpha;            // GGX: roughness^2
};

Pixel fetch_pixel(ivec2 at)
{
    Pixel p;
    vec4 position = texelFetch(position_tex, at, 0);
    vec4 normals = 2.0 * texelFetch(normal_tex, at, 0) - 1.0;
    vec4 diffuse = texelFetch(diffuse_tex, at, 0);
    p.is_surface = position.w == 1.0;
    p.position = position.xyz;
    p.normal = octahedral_decode(normals.xy);
    p.geometric_normal = octahedral_decode(normals.zw);
    p.diffuse = diffuse.rgb;
    p.f0 = texelFetch(f0_tex, at, 0).rgb;
    p.f90 = texelFetch(f90_tex, at, 0).rgb;
    p.alpha = max(diffuse.a * diffuse.a, 1e-4);
    return p;
}
