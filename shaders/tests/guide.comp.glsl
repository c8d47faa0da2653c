// SPDX-License-Identifier: GPL-3.0-or-later
// Functions of lib/hemisphere.glsl and lib/guide.glsl for a list of (position, facing), (u, v, 0, 0).
// Output: (direction drawn there, its density), (direction of the place (u, v), 1 where there is a guide), (place of that
// direction again, its density, density of the opposite direction).

#include "lib/guide.glsl"
#include "tests/rows.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= count) {
        return;
    }
    vec4 given = inputs[2u * index];
    vec2 u = inputs[2u * index + 1u].xy;
    Guide guide = guide_at(given.xyz, facing_vector(uint(given.w)));
    vec3 place = hemisphere_from_square(u);
    vec3 even = grid_from_facing(guide.facing, place);
    bool found = guide.first != NONE_INDEX;
    vec3 drawn = found ? sample_guide(guide, u) : vec3(0.0);
    results[3u * index] = vec4(drawn, found ? guide_density(guide, drawn) : 0.0);
    results[3u * index + 1u] = vec4(even, found ? 1.0 : 0.0);
    results[3u * index + 2u] = vec4(square_from_hemisphere(facing_from_grid(guide.facing, even)),
                                    found ? guide_density(guide, even) : 0.0, found ? guide_density(guide, -even) : 0.0);
}
