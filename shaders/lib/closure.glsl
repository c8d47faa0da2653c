// SPDX-License-Identifier: GPL-3.0-or-later
// Reflectance of the lobes of a Surface that has no closed form.

#ifndef CLOSURE_GLSL
#define CLOSURE_GLSL

#include "lib/fresnel.glsl"
#include "lib/reflection_normal.glsl"

// (scale, bias): a GGX lobe of Fresnel reflectance mix(f0, f90, (1 - cos)^5), with the height-correlated Smith term
// and one scattering, reflects f0 * scale + f90 * bias of a white hemisphere ("split sum": Karis 2013, "Real Shading in
// Unreal Engine 4").
// Fitted here to numerical integration over cosines of 0.05 .. 1: 1 - scale - bias (what is lost) and bias, each a ratio
// of polynomials; largest error 0.01. A test integrates again and holds the fit to it.
vec2 specular_scale_bias(float cosine, float roughness) {
    float x = clamp(cosine, 0.05, 1.0);
    float y = clamp(roughness, 0.0, 1.0);
    float x2 = x * x;
    float y2 = y * y;
    vec4 rough_powers = vec4(1.0, y, y2, y2 * y);
    vec3 rows = vec3(1.0, x, x2);
    float lost_above = y * dot(rows, vec3(dot(vec4(0.47482, -2.17892, 3.03689, -0.73195), rough_powers),
                                          dot(vec4(-7.43404, 55.04485, -103.25196, 92.29573), rough_powers),
                                          dot(vec4(7.87567, -64.44368, 136.35403, -88.31867), rough_powers)));
    float lost_below = dot(rows, vec3(dot(vec3(1.0, -7.13346, 19.80432), rough_powers.xyz),
                                      dot(vec3(-1.05011, -26.84713, 67.53021), rough_powers.xyz),
                                      dot(vec3(68.43221, -101.0177, 20.77605), rough_powers.xyz)));
    float sum = 1.0 - clamp(lost_above / lost_below, 0.0, 1.0);
    float above = 1.02276 - 2.48686 * x - 0.88254 * y + 1.84063 * x * y + 1.56836 * x2 + 0.47871 * y2
                - 0.98276 * x2 * y - 1.61105 * x * y2 + 1.20929 * x2 * y2;
    float below = 1.0 + 2.66107 * x - 0.48812 * y - 20.44128 * x * y + 7.78812 * x2 + 13.28358 * y2
                + 18.0169 * x2 * y + 5.32168 * x * y2 - 10.09386 * x2 * y2;
    float bias = clamp(above / below, 0.0, 1.0);
    return vec2(max(sum - bias, 0.0), bias);
}

// The same for a lobe whose reflectance goes from f0 to f90 by an ior (fresnel_share).
vec2 specular_scale_bias(float cosine, float roughness, float ior) {
    vec2 split = specular_scale_bias(cosine, roughness);
    if (ior <= 0.0) {
        return split;
    }
    float share = fresnel_share(fresnel_cosine(cosine, roughness), ior);
    return (split.x + split.y) * vec2(1.0 - share, share);
}

// Share of a white hemisphere that the GGX lobe reflects towards a viewer at `cosine` to the normal.
vec3 specular_directional_albedo(vec3 f0, vec3 f90, float ior, float roughness, float cosine) {
    vec2 ab = specular_scale_bias(cosine, roughness, ior);
    return f0 * ab.x + f90 * ab.y;
}

#endif
