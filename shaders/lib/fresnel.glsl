// SPDX-License-Identifier: GPL-3.0-or-later
// Reflectance of smooth surfaces, and of GGX lobes as a whole, by angle.

#ifndef FRESNEL_GLSL
#define FRESNEL_GLSL

// Unpolarized reflectance of a dielectric, by Fresnel's equations; `ior`: of the far side over the near one. Total
// reflection gives 1.
float dielectric_reflectance(float cosine, float ior) {
    float squared = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
    float inside = sqrt(max(squared, 0.0));
    float across = (cosine - ior * inside) / max(cosine + ior * inside, 1e-20);
    float along = (ior * cosine - inside) / max(ior * cosine + inside, 1e-20);
    return squared <= 0.0 ? 1.0 : 0.5 * (across * across + along * along);
}

// How far reflectance is from f0 (0) to f90 (1): Fresnel's equations scaled to that range, or, without an ior (0),
// Schlick's (1 - cos)^5.
float fresnel_share(float cosine, float ior) {
    float m = clamp(1.0 - cosine, 0.0, 1.0);
    float m2 = m * m;
    if (ior <= 0.0) {
        return m2 * m2 * m;
    }
    float ratio = (ior - 1.0) / (ior + 1.0);
    float f0 = ratio * ratio;
    return clamp((dielectric_reflectance(clamp(cosine, 0.0, 1.0), ior) - f0) / max(1.0 - f0, 1e-6), 0.0, 1.0);
}

vec3 fresnel(vec3 f0, vec3 f90, float ior, float cosine) {
    return mix(f0, f90, fresnel_share(cosine, ior));
}

// The angle at which a smooth dielectric reflects what a GGX lobe of this roughness, seen at `cosine`, does. It hardly
// depends on the ior. Fitted here to numerical integration for ior 1.3 to 2: the lobe's albedo is right to 0.012.
float fresnel_cosine(float cosine, float roughness) {
    float r2 = roughness * roughness;
    float a = -0.034 + 1.1999 * roughness - 0.9488 * r2;
    float b = -0.3374 + 1.8814 * roughness - 1.0547 * r2;
    float c = -0.6184 - 2.569 * roughness + 2.2503 * r2;
    return sqrt(clamp(cosine * cosine + r2 * (a + cosine * (b + cosine * c)), 0.0, 1.0));
}

#endif
