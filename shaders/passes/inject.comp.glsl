// SPDX-License-Identifier: GPL-3.0-or-later
// Direct light that falls on each site (a surface point that one or more voxel faces stand for).
// Input: faces, lights, triangles of cells.    Output: irradiance_img: irradiance / pi, W/(m2 sr).
// Follows Crassin et al. 2011, "Interactive Indirect Illumination Using Voxel Cone Tracing".
// Differs: visibility is a ray against the geometry for occupied voxels only, not a light-view map or a march.

#include "lib/trace.glsl"
#include "lib/face.glsl"
#include "lib/light.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = IMG_0, rgba32f) writeonly uniform image2D irradiance_img;

uniform uint thread_first;
uniform uint cell_count;
uniform uint random_seed;
uniform bool use_shadows;

// Points on a light that has a size; one suffices for the others.
const uint SAMPLES = 4u;

void main()
{
    uint thread = thread_first + invocation_index();
    uint facing = facing_of_thread(thread, cell_count);
    uvec4 record = texelFetch(cells_tex, list_texel(cell_of_thread(thread, cell_count)), 0);
    if (!has_facing(record, facing) || site_facing(record, facing) != facing) {
        return;
    }
    uint index = face_index(record, facing);
    vec3 position, normal;
    fetch_face_place(index, position, normal);
    vec3 origin = position + normal * RAY_START;
    vec3 irradiance = vec3(0.0);
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
    imageStore(irradiance_img, list_texel(index), vec4(finite_or_zero(irradiance / PI), 0.0));
}
