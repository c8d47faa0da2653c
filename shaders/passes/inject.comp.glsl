// SPDX-License-Identifier: GPL-3.0-or-later
// Direct light that leaves each voxel face, and what it emits.
// Input: faces, lights, triangles of cells.    Output: direct_img and radiance_img: W/(m2 sr).
// Follows Crassin et al. 2011, "Interactive Indirect Illumination Using Voxel Cone Tracing".
// Differs: visibility is a ray against the geometry for occupied voxels only, not a light-view map or a march.

#include "lib/trace.glsl"
#include "lib/face.glsl"
#include "lib/light.glsl"

layout(local_size_x = GROUP_SIZE) in;

#if HAS_EMISSION
layout(binding = TEX_FACE_EMISSION) uniform sampler2D face_emission_tex;
#endif
layout(binding = IMG_0, rgba32f) writeonly uniform image2D radiance_img;
layout(binding = IMG_1, rgba32f) writeonly uniform image2D direct_img;

uniform uint thread_first;
uniform uint cell_count;
uniform uint random_seed;
uniform bool use_shadows;

// Points on a light that has a size; one suffices for the others.
const uint SAMPLES = 4u;

void main()
{
    uint index = face_of_thread(cells_tex, thread_first + invocation_index(), cell_count);
    if (index == NONE_INDEX) {
        return;
    }
    vec3 position, normal;
    fetch_face_place(index, position, normal);
    vec3 reflectance = fetch_face_reflectance(index).rgb;
    vec3 origin = position + normal * RAY_START;
    vec3 irradiance = vec3(0.0);
    if (max_component(reflectance) > 0.0) {
        for (uint k = 0u; k < light_count; ++k) {
            Light light = fetch_light(lights_tex, k);
            if ((light.flags & RAY_DIFFUSE) == 0u) {
                continue;
            }
            uint seed = hash(hash(index) + k, random_seed);
            bool has_size = light.kind == LIGHT_SUN ? light.cos_cone < 0.9999 : light.radius_grid > 0.25;
            uint samples = has_size ? SAMPLES : 1u;
            vec3 sum = vec3(0.0);
            for (uint i = 0u; i < samples; ++i) {
                LightSample s = sample_light(light, origin, sample_2d(i, seed));
                float cosine = dot(normal, s.direction);
                if (cosine <= 0.0 || max_component(s.irradiance) <= 0.0) {
                    continue;
                }
                bool blocked = use_shadows && (light.flags & LIGHT_CASTS_SHADOW) != 0u &&
                               is_blocked(origin, s.direction, s.distance - RAY_START, hash(seed, i));
                sum += blocked ? vec3(0.0) : s.irradiance * cosine;
            }
            irradiance += sum / float(samples);
        }
    }
    vec3 direct = reflectance * irradiance / PI;
#if HAS_EMISSION
    direct += texelFetch(face_emission_tex, list_texel(index), 0).rgb;
#endif
    direct = finite_or_zero(direct);
    imageStore(direct_img, list_texel(index), vec4(direct, 0.0));
    imageStore(radiance_img, list_texel(index), vec4(direct, 0.0));
}
