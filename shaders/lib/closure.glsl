// SPDX-License-Identifier: GPL-3.0-or-later
// Reflectance of the lobes of a Surface that has no closed form.

#ifndef CLOSURE_GLSL
#define CLOSURE_GLSL

// (scale, bias): a GGX lobe of Fresnel reflectance mix(f0, f90, (1 - cos)^5), with the height-correlated Smith term
// and one scattering, reflects f0 * scale + f90 * bias of a white hemisphere ("split sum": Karis 2013, "Real Shading in
// Unreal Engine 4").
// Fitted here to numerical integration over cosines of 0.05 .. 1: sum = scale + bias as a polynomial, bias as a ratio
// of two. A test integrates again and holds the fit to its error.
vec2 specular_scale_bias(float cosine, float roughness) {
    float x = clamp(cosine, 0.05, 1.0);
    float y = clamp(roughness, 0.0, 1.0);
    float x2 = x * x;
    float y2 = y * y;
    vec4 powers = vec4(1.0, y, y2, y2 * y);
    float sum = dot(vec4(1.024, -1.0842, 2.7368, -1.788), powers)
              + x * dot(vec4(0.036, 4.5882, -18.031, 12.1167), powers)
              + x2 * dot(vec4(-0.214, -4.8245, 24.8692, -18.8802), powers)
              + x2 * x * dot(vec4(0.1308, 1.8608, -11.1702, 8.9142), powers);
    float above = 1.06977 - 2.66585 * x - 1.50918 * y + 4.35097 * x * y + 1.64219 * x2 + 0.76128 * y2
                - 2.99809 * x2 * y - 2.50126 * x * y2 + 1.87946 * x2 * y2;
    float below = 1.0 + 2.37626 * x + 0.68962 * y - 30.82526 * x * y + 11.94886 * x2 + 5.32058 * y2
                + 14.73701 * x2 * y + 58.57481 * x * y2 - 61.35015 * x2 * y2;
    float bias = clamp(above / below, 0.0, 1.0);
    return vec2(max(clamp(sum, 0.0, 1.0) - bias, 0.0), bias);
}

// Share of a white hemisphere that the GGX lobe reflects towards a viewer at `cosine` to the normal.
vec3 specular_directional_albedo(vec3 f0, vec3 f90, float roughness, float cosine) {
    vec2 ab = specular_scale_bias(cosine, roughness);
    return f0 * ab.x + f90 * ab.y;
}

#endif
