// SPDX-License-Identifier: GPL-3.0-or-later
// Sum what surfaces bring to the faces of every cell, and list the cell's triangles.
// A surface counts, with its area, for the facing that its normal is nearest to. A sheet has two sides, but what its back
// looks like is asked only where no front faces that way (pass voxel_resolve): a thin wall keeps two colours.
// Sums are integers: the order of threads cannot show.
// Input: pairs of one batch, triangles, materials, cells with their positions.
// Output: sums of faces, triangles of cells.

#include "lib/grid.glsl"
#include "lib/geometry.glsl"
#include "lib/closure.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_CELLS) uniform usampler2D cells_tex;
layout(binding = TEX_CELL_POSITIONS) uniform usampler2D cell_positions_tex;
layout(binding = TEX_PAIRS) uniform usampler2D pairs_tex;
layout(std430, binding = BUF_SUMS) buffer Sums { uint sums[]; };
layout(std430, binding = BUF_COUNTS) buffer Cursors { uint cursors[]; };  // next list entry of each cell
layout(binding = IMG_0, r32ui) writeonly uniform uimage2D cell_triangle_img;
#if HAS_OPACITY
layout(binding = IMG_1, r8) writeonly uniform image2D cell_opacity_img;
#endif

uniform uint pair_first;
uniform uint pair_count;

// Rounds up or down at random, right on average: what is smaller than the unit is not lost. The random number depends
// on triangle and cell alone.
uint fixed_point(float value, uint random)
{
    float scaled = clamp(value * FIXED_ONE, 0.0, 4.0e9);
    return uint(floor(scaled)) + (unit_float(random) < fract(scaled) ? 1u : 0u);
}

void main()
{
    uint number = invocation_index();
    if (number >= pair_count) {
        return;
    }
    uvec4 pair = texelFetch(pairs_tex, list_texel(pair_first + number), 0);
    Triangle triangle = fetch_triangle(pair.x);
    uint index = pair.y;
    float area = uintBitsToFloat(pair.z);
    vec3 inside = vec3(pair.w & 1023u, pair.w >> 10 & 1023u, pair.w >> 20) / 1023.0;
    uint packed_position = texelFetch(cell_positions_tex, list_texel(index), 0).r;
    vec3 cell = vec3(packed_position & 2047u, packed_position >> 11 & 2047u, packed_position >> 22);
    vec3 normal = normalize(cross(triangle.edge_1, triangle.edge_2));

    vec2 barycentric;
    float distance;
    intersect_plane(triangle, cell + inside + normal, -normal, barycentric, distance);
    barycentric = max(barycentric, 0.0);
    barycentric /= max(1.0, barycentric.x + barycentric.y);
    ShadingPoint point = shading_point(triangle, barycentric, normal, sqrt(area));
    Surface surface = surface_at(triangle, point);
    // Light goes straight through glass here, losing what is reflected on average.
    vec3 glass = specular_directional_albedo(surface.glass_f0, surface.glass_f90, surface.glass_ior,
                                             surface.glass_roughness, 0.5);
    vec3 passed = surface.transparency + surface.glass_transmission * (1.0 - glass);
    float opacity = 1.0 - clamp(luminance(passed), 0.0, 1.0);

    uint slot = atomicAdd(cursors[index], 1u);
    imageStore(cell_triangle_img, list_texel(slot), uvec4(pair.x));
#if HAS_OPACITY
    imageStore(cell_opacity_img, list_texel(slot), vec4(opacity));
    area *= opacity;
#endif

    uvec4 record = texelFetch(cells_tex, list_texel(index), 0);
    // As a Lambertian: the specular part by what it reflects at 60 degrees, about its mean over the hemisphere.
    vec3 reflectance = surface.diffuse + glass + specular_directional_albedo(surface.specular_f0, surface.specular_f90,
                                                                             surface.specular_ior, surface.roughness, 0.5);
    reflectance += surface.coat * dielectric_reflectance(0.5, surface.coat_ior);
    reflectance = min(reflectance / max(opacity, 1e-3), 1.0);
    // The cell has faces on this axis, unless two axes are equally near and were told apart otherwise there.
    int axis = dominant_axis(normal);
    for (int k = 0; k < 2 && !has_facing(record, uint(2 * axis)); ++k) {
        axis = (axis + 1) % 3;
    }
    uint facing = uint(2 * axis) + (normal[axis] < 0.0 ? 1u : 0u);
    uint at = face_index(record, facing) * FACE_SUM_WORDS;
    uint random = hash(pair.x, packed_position);
    atomicAdd(sums[at], fixed_point(area, random));
    for (uint k = 0u; k < 3u; ++k) {
        random = hash(random);
        atomicAdd(sums[at + 1u + k], fixed_point(area * reflectance[k], random));
        atomicAdd(sums[at + 4u + k], fixed_point(area * inside[k], random << 5));
    }
}
