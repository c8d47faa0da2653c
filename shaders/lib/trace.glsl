// SPDX-License-Identifier: GPL-3.0-or-later
// Rays through the voxel grid, exact against the triangles that its cells list. Empty space is crossed in leaps: an
// empty brick knows how many bricks are empty too in the octant of directions that the ray's is in.
//
// The including shader may define
//     HAS_OPACITY  1: triangles carry an opacity for each cell, and let that share of the rays pass
//     HAS_OUTLINES 1: and where they are transparent only in parts, the outline of these

#include "lib/cell_list.glsl"
#include "lib/outline.glsl"

#if HAS_OUTLINES
layout(binding = TEX_CELL_OPACITIES) uniform usampler2D cell_opacities_tex;
#elif HAS_OPACITY
layout(binding = TEX_CELL_OPACITIES) uniform sampler2D cell_opacities_tex;
#endif

struct Hit {
    float distance;   // cells; the ray's limit when nothing was hit
    uint triangle;    // NONE_INDEX: nothing was hit
    ivec3 cell;       // where it lies; of the stack, where there are levels
    vec3 normal;      // unit, geometric, turned against the ray
};

#if HAS_OPACITY
// Nearer than this (cells) a ray meets partly transparent surfaces for certain: whoever shades the hit asks the material.
float solid_distance = 0.0;
#endif

#if LEVELS
// The cells of a level, and those of the hole in it, seen as a ray does that goes up along every axis.
void level_box(int level, ivec3 mirror, out ivec3 low, out ivec3 high, out ivec3 hole_low, out ivec3 hole_high)
{
    low = (level_first[level].xyz & ~mirror) | (-level_end[level] & mirror);
    high = (level_end[level] & ~mirror) | (-level_first[level].xyz & mirror);
    int finer = max(level - 1, 0);
    hole_low = ((level_first[finer].xyz & ~mirror) | (-level_end[finer] & mirror)) >> 1;
    hole_high = level > 0 ? ((level_end[finer] & ~mirror) | (-level_first[finer].xyz & mirror)) >> 1 : hole_low;
}
#endif

// The first triangle that the ray meets (or, with `any_hit`, any) among those that rays of kind `ray_mask` see.
// origin, direction (unit) and limit in grid space. `seed` decides at partly transparent surfaces.
Hit trace(vec3 origin, vec3 direction, float limit, uint ray_mask, bool any_hit, uint seed)
{
    Hit hit;
    hit.distance = limit;
    hit.triangle = NONE_INDEX;
    uvec2 nearest = uvec2(NONE_INDEX, 0u);  // entry of the cell's list
    hit.cell = ivec3(0);
    hit.normal = vec3(0.0);

    // Zero components become tiny ones: 1/0 would give NaN where the origin lies on a plane between cells.
    vec3 d = mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
    // Steps are taken in a grid that is mirrored so that they go up along every axis.
    bvec3 turned = lessThan(d, vec3(0.0));
    ivec3 mirror = -ivec3(turned);
#if LEVELS
    int level = LEVELS - 1;
    ivec3 low, high, hole_low, hole_high;
    level_box(level, mirror, low, high, hole_low, hole_high);
    float side = level_side(level);
    vec3 start = mix(origin, -origin, turned);
    d = abs(d);
    vec3 inverse = 1.0 / d;
    vec3 enter = (vec3(low) * side - start) * inverse;
    vec3 leave = (vec3(high) * side - start) * inverse;
#else
    ivec3 shift = mirror & grid_size;
    vec3 start = mix(origin, vec3(grid_size) - origin, turned);
    d = abs(d);
    vec3 inverse = 1.0 / d;
    vec3 enter = -start * inverse;
    vec3 leave = (vec3(grid_size) - start) * inverse;
#endif
    float t = max(0.0, max(enter.x, max(enter.y, enter.z)));
    float t_end = min(limit, min(leave.x, min(leave.y, leave.z)));
    if (!(t <= t_end)) {
        return hit;
    }
#if LEVELS
    level = level_of(origin + direction * t);
    level_box(level, mirror, low, high, hole_low, hole_high);
    side = level_side(level);
    ivec3 shift = ivec3(0, 0, level_first[level].w) - level_first[level].xyz;
    ivec3 cell = clamp(ivec3(floor((start + d * t) / side)), low, high - 1);
#else
    ivec3 cell = clamp(ivec3(floor(start + d * t)), ivec3(0), grid_size - 1);
#endif
    int octant = octant_bit(turned);

    // Two loops that take turns: step until every ray of the group stands in an occupied cell, then test triangles.
    // (The inner loop does not ask at its end: what it finds is not carried around it. See README.md, Loops.)
#if LEVELS
    int budget = LEVELS * (grid_size.x + grid_size.y + 8) + grid_size.z;  // a straight line crosses no more cells
#else
    int budget = grid_size.x + grid_size.y + grid_size.z + 8;  // a straight line crosses no more cells
#endif
    bool inside = true;
    float t_exit = t;
    vec3 along = mix(inverse, -inverse, turned);
    vec3 slack = vec3(list_slack(origin));
    do {
        bool occupied = false;
        uvec4 brick = uvec4(0u);
        uint bit = 0u;
        ivec3 listed = cell;  // whose triangles come next
        while (inside && !occupied) {
#if LEVELS
            // Across the border of a level. Cells of the next hold eight of these, or are eight of what this one holds:
            // which, is told by numbers, but for where along the border the ray has come in.
            bool leaves = any(greaterThanEqual(cell, high));
            bool enters = all(greaterThanEqual(cell, hole_low)) && all(lessThan(cell, hole_high));
            if (leaves || enters) {
                level += leaves ? 1 : -1;
                inside = level < LEVELS && --budget > 0;
                level = min(level, LEVELS - 1);
                level_box(level, mirror, low, high, hole_low, hole_high);
                side = level_side(level);
                shift = ivec3(0, 0, level_first[level].w) - level_first[level].xyz;
                ivec3 there = ivec3(floor((start + d * t_exit) / side));
                cell = leaves ? cell >> 1 : clamp(there, 2 * cell, 2 * cell + 1);
                continue;
            }
#endif
            ivec3 at = (cell ^ mirror) + shift;
            brick = fetch_source(bricks_tex, at / BRICK);
            bit = brick_bit(at);
            uint word = bit < 32u ? brick.x : brick.y;
            occupied = (word >> (bit & 31u) & 1u) != 0u;
            listed = at;
            // Bits of the block of 2x2x2 cells around this one.
            uint block = 0x00330033u << ((at.x & 2) + ((at.y & 2) << 2));
            int block_side = (word & block) == 0u ? 2 : 1;
            int empty = BRICK * int(brick.w >> octant & 15u);
            ivec3 end = empty > 0 ? (cell & -BRICK) + empty : (cell & -block_side) + block_side;
#if LEVELS
            end = min(end, high);
            vec3 at_plane = (vec3(end) * side - start) * inverse;
            t_exit = min(at_plane.x, min(at_plane.y, at_plane.z));
            ivec3 next = clamp(ivec3(floor((start + d * t_exit) / side)), cell, end - 1);
#else
            vec3 at_plane = (vec3(end) - start) * inverse;
            t_exit = min(at_plane.x, min(at_plane.y, at_plane.z));
            ivec3 next = clamp(ivec3(start + d * t_exit), cell, end - 1);
#endif
            cell.x = at_plane.x == t_exit ? end.x : next.x;
            cell.y = at_plane.y == t_exit ? end.y : next.y;
            cell.z = at_plane.z == t_exit ? end.z : next.z;
#if LEVELS
            inside = t_exit < t_end && --budget > 0;
#else
            inside = t_exit < t_end && all(lessThan(cell, grid_size)) && --budget > 0;
#endif
        }
        uvec4 record = uvec4(0u);
        if (occupied) {
            record = fetch_source(cells_tex, list_texel(occupied_cell_index(brick, bit)));
        }
#if LEVELS
        ListWalk walk = begin_list(record, origin / side - vec3(listed - shift), along * side, slack / side);
#else
        ListWalk walk = begin_list(record, origin - vec3(listed), along, slack);
#endif
        do {
            next_run(walk, hit.distance);
            if (walk.next < walk.end) do {
                uvec2 entry = fetch_source(cell_triangles_tex, list_texel(walk.next)).rg;
                uvec3 words;
                vec3 corner, e1, e2;
                fetch_corners(entry, words, corner, e1, e2);
                vec3 p = cross(direction, e2);
                float determinant = dot(e1, p);
                float f = 1.0 / determinant;
                vec3 s = origin - corner;
                float u = dot(s, p) * f;
                vec3 q = cross(s, e1);
                float v = dot(direction, q) * f;
                float w = dot(e2, q) * f;
                bool met = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && w > 0.0 && determinant != 0.0 &&
                           (entry_flags(entry, words) & ray_mask) != 0u;
                // Equal distances go to the lower number: the order of a cell's list must not show.
                met = met && (w < hit.distance || (w == hit.distance && comes_before(entry, nearest)));
#if HAS_OPACITY
                if (met && w >= solid_distance) {
#if HAS_OUTLINES
#if LEVELS
                    vec3 place = (origin + direction * w) / side - vec3(listed - shift);
#else
                    vec3 place = origin + direction * w - vec3(listed);
#endif
                    uvec2 outline = texelFetch(cell_opacities_tex, list_texel(walk.next), 0).rg;
                    float opacity = outline_opacity(outline, place, dominant_axis(cross(e1, e2)));
#else
                    float opacity = texelFetch(cell_opacities_tex, list_texel(walk.next), 0).r;
#endif
                    // One decision for a triangle and a ray, whichever cell asks.
                    met = opacity >= 1.0 || unit_float(hash(seed, triangle_number(entry))) < opacity;
                }
#endif
                ++walk.next;
                if (met) {
                    hit.distance = w;
                    nearest = entry;
                }
                if (met && any_hit) {
                    end_list(walk);
                }
            } while (walk.next < walk.end);
        } while (has_runs(walk));
        inside = inside && hit.distance > t_exit && !(any_hit && nearest.x != NONE_INDEX);
    } while (inside);
    if (nearest.x != NONE_INDEX) {
        hit.triangle = triangle_number(nearest);
        uvec3 words;
        vec3 corner, e1, e2;
        fetch_corners(nearest, words, corner, e1, e2);
        vec3 n = normalize(cross(e1, e2));
        hit.normal = dot(n, direction) > 0.0 ? -n : n;
        hit.cell = nearest_cell(origin + direction * hit.distance);
    }
    return hit;
}

// Whether something stands between origin and a point `limit` cells along direction.
bool is_blocked(vec3 origin, vec3 direction, float limit, uint seed)
{
    return trace(origin, direction, limit, RAY_SHADOW, true, seed).triangle != NONE_INDEX;
}

// A ray towards a point, `distance` cells along `direction` from `position`, starts at `origin` instead.
void start_at(vec3 origin, vec3 position, inout vec3 direction, inout float distance)
{
    vec3 way = direction + (position - origin) / max(distance, 1e-20);
    float size = length(way);
    direction = size > 0.0 ? way / size : direction;
    distance *= size;
}

// From so far (cells of the receiver's level) a ray ends within a tenth of RAY_START of where it should: a float has 24 bits.
const float MOST_EXACT = 1e3;

// Whether something stands between a receiver at origin and a point on a light, `distance` cells along direction. The ray
// comes from the light, unless that is far: what is in the way of many receivers is met early, and what lies around the
// receiver is asked only where nothing is in the way.
bool is_shaded(vec3 origin, vec3 direction, float distance, uint seed)
{
    float side = cell_side(origin);
    float gap = RAY_START * side;
    bool comes = distance < MOST_EXACT * side;
    vec3 start = comes ? origin + direction * (distance - gap) : origin;
    float limit = comes ? distance * (1.0 - 4e-6) - 2.0 * gap : distance - gap;
    return is_blocked(start, comes ? -direction : direction, limit, seed);
}
