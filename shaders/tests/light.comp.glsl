// SPDX-License-Identifier: GPL-3.0-or-later
// Light 0 of lib/light.glsl seen from a list of (position in cells, 0), (direction, 0), (u, 0, 0).
// Output: (sampled direction, distance in cells), (irradiance, half angle), (radiance along the direction, distance),
// (density that the sample says, density along it, 0, 0).

#include "lib/light.glsl"
#include "tests/rows.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    Light light = fetch_light(lights_tex, 0u);
    vec3 position = inputs[3u * index].xyz;
    LightSample s = sample_light(light, position, inputs[3u * index + 2u].xy);
    float distance;
    vec3 seen = light_along_ray(light, position, inputs[3u * index + 1u].xyz, distance);
    results[4u * index] = vec4(s.direction, s.distance);
    results[4u * index + 1u] = vec4(s.irradiance, light_half_angle(light, position));
    results[4u * index + 2u] = vec4(seen, distance);
    results[4u * index + 3u] = vec4(s.density, light_density(light, position, s.direction, s.distance), 0.0, 0.0);
}
