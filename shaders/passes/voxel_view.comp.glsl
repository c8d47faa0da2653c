// SPDX-License-Identifier: GPL-3.0-or-later
// Voxels as the camera sees them: the side of the first occupied cell on each ray, flat, with edges. VIEW says what it
// shows; see passes/view.py.
// Nested levels show their own cells, whatever the size of blocks, and a hue for each level.
// Input: the grid, its faces (HAS_FACES) and their radiance (HAS_RADIANCE), emitters (HAS_EMITTERS).
// Output: value_img, w: 1 where there is a cell.

#include "lib/camera.glsl"
#include "lib/trace.glsl"
#include "lib/cut.glsl"
#if HAS_FACES
#include "lib/face.glsl"
#endif
#if HAS_RADIANCE
#include "lib/radiance.glsl"
#endif
#if HAS_EMITTERS
#include "lib/emitter.glsl"
#endif

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(binding = IMG_0, rgba32f) writeonly uniform image2D value_img;

uniform int level;       // blocks of 2^level cells a side
uniform float exposure;  // of light

const vec3 NOTHING = vec3(0.02);  // there is a cell, and nothing to be shown of it

// Whether any cell of a block is occupied; `block` is its lowest cell.
bool is_occupied(ivec3 block)
{
    if (level == 0) {
        return cell_index(block) != NONE_INDEX;
    }
    if (level == 1) {
        uvec4 brick = fetch_source(bricks_tex, block / BRICK);
        uint bit = brick_bit(block);
        return ((bit < 32u ? brick.x : brick.y) >> (bit & 31u) & 0x00330033u) != 0u;
    }
    int side = (1 << level) / BRICK;
    ivec3 first = block / BRICK;
    ivec3 last = min(first + side, (grid_size + BRICK - 1) / BRICK) - 1;
    for (int z = first.z; z <= last.z; ++z) {
        for (int y = first.y; y <= last.y; ++y) {
            for (int x = first.x; x <= last.x; ++x) {
                if (any(notEqual(fetch_source(bricks_tex, ivec3(x, y, z)).xy, uvec2(0u)))) {
                    return true;
                }
            }
        }
    }
    return false;
}

struct Block {
    bool is_met;
    ivec3 cell;      // its lowest
    vec3 low;        // its lowest corner
    float side;
    float distance;  // cells
    int axis;        // that the side which is seen is perpendicular to
};

#if LEVELS
const float INSIDE = 1e-3;  // sides of cells: so far beyond the border that a ray comes to, it looks for the next cell

Block first_block(vec3 origin, vec3 direction)
{
    Block block = Block(false, ivec3(0), vec3(0.0), 1.0, 0.0, 0);
    vec3 d = mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
    vec3 inverse = 1.0 / d;
    bvec3 forward = greaterThan(d, vec3(0.0));
    float widest = level_side(LEVELS - 1);
    vec3 to_low = (vec3(level_first[LEVELS - 1].xyz) * widest - origin) * inverse;
    vec3 to_high = (vec3(level_end[LEVELS - 1]) * widest - origin) * inverse;
    vec3 enter = min(to_low, to_high);
    vec3 leave = max(to_low, to_high);
    float t = max(0.0, max(enter.x, max(enter.y, enter.z)));
    float t_end = min(leave.x, min(leave.y, leave.z));
    vec3 nearest = t > 0.0 ? enter : abs(d);
    block.axis = nearest.x >= max(nearest.y, nearest.z) ? 0 : (nearest.y >= nearest.z ? 1 : 2);
    float side = cell_side(origin + d * t);
    int budget = LEVELS * (grid_size.x + grid_size.y + 8) + grid_size.z;
    while (t < t_end && --budget > 0) {
        ivec3 cell = cell_at(origin + d * (t + INSIDE * side));
        int at = level_of_cell(cell);
        side = level_side(at);
        vec3 low = vec3(from_stack(cell, at)) * side;
        if (cell_index(cell) != NONE_INDEX) {
            block = Block(true, cell, low, side, t, block.axis);
            break;
        }
        vec3 at_plane = (low + mix(vec3(0.0), vec3(side), forward) - origin) * inverse;
        t = max(t + INSIDE * side, min(at_plane.x, min(at_plane.y, at_plane.z)));
        block.axis = at_plane.x <= t ? 0 : (at_plane.y <= t ? 1 : 2);
    }
    return block;
}
#else
Block first_block(vec3 origin, vec3 direction)
{
    Block block = Block(false, ivec3(0), vec3(0.0), float(1 << level), 0.0, 0);
    vec3 d = mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
    vec3 inverse = 1.0 / d;
    vec3 to_lo = -origin * inverse;
    vec3 to_hi = (vec3(grid_size) - origin) * inverse;
    vec3 enter = min(to_lo, to_hi);
    vec3 leave = max(to_lo, to_hi);
    float t = max(0.0, max(enter.x, max(enter.y, enter.z)));
    float t_end = min(leave.x, min(leave.y, leave.z));
    if (!(t < t_end)) {
        return block;
    }
    bvec3 forward = greaterThan(d, vec3(0.0));
    vec3 nearest = t > 0.0 ? enter : abs(d);
    block.axis = nearest.x >= max(nearest.y, nearest.z) ? 0 : (nearest.y >= nearest.z ? 1 : 2);
    ivec3 cell = clamp(ivec3(floor(origin + d * t)), ivec3(0), grid_size - 1);
    int octant = octant_bit(not(forward));
    int budget = grid_size.x + grid_size.y + grid_size.z + 8;
    while (t < t_end && inside_grid(cell) && --budget > 0) {
        ivec3 lo = (cell >> level) << level;
        ivec3 hi = lo + (1 << level);
        int empty = BRICK * int(fetch_source(bricks_tex, cell / BRICK).w >> octant & 15u);
        if (empty > 0 && level <= 2) {
            lo = (cell & -BRICK) + (BRICK - empty) * ivec3(not(forward));
            hi = lo + empty;
        } else if (is_occupied(lo)) {
            block.is_met = true;
            block.cell = lo;
            block.low = vec3(lo);
            block.distance = t;
            break;
        }
        vec3 at_plane = (mix(vec3(lo), vec3(hi), forward) - origin) * inverse;
        t = min(at_plane.x, min(at_plane.y, at_plane.z));
        block.axis = at_plane.x <= t ? 0 : (at_plane.y <= t ? 1 : 2);
        cell = clamp(ivec3(floor(origin + d * t)), max(lo, ivec3(0)), min(hi, grid_size) - 1);
        cell[block.axis] = forward[block.axis] ? hi[block.axis] : lo[block.axis] - 1;
    }
    return block;
}
#endif

#if HAS_FACES
// The cell's face that looks to the side that is seen, or else the one that looks most towards the viewer.
uint seen_face(ivec3 cell, vec3 position, vec3 normal, vec3 direction)
{
    uvec4 record = fetch_source(cells_tex, list_texel(cell_index(cell)));
    uint facings = (record.w | record.w >> 6) & 63u;
    uint facing = NONE_INDEX;
    float best = -1e30;
    for (uint other = 0u; other < 6u; ++other) {
        float along = dot(facing_vector(other), 4.0 * normal - direction);
        if ((facings >> other & 1u) != 0u && along > best) {
            best = along;
            facing = other;
        }
    }
    if (facing == NONE_INDEX) {
        return NONE_INDEX;
    }
    uint bit = lies_beyond(record, cell, position, normal) ? facing + 6u : facing;
    if ((record.w >> bit & 1u) == 0u) {
        bit = bit < 6u ? bit + 6u : bit - 6u;
    }
    return face_index(record, bit);
}
#endif

#if HAS_EMITTERS
// What the surface behind the middle of a cell's side sends, or else that which is seen in the cell.
vec3 emission_of(Block block, vec3 normal, vec3 origin, vec3 direction)
{
    float side = cell_side(block.low + 0.5 * block.side);
    vec3 start = block.low + (0.5 + 0.5 * normal) * side;
    vec3 along = -normal;
    Hit hit = trace(start, along, side, RAY_ALL, false, 0u);
    if (hit.triangle == NONE_INDEX) {
        start = origin + direction * max(block.distance - 1e-3 * side, 0.0);
        along = direction;
        hit = trace(start, along, 1.8 * side, RAY_ALL, false, 0u);
    }
    return hit.triangle == NONE_INDEX ? vec3(0.0) : emission_met(hit.triangle, start, along, hit.distance, 0.0).radiance;
}
#endif

vec3 shown(Block block, vec3 position, vec3 normal, vec3 origin, vec3 direction)
{
#if VIEW == VIEW_VOXELS
    // A hue for each level; blocks a little apart, sides as under three lamps.
#if LEVELS
    int shown_level = level_of_cell(block.cell);
    ivec3 place = block.cell;
#else
    int shown_level = level;
    ivec3 place = block.cell >> level;
#endif
    vec3 hue = 0.5 + 0.5 * cos(2.0 * PI * (vec3(0.0, 0.33, 0.67) + 0.17 * float(shown_level)));
    float apart = 0.85 + 0.15 * unit_float(hash(uint(place.x + 2048 * place.y), uint(place.z)));
    float shade = dot(abs(normal), vec3(0.65, 0.8, 1.0));
    return mix(vec3(0.6), hue, 0.6) * (apart * shade);
#elif VIEW == VIEW_VOXEL_EMISSION
#if HAS_EMITTERS
    return emission_of(block, normal, origin, direction) * exposure;
#else
    return vec3(0.0);
#endif
#elif HAS_FACES
    uint face = seen_face(block.cell, position, normal, direction);
    if (face == NONE_INDEX) {
        return NOTHING;
    }
#if VIEW == VIEW_VOXEL_ALBEDO
    return fetch_face_reflectance(face).rgb;
#elif VIEW == VIEW_VOXEL_NORMAL
    vec3 place, face_normal;
    fetch_face_place(face, place, face_normal);
    return 0.5 + 0.5 * face_normal;
#elif VIEW == VIEW_VOXEL_OPACITY
    return vec3(min(fetch_face_reflectance(face).a, 1.0));
#elif VIEW == VIEW_VOXEL_RADIANCE && HAS_RADIANCE
    return face_radiance(face) * exposure;
#else
    return NOTHING;
#endif
#else
    return NOTHING;
#endif
}

// How much of a pixel is not on an edge of its block's side; blocks of few pixels have none.
float off_edges(Block block, vec3 position, vec3 direction)
{
    float side = block.side;
    vec3 inside = position - block.low;
    vec3 to_edge = min(inside, side - inside);
    to_edge[block.axis] = side;
    float pixel = max(pixel_footprint(block.distance, direction), 1e-6);
    float distance = min(to_edge.x, min(to_edge.y, to_edge.z)) / pixel;
    float strength = smoothstep(3.0, 12.0, side / pixel);
    return 1.0 - 0.7 * strength * (1.0 - smoothstep(0.25, 1.25, distance));
}

void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, picture_size))) {
        return;
    }
    vec3 origin, direction;
    camera_ray(at, origin, direction);
    Block block = first_block(origin, direction);
    vec4 value = vec4(0.0);
    if (block.is_met) {
        vec3 position = origin + direction * block.distance;
        vec3 normal = vec3(0.0);
        normal[block.axis] = direction[block.axis] > 0.0 ? -1.0 : 1.0;
        vec3 color = shown(block, position, normal, origin, direction);
        value = vec4(finite_or_zero(color) * off_edges(block, position, direction), 1.0);
    }
    imageStore(value_img, at, value);
}
