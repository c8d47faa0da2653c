// SPDX-License-Identifier: GPL-3.0-or-later
// Which faces does each cell get? Surfaces that see different parts of space must not share one: the floors on both
// sides of a thin wall, a picture and the wall behind it. A cell that holds such is cut in two by a plane across an
// axis, and each side has faces of its own. A plane along a wall also tells on which side of it a point lies.
// IS_PART: of a part of the cells.
// Input: parts and triangles of cells.    Output: for each cell the last word of its record (lib/grid.glsl).

#include "lib/grid.glsl"
#include "lib/triangle.glsl"
#include "lib/part.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_CELLS) uniform usampler2D cells_tex;
layout(binding = TEX_CELL_TRIANGLES) uniform usampler2D cell_triangles_tex;
layout(binding = TEX_CELL_POSITIONS) uniform usampler2D cell_positions_tex;
layout(binding = TEX_PARTS) uniform usampler2D parts_tex;
layout(std430, binding = BUF_COUNTS) buffer Cells { uint cells[]; };
#if IS_PART
layout(std430, binding = BUF_WORK) readonly buffer Work { uint work[]; };  // cells
#endif

uniform uint work_count;

// Areas in sides of cells. What is smaller is not worth faces of its own.
const float LEAST_AREA = 0.3;
// And on a side of a cell that is cut anyway.
const float SIDE_AREA = 0.1;
// A wall, whose plane is noted though nothing lies behind it.
const float WALL_AREA = 0.25;

// Extent of a triangle's bounds inside the cell.
void bounds_inside(Triangle t, vec3 corner, out vec3 low, out vec3 high)
{
    vec3 a = t.corner - corner;
    low = clamp(a + min(vec3(0.0), min(t.edge_1, t.edge_2)), 0.0, 1.0);
    high = clamp(a + max(vec3(0.0), max(t.edge_1, t.edge_2)), 0.0, 1.0);
}

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
#if IS_PART
    number = work[number];
#endif
    uvec4 record = texelFetch(cells_tex, list_texel(number), 0);
    uint first = record.x, end = record.x + record.y;
    ivec3 cell = unpack_cell(texelFetch(cell_positions_tex, list_texel(number), 0).r);
    int level = level_of_cell(cell);
    vec3 corner = vec3(from_stack(cell, level));

    // Area, and area x place along the axis, of the facings.
    uvec3 plus = uvec3(0u), minus = uvec3(0u), plus_place = uvec3(0u), minus_place = uvec3(0u);
    uint axes = 0u;
    for (uint k = first; k < end; ++k) {
        Part part = unpack_part(texelFetch(parts_tex, list_texel(k), 0));
        uvec3 mask = uvec3(equal(uvec3(0u, 1u, 2u), uvec3(part.facing >> 1))) * 0xFFFFFFFFu;
        bool is_minus = (part.facing & 1u) != 0u;
        plus += is_minus ? uvec3(0u) : part.area & mask;
        minus += is_minus ? part.area & mask : uvec3(0u);
        plus_place += is_minus ? uvec3(0u) : part.position & mask;
        minus_place += is_minus ? part.position & mask : uvec3(0u);
        axes |= 1u << (part.facing >> 1);
    }
    bool is_single = bitCount(axes) < 2;
    uvec3 larger = max(plus, minus);
    vec3 plus_mean = vec3(plus_place) / max(vec3(plus), 1.0);
    vec3 minus_mean = vec3(minus_place) / max(vec3(minus), 1.0);
    // Air: surfaces that face each other.
    vec3 gap = vec3(min(plus, minus)) * vec3(greaterThan(minus_mean, plus_mean)) / FIXED_ONE;
    bool may_be_cut =
        !is_single || max_component(gap) > LEAST_AREA || max_component(vec3(larger) / FIXED_ONE) > 1.0 + LEAST_AREA;

    // Walls: in the middle between their sides, where they have two.
    vec3 middle = 0.5 * (plus_mean + minus_mean);
    vec3 wall = mix(minus_mean, plus_mean, greaterThanEqual(plus, minus));
    for (int a = 0; a < 3; ++a) {
        bool has_two = plus[a] > 0u && minus[a] > 0u && minus_mean[a] < plus_mean[a];
        wall[a] = has_two ? middle[a] : wall[a];
    }
    // What lies beyond a wall in each axis, of the surfaces that face the other axes; and areas seen along the axes.
    uvec3 beyond_x = uvec3(0u), beyond_y = uvec3(0u), beyond_z = uvec3(0u);
    uvec3 seen_plus = uvec3(0u), seen_minus = uvec3(0u);
    for (uint k = first; k < (may_be_cut ? end : first); ++k) {
        Part part = unpack_part(texelFetch(parts_tex, list_texel(k), 0));
        Triangle t = in_level(fetch_listed(texelFetch(cell_triangles_tex, list_texel(k), 0).rg), level);
        uvec3 mask = uvec3(equal(uvec3(0u, 1u, 2u), uvec3(part.facing >> 1))) * 0xFFFFFFFFu;
        vec3 low, high;
        bounds_inside(t, corner, low, high);
        vec3 share = clamp((high - wall) / max(high - low, 1e-6), 0.0, 1.0);
        uvec3 area = uvec3(share * float(part.area) + 0.5);
        beyond_x += area.x & mask;
        beyond_y += area.y & mask;
        beyond_z += area.z & mask;
        vec3 n = abs(normalize(cross(t.edge_1, t.edge_2)));
        uvec3 seen = uvec3(n * float(part.area)) & mask;
        bool is_minus = (part.facing & 1u) != 0u;
        seen_plus += is_minus ? uvec3(0u) : seen;
        seen_minus += is_minus ? seen : uvec3(0u);
    }
    uvec3 all = plus + minus;
    uvec3 both_x = min(beyond_x, all - min(all, beyond_x));
    uvec3 both_y = min(beyond_y, all - min(all, beyond_y));
    uvec3 both_z = min(beyond_z, all - min(all, beyond_z));
    vec3 divided = vec3(both_x.y + both_x.z, both_y.x + both_y.z, both_z.x + both_z.y) / FIXED_ONE;
    vec3 divider = vec3(larger) / FIXED_ONE;
    // Layers: surfaces that face alike, one over the other, have more area than the cell's side.
    uvec3 seen_more = max(seen_plus, seen_minus);
    vec3 layered = vec3(seen_more) / FIXED_ONE - 1.0;
    vec3 between = mix(minus_mean, plus_mean, greaterThanEqual(seen_plus, seen_minus));

    int cut = -1;
    float place = 0.0;
    float most = LEAST_AREA;
    for (int a = 0; a < 3; ++a) {
        float gain = min(divided[a], divider[a]);
        float layers = may_be_cut ? max(layered[a], gap[a]) : 0.0;
        if (max(gain, layers) > most) {
            most = max(gain, layers);
            cut = a;
            place = gain >= layers ? wall[a] : (layered[a] >= gap[a] ? between[a] : middle[a]);
        }
    }
    if (cut < 0 && !is_single) {
        most = WALL_AREA;
        for (int a = 0; a < 3; ++a) {
            if (divider[a] > most) {
                most = divider[a];
                cut = a;
                place = wall[a];
            }
        }
    }
    uint units = uint(clamp(place, 0.0, 1.0) * CUT_UNITS + 0.5);
    place = float(units) / CUT_UNITS;

    // Areas on the sides: surfaces that face along the cut's axis lie where their middle is.
    uvec3 near = uvec3(0u), far = uvec3(0u);
    for (uint k = first; k < (cut >= 0 ? end : first); ++k) {
        Part part = unpack_part(texelFetch(parts_tex, list_texel(k), 0));
        Triangle t = in_level(fetch_listed(texelFetch(cell_triangles_tex, list_texel(k), 0).rg), level);
        uvec3 mask = uvec3(equal(uvec3(0u, 1u, 2u), uvec3(part.facing >> 1))) * 0xFFFFFFFFu;
        vec3 low, high;
        bounds_inside(t, corner, low, high);
        float share = clamp((high[cut] - place) / max(high[cut] - low[cut], 1e-6), 0.0, 1.0);
        if (int(part.facing >> 1) == cut) {
            share = float(part.position[cut]) > place * float(part.area) ? 1.0 : 0.0;
        }
        uint beyond = uint(share * float(part.area) + 0.5);
        far += beyond & mask;
        near += (part.area - min(part.area, beyond)) & mask;
    }
    uint facings = 0u;
    for (int a = 0; a < 3; ++a) {
        uint least = min(uint(SIDE_AREA * FIXED_ONE), max(near[a], far[a]));
        uint sides = (near[a] >= least ? 3u : 0u) | (far[a] >= least ? 3u << 6 : 0u);
        sides = cut < 0 ? 3u : (near[a] == 0u && far[a] > 0u ? 3u << 6 : (far[a] == 0u ? 3u : sides));
        facings |= (axes >> a & 1u) != 0u ? sides << 2 * a : 0u;
    }
    cells[number] = facings | uint(cut + 1) << 12 | units << 14;
}
