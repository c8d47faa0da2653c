// SPDX-License-Identifier: GPL-3.0-or-later
// What each triangle brings to each cell it enters, listed cell by cell. HAS_FACES: cells have faces that it is part of.
// HAS_OUTLINES: some material of the scene is transparent only in parts.    VARIES: those of this batch are.
// A surface counts, with its area, for the facing that its normal is nearest to. A sheet has two sides, but what its
// back looks like is asked only where no front faces that way (pass voxel_resolve): a thin wall keeps two colours.
// Input: pairs of one batch, triangles, materials, cell numbering.
// Output: triangles of cells, and their parts (see lib/part.glsl).

#include "lib/grid.glsl"
#include "lib/part.glsl"
#include "lib/outline.glsl"
#include "lib/geometry.glsl"
#include "lib/closure.glsl"

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_PAIRS, SOURCE_PAIRS, rgba32ui) pairs_tex;
layout(std430, binding = BUF_COUNTS) buffer Cursors { uint cursors[]; };  // next list entry of each cell
#if HAS_INSTANCES
layout(binding = IMG_0, rg32ui) writeonly uniform uimage2D cell_triangle_img;
#else
layout(binding = IMG_0, r32ui) writeonly uniform uimage2D cell_triangle_img;
#endif
#if HAS_FACES
layout(binding = IMG_1, rgba32ui) writeonly uniform uimage2D part_img;
#endif
#if HAS_OUTLINES
layout(binding = IMG_2, rg32ui) writeonly uniform uimage2D cell_opacity_img;
#elif HAS_OPACITY
layout(binding = IMG_2, r8) writeonly uniform image2D cell_opacity_img;
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

const float VIEW_COSINE = 0.55;

// Light goes straight through glass here, losing what is reflected on average; `glass`: that.
float opacity_of(Surface surface, out vec3 glass)
{
    glass = specular_directional_albedo(surface.glass_f0, surface.glass_f90, surface.glass_ior, surface.glass_roughness,
                                        VIEW_COSINE);
    vec3 passed = surface.transparency + surface.glass_transmission * (1.0 - glass);
    return 1.0 - clamp(luminance(passed), 0.0, 1.0);
}

#if HAS_OUTLINES && VARIES
// Where in a cell a triangle stops rays. What is partly transparent in itself does so at some of the places, drawn at
// random, for each triangle others. `covers`: which share of the triangle's part in the cell does; unchanged where that is
// too small to tell.
uvec2 outline(uint number, Triangle triangle, ivec3 cell, int level, vec3 inside, vec3 view, int axis, inout float covers)
{
    uvec2 bits = uvec2(0u);
    float there = 0.0, stops = 0.0;
    vec3 along = mix(vec3(0.0), vec3(1.0), equal(ivec3(axis), ivec3(0, 1, 2)));
    float side = level_side(level);
    uint seed = hash(hash(uint(cell.x), hash(uint(cell.y), uint(cell.z))), number);
    for (uint bit = 0u; bit < uint(OUTLINE_SIZE.x * OUTLINE_SIZE.y); ++bit) {
        uint random = hash(seed, bit);
        vec3 at = outline_point(bit, vec2(unit_float(random), unit_float(random << 16)), axis) + inside * along;
        vec2 barycentric;
        float distance;
        intersect_plane(triangle, (vec3(from_stack(cell, level)) + at) * side, along, barycentric, distance);
        bool is_there = all(greaterThanEqual(barycentric, vec2(0.0))) && barycentric.x + barycentric.y <= 1.0;
        barycentric = max(barycentric, 0.0);
        barycentric /= max(1.0, barycentric.x + barycentric.y);
        vec3 glass;
        float opacity = opacity_of(surface_at(triangle, shading_point(triangle, barycentric, view, side / 8.0)), glass);
        bool is_set = unit_float(hash(random)) < opacity;
        there += is_there ? 1.0 : 0.0;
        stops += is_there && is_set ? 1.0 : 0.0;
        uint word = is_set ? 1u << (bit & 31u) : 0u;
        bits |= bit < 32u ? uvec2(word, 0u) : uvec2(0u, word);
    }
    covers = there > 0.0 ? stops / there : covers;
    return bits;
}
#endif

void main()
{
    uint number = invocation_index();
    if (number >= pair_count) {
        return;
    }
    uvec4 pair = fetch_source(pairs_tex, list_texel(pair_first + number));
    Triangle triangle = fetch_triangle(pair.x);
    float area = uintBitsToFloat(pair.z);
    vec3 inside = pair_centre(pair);
    ivec3 cell = pair_cell(pair);
    vec3 normal = normalize(cross(triangle.edge_1, triangle.edge_2));

    vec2 barycentric;
    float distance;
    int level = level_of_cell(cell);
    vec3 place = (vec3(from_stack(cell, level)) + inside) * level_side(level);
    intersect_plane(triangle, place + normal, -normal, barycentric, distance);
    barycentric = max(barycentric, 0.0);
    barycentric /= max(1.0, barycentric.x + barycentric.y);
    // As seen from 57 degrees, where surfaces reflect about what they do on average over the hemisphere: the angle at
    // which that holds is 60 degrees for a smooth dielectric and 53 for a rough one.
    vec3 tangent, bitangent;
    basis(normal, tangent, bitangent);
    vec3 view = VIEW_COSINE * normal + sqrt(1.0 - VIEW_COSINE * VIEW_COSINE) * tangent;
    ShadingPoint point = shading_point(triangle, barycentric, view, sqrt(area) * level_side(level));
    Surface surface = surface_at(triangle, point);
    vec3 glass;
    float opacity = opacity_of(surface, glass);

    uint slot = atomicAdd(cursors[cell_index(cell)], 1u);
    imageStore(cell_triangle_img, list_texel(slot), uvec4(list_entry(pair.x, triangle), 0u, 0u));
    float covers = opacity;
#if HAS_OUTLINES
    uvec2 bits = uvec2(0u);
#if VARIES
    bits = outline(pair.x, triangle, cell, level, inside, view, pair_axis(pair), covers);
#endif
    imageStore(cell_opacity_img, list_texel(slot), uvec4(pack_outline(bits, covers), 0u, 0u));
#elif HAS_OPACITY
    imageStore(cell_opacity_img, list_texel(slot), vec4(opacity));
#endif
#if HAS_OPACITY
    area *= covers;
#endif

#if HAS_FACES
    // As a Lambertian.
    vec3 reflectance = surface.diffuse + glass;
    reflectance += specular_directional_albedo(surface.specular_f0, surface.specular_f90, surface.specular_ior,
                                               surface.roughness, VIEW_COSINE);
    reflectance += surface.coat * dielectric_reflectance(VIEW_COSINE, surface.coat_ior);
    reflectance = min(reflectance / max(opacity, 1e-3), 1.0);
    int axis = pair_axis(pair);
    Part part;
    part.facing = uint(2 * axis) + (normal[axis] < 0.0 ? 1u : 0u);
    uint random = hash(pair.x, pair.y);
    area = area > 0.0 ? max(area, 1.0 / FIXED_ONE) : 0.0;  // a sliver alone in a cell has its colour, on average
    part.area = fixed_point(area, random);
    for (uint k = 0u; k < 3u; ++k) {
        random = hash(random);
        part.reflectance[k] = fixed_point(area * reflectance[k], random);
        part.position[k] = fixed_point(area * inside[k], random << 5);
    }
    imageStore(part_img, list_texel(slot), pack_part(part));
#endif
}
