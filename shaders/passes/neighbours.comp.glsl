// SPDX-License-Identifier: GPL-3.0-or-later
// Which cells beside it are hidden from the faces of a cell? Light of faces is interpolated and shared along surfaces, and
// shall not pass through a wall that ends on them.
// Input: faces, triangles of cells, cells with their positions, work on pairs of faces.    Output: for each cell a bit for
// each direction, and six more for what lies beyond the plane that cuts the cell (lib/grid.glsl).

#include "lib/neighbour.glsl"
#include "lib/part.glsl"
#include "lib/face_work.glsl"

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_CELL_POSITIONS, SOURCE_CELL_POSITIONS, r32ui) cell_positions_tex;
layout(std430, binding = BUF_RESULTS) buffer Hidden { uint hidden[]; };

uniform uint work_first;  // of this dispatch
uniform uint work_count;  // of all: each pair twice, for one face and then for the other

// Cells with surfaces across no more than one axis, not one before the other: nothing stands on them.
bool is_plain(uvec4 record)
{
    uint facings = (record.w | record.w >> 6) & 63u;
    uint axes = (facings | facings >> 1) & 21u;
    return cut_axis(record) < 0 && bitCount(axes) < 2;
}

// Whether nothing stands on the cells between two whose corners touch.
bool is_plain_between(ivec3 one, ivec3 other)
{
    bool is_plain_so_far = true;
    for (int k = 1; k < 7 && is_plain_so_far; ++k) {
        ivec3 share = ivec3(k, k >> 1, k >> 2) & 1;
        is_plain_so_far = is_plain(record_of(one + share * (other - one)));
    }
    return is_plain_so_far;
}

// Few of the faces around one have to be looked for by a ray. A group lists them, so that its threads take them in turn: what
// thread (eight bits), what step from its face, and the face there.
const uint ASKS = uint(GROUP_SIZE) * 4u;
shared uvec2 asked_along[ASKS];     // one step along an axis: thread | step << 8, face
shared uvec2 asked_across[ASKS];    // two: along both
shared uvec2 to_trace[ASKS];        // what is left of the one, then of the other
shared uint asked_along_count, asked_across_count, trace_along_count, trace_across_count;
// Of each thread:
shared uint face_of[GROUP_SIZE];
shared uint cell_of[GROUP_SIZE];    // its packed position
shared uint side_of[GROUP_SIZE];
shared uint found_of[GROUP_SIZE];   // what is hidden

// Of two opposite steps the later one.
bool is_later(int k)
{
    return k == 1 || k == 3 || k >= 6;
}

// What a step from a face finds out about.
uvec2 bits_of_step(vec3 normal, ivec2 at)
{
    int axis = dominant_axis(normal);
    ivec3 along_right = ivec3(0), along_up = ivec3(0);
    along_right[(axis + 1) % 3] = at.x;
    along_up[(axis + 2) % 3] = at.y;
    return uvec2(bits_towards(along_right), bits_towards(along_up));
}

// Whether nothing is left to ask: one of two axes has told of what lies across both, or the step back leads here, and the
// other face asks. Steps across both axes may tell of the same bit: whichever do, it is the same.
bool is_told(uvec2 ask)
{
    uint thread = ask.x & 255u;
    int k = int(ask.x >> 8);
    vec3 position, normal;
    fetch_face_place(face_of[thread], position, normal);
    uvec2 bits = bits_of_step(normal, neighbour_step(k));
    bool told = (found_of[thread] & (bits.x | bits.y)) != 0u;
    if (!told && is_later(k)) {
        FoundFace back = face_beside(surroundings(ask.y), -neighbour_step(k));
        told = back.cell == unpack_cell(cell_of[thread]) && back.bit != NONE_INDEX && back.bit / 6u == side_of[thread];
    }
    return told;
}

void look_for(uvec2 ask)
{
    uint thread = ask.x & 255u;
    ivec2 at = neighbour_step(int(ask.x >> 8));
    vec3 position, normal, there, normal_there;
    fetch_face_place(face_of[thread], position, normal);
    fetch_face_place(ask.y, there, normal_there);
    uint seed = face_seed(face_of[thread]);
    // From place to place, or to above it: what bulges hides places from each other.
    vec3 from = position + normal * ray_start(position);
    vec3 straight = there + normal_there * ray_start(there) - from;
    float height = dot(straight, normal);
    vec3 along = straight - height * normal;
    bool is_free = false;
    for (int look = 0; look < 2 && !is_free; ++look) {
        vec3 path = (look == 0) == (height < 0.0) ? along : straight;
        float size = max(length(path), 1e-6);
        is_free = !is_blocked(from, path / size, size, seed);
    }
    uvec2 bits = bits_of_step(normal, at);
    if (!is_free) {
        atomicOr(found_of[thread], at.x != 0 ? bits.x : bits.y);
    }
}

// The faces around this thread's that are to be looked for.
void list_asks(uint thread, uint number)
{
    uint index, side, axis;
    fetch_face_work(number % (work_count / 2u), index, side, axis);
    uint packed_cell = fetch_source(cell_positions_tex, list_texel(index)).r;
    ivec3 cell = unpack_cell(packed_cell);
    uvec4 record = fetch_source(cells_tex, list_texel(index));
    uint face = face_index(record, 6u * side + 2u * axis) + 2u * number / work_count;
    Surroundings around = surroundings(face);
    face_of[thread] = face;
    cell_of[thread] = packed_cell;
    side_of[thread] = side;
    found_of[thread] = fetch_face_reflectance(face).a < LEAST_WEIGHT ? 63u : 0u;
    bool stands_alone = is_plain(record);
    bool is_open = stands_alone;  // nothing stands on the cell, nor on those beside it, where the surface goes on in them
    int axis_of_normal = dominant_axis(around.normal);
    int k = 0;
    do {
        FoundFace beside = face_beside(around, neighbour_step(k));
        bool is_there = beside.bit != NONE_INDEX && all(lessThan(abs(beside.cell - cell), ivec3(2)));
        bool goes_on = beside.cell[axis_of_normal] == cell[axis_of_normal] && is_plain(beside.record);
        bool is_clear = is_open && goes_on;
        bool may_be_clear = is_there && !is_clear && stands_alone && is_plain(beside.record);
        if (may_be_clear) {
            is_clear = is_plain_between(cell, beside.cell);
        }
        is_open = is_open && (k >= 4 || goes_on);
        if (is_there && !is_clear) {
            uvec2 ask = uvec2(thread | uint(k) << 8, face_number(beside));
            if (k < 4) {
                asked_along[atomicAdd(asked_along_count, 1u)] = ask;
            } else {
                asked_across[atomicAdd(asked_across_count, 1u)] = ask;
            }
        }
    } while (++k < 8);
}

// All threads of the group come here; what they have shared is there for the others.
void meet()
{
    memoryBarrierShared();
    barrier();
}

void main()
{
    uint thread = gl_LocalInvocationIndex;
    uint number = work_first + invocation_index();
    if (thread == 0u) {
        asked_along_count = asked_across_count = trace_along_count = trace_across_count = 0u;
    }
    meet();
    if (number < work_count) {
        list_asks(thread, number);
    }
    meet();
    for (uint i = thread; i < asked_along_count; i += uint(GROUP_SIZE)) {
        if (!is_told(asked_along[i])) {
            to_trace[atomicAdd(trace_along_count, 1u)] = asked_along[i];
        }
    }
    meet();
    for (uint i = thread; i < trace_along_count; i += uint(GROUP_SIZE)) {
        look_for(to_trace[i]);
    }
    meet();
    for (uint i = thread; i < asked_across_count; i += uint(GROUP_SIZE)) {
        if (!is_told(asked_across[i])) {
            to_trace[atomicAdd(trace_across_count, 1u)] = asked_across[i];
        }
    }
    meet();
    for (uint i = thread; i < trace_across_count; i += uint(GROUP_SIZE)) {
        look_for(to_trace[i]);
    }
    meet();
    uint index, side, axis;
    fetch_face_work(number < work_count ? number % (work_count / 2u) : 0u, index, side, axis);
    uint found = found_of[thread] << 6u * side;
    if (number < work_count && found != 0u) {
        atomicOr(hidden[index], found);
    }
}
