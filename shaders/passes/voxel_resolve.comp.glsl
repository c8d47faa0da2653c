// SPDX-License-Identifier: GPL-3.0-or-later
// From parts to faces: sums and means, and the point of the surface that each face stands for. One thread for each axis
// that a cell has faces on. Sums are integers: the order of a cell's list cannot show.
// IS_CROWDED: of a crowded cell, whose parts are summed up already (lib/crowd.glsl).
// IS_PLAIN: of cells that are not cut and list few triangles, MASKED at most: nearly all are such. 0: of the others.
// Input: parts and triangles of cells, cells with their positions. HAS_SHADING_NORMALS: meshes' corners.
// Output: place_img, reflectance_img and, where there are some, shading_img of the faces.

#include "lib/clipped.glsl"
#include "lib/cut.glsl"
#include "lib/face.glsl"
#include "lib/face_work.glsl"
#include "lib/part.glsl"
#include "lib/crowd.glsl"
#if HAS_SHADING_NORMALS
#include "lib/shading_normal.glsl"
#endif

layout(local_size_x = GROUP_SIZE) in;

SOURCE_2D(TEX_CELL_POSITIONS, SOURCE_CELL_POSITIONS, r32ui) cell_positions_tex;
SOURCE_2D(TEX_PARTS, SOURCE_PARTS, rgba32ui) parts_tex;
layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D place_img;
layout(binding = IMG_1, rgba16) writeonly uniform image2D reflectance_img;
#if HAS_SHADING_NORMALS
layout(binding = IMG_2, r32ui) writeonly uniform uimage2D shading_img;
#endif

uniform uint work_count;
uniform uint line_block;     // cells on a side of the blocks in which all lines are alike

// Triangles of a list, from its first on, of which a mask says whether they face along an axis.
#if IS_CROWDED
const uint MASKED = 0u;
#else
const uint MASKED = PLAIN_LIST;
#endif

struct Face {
    vec3 position;
    vec3 normal;
    vec4 reflectance;  // a: as stored
#if HAS_SHADING_NORMALS
    vec3 shading_normal;
#endif
};

#if IS_CROWDED
void sum_parts(uvec4 record, uint axis, out FacingSums plus, out FacingSums minus, out uint facing_mask)
{
    facing_mask = 0u;  // not asked for
    plus = crowd_facing(2u * axis);
    minus = crowd_facing(2u * axis + 1u);
}
#else
// Add a part where `mask` is all ones, nothing where it is 0.
void add_part(inout FacingSums sums, Part part, uint mask)
{
    sums.area += part.area & mask;
    sums.reflectance += part.reflectance & mask;
    sums.position += part.position & mask;
}

// What the surfaces of a cell bring to the two facings of an axis, and which of its first triangles face along that.
void sum_parts(uvec4 record, uint axis, out FacingSums plus, out FacingSums minus, out uint facing_mask)
{
    plus = NO_SUMS;
    minus = NO_SUMS;
    facing_mask = 0u;
    uint k = record.x;
    do {
        Part part = unpack_part(fetch_source(parts_tex, list_texel(k)));
        facing_mask |= part.facing >> 1 == axis && k < record.x + MASKED ? 1u << (k - record.x) : 0u;
        uint to_plus = part.facing == 2u * axis ? 0xFFFFFFFFu : 0u;
        uint to_minus = part.facing == 2u * axis + 1u ? 0xFFFFFFFFu : 0u;
        add_part(plus, part, to_plus);
        add_part(minus, part, to_minus);
    } while (++k < record.x + record.y);
}
#endif

// What the surfaces that face this way bring; of no use when there are none.
Face mean_face(FacingSums sums, uint facing, vec3 corner)
{
    Face result;
    float total = float(sums.area);
    float inverse = 1.0 / total;
    result.reflectance.rgb = vec3(sums.reflectance) * inverse;
    result.reflectance.a = sqrt(min(total / (FIXED_ONE * MAX_FACE_WEIGHT), 1.0));
    result.position = corner + vec3(sums.position) * inverse;
    result.normal = facing_vector(facing);
    return result;
}

// The surface of a cell that is outermost along a line; surfaces that face the other way count where there are no others.
struct Outermost {
    bool faces_away;
    float height;     // above where the line starts
    uint triangle;    // NONE_INDEX: the line meets nothing
    uint entry;       // of the cell's list
};

void consider(inout Outermost outermost, bool is_met, bool faces_away, float height, uint triangle, uint entry)
{
    // Equal heights go to the lower index: the order of the cell's list must not show.
    bool is_higher = height > outermost.height || (height == outermost.height && triangle < outermost.triangle);
    if (is_met && (faces_away == outermost.faces_away ? is_higher : outermost.faces_away)) {
        outermost = Outermost(faces_away, height, triangle, entry);
    }
}

// Where surfaces of a side of a cell lie that is cut aslant: above a plane, or two; else everywhere.
struct Beyond {
    bool is_asked;
    CutPlane plane;
    bool is_corner;
    CutPlane second;
};

// Over the two planes; above where none is.
vec2 heights_in(Beyond beyond, vec3 place)
{
    return vec2(beyond.is_asked ? height_above(beyond.plane, place) : 1.0,
                beyond.is_asked && beyond.is_corner ? height_above(beyond.second, place) : 1.0);
}

// Whether the line through `start` along `direction` meets a triangle inside a box, beyond a plane, and where along it.
bool meets(vec3 start, vec3 direction, Triangle t, vec3 low, vec3 high, Beyond beyond, out float distance)
{
    vec2 barycentric;
    bool crosses = intersect_plane(t, start, direction, barycentric, distance);
    vec3 at = start + direction * distance;
    vec3 n = normalize(cross(t.edge_1, t.edge_2));
    bool is_there = all(greaterThan(heights_in(beyond, at + n * CUT_LIFT), vec2(0.0)));
    return crosses && is_there && min(barycentric.x, barycentric.y) >= 0.0 &&
           barycentric.x + barycentric.y <= 1.0 && all(greaterThan(at, low - 1e-3)) && all(lessThan(at, high + 1e-3));
}

#if HAS_SHADING_NORMALS
// Of triangle `index` at the face's place: the mean over its part of the cell, where that is all there is.
vec3 shading_normal(Face face, uint index, int level)
{
    Triangle t = in_level(fetch_triangle(index), level);
    Instance instance = fetch_instance(instances_tex, t.instance);
    vec2 barycentric;
    float distance;
    intersect_plane(t, face.position, face.normal, barycentric, distance);
    uvec3 corner = texelFetch(corners_tex, list_texel(t.mesh_triangle), 0).xyz;
    vec3 n = world_normal(instance, interpolated_normal(instance, corner, barycentric));
    bool is_front = (dot(cross(t.edge_1, t.edge_2), face.normal) > 0.0) == (instance.mirrored == 0u);
    n = is_front ? n : -n;
    return is_finite(n) && dot(n, face.normal) < FLAT_COSINE ? n : face.normal;
}
#endif

void move_to(inout Face face, vec3 start, Outermost outermost, bool is_shared, int level)
{
    if (outermost.triangle != NONE_INDEX) {
        Triangle t = in_level(fetch_triangle(outermost.triangle), level);
        vec3 n = normalize(cross(t.edge_1, t.edge_2));
        face.position = start + face.normal * outermost.height;
        face.normal = dot(n, face.normal) < 0.0 ? -n : n;
        if (is_shared) {
            Part part = unpack_part(fetch_source(parts_tex, list_texel(outermost.entry)));
            face.reflectance.rgb = part.area == 0u ? face.reflectance.rgb : vec3(part.reflectance) / float(part.area);
        }
    }
#if HAS_SHADING_NORMALS
    face.shading_normal = face.normal;
    if (outermost.triangle != NONE_INDEX) {
        face.shading_normal = shading_normal(face, outermost.triangle, level);
    }
#endif
}

// The same surface seen from its other side.
Face turned_over(Face face)
{
    face.normal = -face.normal;
#if HAS_SHADING_NORMALS
    face.shading_normal = -face.shading_normal;
#endif
    return face;
}

bool lies_between(Outermost outermost, vec3 start, vec3 direction, vec3 low, vec3 high)
{
    vec3 at = start + direction * outermost.height;
    return outermost.triangle != NONE_INDEX && all(greaterThan(at, low - 1e-3)) && all(lessThan(at, high + 1e-3));
}

// Points spread evenly over cells: point k of block c of cells.
vec3 point_of_box(uvec3 c, uint k, vec3 low, vec3 high)
{
    // Powers of 1 / 1.2207, the root of x^4 = x + 1: Roberts 2018, "The Unreasonable Effectiveness of Quasirandom
    // Sequences".
    uvec3 point = c.x * uvec3(3518319155u, 2360945575u, 2882110345u) +
                  c.y * uvec3(2882110345u, 3518319155u, 2360945575u) +
                  c.z * uvec3(2360945575u, 2882110345u, 3518319155u) +
                  k * uvec3(2654435769u, 1640531527u, 2024323829u);
    return mix(low, high, vec3(unit_float(point.x), unit_float(point.y), unit_float(point.z)));
}

// The way of all lines along an axis between two points, low and high, through a cell's list.
ListWalk begin_lines(uvec4 record, vec3 low, vec3 high, vec3 corner, int axis)
{
    vec3 along = mix(vec3(0.0), vec3(1.0), equal(ivec3(axis), ivec3(0, 1, 2)));
    vec3 inverse = 1.0 / max(along, 1e-12);
    vec3 middle = 0.5 * (low + high) - 2.0 * along;  // before all that the cell holds
    vec3 slack = list_slack(middle) + 0.5 * (high - low);
    return begin_list(record, middle - corner, inverse, slack);
}

// The next triangle of a list, from `entry` on, that may face along the axis: one that is not masked may face elsewhere.
uint next_facing(uint entry, uint first, uint facing_mask)
{
    uint place = entry - first;
    uint left = place < MASKED ? facing_mask >> place : 1u;
    return left == 0u ? first + MASKED : entry + uint(findLSB(left));
}

// Whether it does. Its part says so: a normal between two axes would be told to be nearest to either, as it is rounded.
bool faces_along(uint entry, uint first, int axis)
{
    bool faces = true;
#if !IS_PLAIN
    if (entry - first >= MASKED) {
        faces = int(unpack_part(fetch_source(parts_tex, list_texel(entry))).facing >> 1) == axis;
    }
#endif
    return faces;
}

const Outermost NOTHING = Outermost(true, -1e30, NONE_INDEX, 0u);
// Lines tried in cells where both sides have faces along them; none for a wall that a cell is cut along: other surfaces
// stand on it and hide a part, hardly ever its middle.
const uint SHARED_LINES = 2u;
// Share of a box's side: less is rounding.
const float LEAST_PART = 1e-6;
// Places that are looked through for a surface: a side of a cell, and where it has none, the whole of it.
const int LOOKS = IS_PLAIN != 0 ? 1 : 2;
// Triangles of a list that are clipped one after the other.
const uint MOST_CLIPPED = 1024u;

// A face stands for a point where a line along its axis meets its outermost surface: the mean of curved or layered
// surfaces lies inside them. Lines of neighbouring blocks of cells are spread evenly, so that edges of shadows are where
// they are, on average over cells. What another side's surface covers is not outermost.
void find_surfaces(inout Face plus, inout Face minus, uvec4 record, int axis, ivec3 cell, int level, vec3 corner,
                   vec3 low, vec3 high, bool is_shared, bool has_plus, bool has_minus, Beyond beyond, uint facing_mask)
{
    vec3 direction = plus.normal;
    vec3 column_low = mix(low, corner, abs(direction));
    vec3 column_high = mix(high, corner + 1.0, abs(direction));
    Outermost above = NOTHING, below = NOTHING;
    vec3 plus_start = vec3(0.0), minus_start = vec3(0.0);
    bool is_wall = IS_PLAIN == 0 && (beyond.is_asked ? beyond.plane.axis == axis : cut_axis(record) == axis);
    uint lines = is_shared ? SHARED_LINES : (is_wall ? 0u : 1u);
    uint line = 0u;
    if (lines > 0u) do {
        vec3 start = point_of_box(uvec3(cell) / line_block, line, low, high);
        Outermost top = NOTHING, bottom = NOTHING;
        ListWalk walk = begin_lines(record, start, start, corner, axis);
        do {
            next_run(walk, 1e30);
            walk.next = next_facing(walk.next, record.x, facing_mask);
            if (walk.next < walk.end) do {
                uvec2 entry = fetch_source(cell_triangles_tex, list_texel(walk.next)).rg;
                uint index = triangle_number(entry);
                Triangle t = in_level(fetch_listed(entry), level);
                vec3 n = cross(t.edge_1, t.edge_2);
                float distance;
                bool met = faces_along(walk.next, record.x, axis) &&
                           meets(start, direction, t, column_low, column_high, beyond, distance);
                consider(top, met, n[axis] < 0.0, distance, index, walk.next);
                consider(bottom, met, n[axis] > 0.0, -distance, index, walk.next);
                walk.next = next_facing(walk.next + 1u, record.x, facing_mask);
            } while (walk.next < walk.end);
        } while (has_runs(walk));
        if (lies_between(top, start, direction, low, high) && above.faces_away &&
            (above.triangle == NONE_INDEX || !top.faces_away)) {
            above = top;
            plus_start = start;
        }
        if (lies_between(bottom, start, -direction, low, high) && below.faces_away &&
            (below.triangle == NONE_INDEX || !bottom.faces_away)) {
            below = bottom;
            minus_start = start;
        }
    } while (++line < lines);
    // What the lines met of other surfaces' backs does not stand for those that face this way.
    if (above.faces_away && has_plus) {
        above = NOTHING;
    }
    if (below.faces_away && has_minus) {
        below = NOTHING;
    }
    // Where the lines miss, one through the middle of what is largest there, or else in the cell; in long lists, which
    // would take long, through the mean, or on a side, which has no mean of its own, another.
    vec3 another = point_of_box(uvec3(cell) / line_block, SHARED_LINES, low, high);
    bool lacks_plus = false, lacks_minus = false;  // there is so little of it that it was rounded away
    int look = 0;
    do {
        bool misses_plus = above.triangle == NONE_INDEX, misses_minus = below.triangle == NONE_INDEX;
        uvec4 walked = record;
        walked.y = misses_plus || misses_minus ? record.y : 0u;
        vec3 box_low = look == 0 ? low : corner;
        vec3 size = max((look == 0 ? high : corner + 1.0) - box_low, 1e-6);
        beyond.is_asked = beyond.is_asked && look == 0;
        Outermost largest_plus = NOTHING, largest_minus = NOTHING;
        bool has_mean = !is_shared || record.y <= MOST_CLIPPED;
        plus_start = !misses_plus ? plus_start : (has_mean ? plus.position : another);
        minus_start = !misses_minus ? minus_start : (has_mean ? minus.position : another);
        uint end = record.x + (walked.y <= MOST_CLIPPED ? walked.y : 0u);
        uint k = next_facing(record.x, record.x, facing_mask);
        if (k < end) do {
            uvec2 entry = fetch_source(cell_triangles_tex, list_texel(k)).rg;
            uint index = triangle_number(entry);
            Triangle t = in_level(fetch_listed(entry), level);
            vec3 n = cross(t.edge_1, t.edge_2);
            vec3 a = turn((t.corner - box_low) / size, axis);
            vec3 b = a + turn(t.edge_1 / size, axis), c = a + turn(t.edge_2 / size, axis);
            vec3 lifted = t.corner + normalize(n) * CUT_LIFT;
            vec2 at_a = heights_in(beyond, lifted), at_b = heights_in(beyond, lifted + t.edge_1);
            vec2 at_c = heights_in(beyond, lifted + t.edge_2);
            vec3 sums = overlap(a, b, c);
            sums = overlap_above_both(a, b, c, vec3(at_a.x, at_b.x, at_c.x), vec3(at_a.y, at_b.y, at_c.y), sums);
            vec3 middle = box_low + size * turn_back(vec3(clamp(sums.yz / sums.x, 0.0, 1.0), 0.0), axis);
            bool is_there = faces_along(k, record.x, axis) && abs(sums.x) > LEAST_PART;
            consider(largest_plus, is_there, n[axis] < 0.0, abs(sums.x), index, k);
            consider(largest_minus, is_there, n[axis] > 0.0, abs(sums.x), index, k);
            plus_start = misses_plus && largest_plus.triangle == index ? middle : plus_start;
            minus_start = misses_minus && largest_minus.triangle == index ? middle : minus_start;
            k = next_facing(k + 1u, record.x, facing_mask);
        } while (k < end);
        lacks_plus = misses_plus && record.y <= MOST_CLIPPED && largest_plus.triangle == NONE_INDEX;
        lacks_minus = misses_minus && record.y <= MOST_CLIPPED && largest_minus.triangle == NONE_INDEX;
        // One walk for all lines between the two.
        vec3 one = misses_plus ? plus_start : minus_start, other = misses_minus ? minus_start : plus_start;
        ListWalk walk = begin_lines(walked, min(one, other), max(one, other), corner, axis);
        do {
            next_run(walk, 1e30);
            walk.next = next_facing(walk.next, record.x, facing_mask);
            if (walk.next < walk.end) do {
                uvec2 entry = fetch_source(cell_triangles_tex, list_texel(walk.next)).rg;
                uint index = triangle_number(entry);
                Triangle t = in_level(fetch_listed(entry), level);
                vec3 n = cross(t.edge_1, t.edge_2);
                bool is_ours = faces_along(walk.next, record.x, axis);
                float distance;
                bool met = is_ours && misses_plus && meets(plus_start, direction, t, box_low, box_low + size, beyond, distance);
                consider(above, met, n[axis] < 0.0, distance, index, walk.next);
                met = is_ours && misses_minus && meets(minus_start, direction, t, box_low, box_low + size, beyond, distance);
                consider(below, met, n[axis] > 0.0, -distance, index, walk.next);
                walk.next = next_facing(walk.next + 1u, record.x, facing_mask);
            } while (walk.next < walk.end);
        } while (has_runs(walk));
    } while (++look < LOOKS);
    plus.reflectance.rgb = lacks_plus && above.triangle == NONE_INDEX ? vec3(0.0) : plus.reflectance.rgb;
    minus.reflectance.rgb = lacks_minus && below.triangle == NONE_INDEX ? vec3(0.0) : minus.reflectance.rgb;
    move_to(plus, plus_start, above, is_shared, level);
    move_to(minus, minus_start, below, is_shared, level);
}

// `level`: whose cells its position is in.
void store(uint index, Face face, int level)
{
    face.position *= level_side(level);
#if HAS_SHADING_NORMALS
    imageStore(shading_img, list_texel(index), uvec4(packSnorm2x16(octahedral_encode(face.shading_normal))));
#endif
    imageStore(place_img, list_texel(index), pack_face_place(face.position, face.normal));
    imageStore(reflectance_img, list_texel(index), face.reflectance);
}

// Where a side of a cell lies that is cut aslant: above the cut's plane, or the other side of the wall, if that is further on,
// and, of what faces neither wall of two, on the same side of the second as the side's faces.
Beyond beyond_of(uvec4 record, uint side, uint facing, int level, vec3 corner)
{
    CutPlane plane = listed_plane(cut_entry(record), level);
    uint outward = uint(2 * plane.axis) + (side == 1u ? 0u : 1u);
    uint area = 0u, largest = cut_entry(record);
    uvec2 listed = uvec2(0u);
    uint k = record.x;
    do {
        Part part = unpack_part(fetch_source(parts_tex, list_texel(k)));
        uvec2 at = fetch_source(cell_triangles_tex, list_texel(k)).rg;
        bool is_larger = part.area > area || (part.area == area && area > 0u && comes_before(at, listed));
        is_larger = is_larger && part.facing == outward;
        area = is_larger ? part.area : area;
        largest = is_larger ? k : largest;
        listed = is_larger ? at : listed;
    } while (++k < record.x + record.y);
    CutPlane other = listed_plane(largest, level), second = plane;
    float sign = side == 1u ? 1.0 : -1.0;
    bool is_further = sign * (height_above(plane, corner + 0.5) - height_above(other, corner + 0.5)) > 0.0;
    bool is_limited = is_corner(record) && int(facing) != plane.axis;
    plane.place = is_further ? other.place : plane.place;
    plane.normal = sign * (is_further ? other.normal : plane.normal);
    if (is_limited) {
        second = listed_plane(second_cut_entry(record), level);
        second.normal *= lies_beyond_second(record, side == 1u) ? 1.0 : -1.0;
        is_limited = int(facing) != second.axis;
    }
    return Beyond(true, plane, is_limited, second);
}

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    uint index, side, axis;
    fetch_face_work(number, index, side, axis);
    uvec4 record = fetch_source(cells_tex, list_texel(index));
    uint first = face_index(record, 6u * side + 2u * axis);

    ivec3 cell = unpack_cell(fetch_source(cell_positions_tex, list_texel(index)).r);
    int level = level_of_cell(cell);
    vec3 corner = vec3(from_stack(cell, level));
    vec3 low = corner, high = corner + 1.0;
    int cut = IS_PLAIN != 0 || is_aslant(record) ? -1 : cut_axis(record);
    bool is_shared = IS_PLAIN == 0 && (record.w >> (6u * (1u - side) + 2u * axis) & 1u) != 0u;
    const CutPlane none = CutPlane(vec3(0.0), vec3(0.0), 0);
    Beyond beyond = Beyond(false, none, false, none);
    if (is_aslant(record)) {
        beyond = beyond_of(record, side, axis, level, corner);
    }
    if (cut >= 0 && (is_shared || cut != int(axis))) {  // a wall may lie aslant to the plane that is to be it
        float place = corner[cut] + cut_place(record);
        low[cut] = side == 1u ? place : low[cut];
        high[cut] = side == 0u ? place : high[cut];
    }
    FacingSums plus = NO_SUMS, minus = NO_SUMS;
    uint facing_mask;
    if (is_shared && cut >= 0 && cut != int(axis)) {  // not inside the wall that the cell is cut along
        sum_parts(record, uint(cut), plus, minus, facing_mask);
    }
    if (side == 1u && plus.area > 0u) {
        low[cut] = max(low[cut], corner[cut] + float(plus.position[cut]) / float(plus.area));
    } else if (side == 0u && minus.area > 0u) {
        high[cut] = min(high[cut], corner[cut] + float(minus.position[cut]) / float(minus.area));
    }
    sum_parts(record, axis, plus, minus, facing_mask);
    if (plus.area == 0u && minus.area == 0u) {
        plus.area = 1u;  // so little of a surface that it was rounded away: black, at the cell's corner
    }
    Face front = mean_face(plus, 2u * axis, corner);
    Face back = mean_face(minus, 2u * axis + 1u, corner);
    find_surfaces(front, back, record, int(axis), cell, level, corner, low, high, is_shared, plus.area > 0u,
                  minus.area > 0u, beyond, facing_mask);
    // The side that nothing was made for is the back of a sheet: the same surface, turned over.
    if (plus.area == 0u) {
        front = turned_over(back);
    } else if (minus.area == 0u) {
        back = turned_over(front);
    }
    if (is_shared) {  // half of the area on each side
        front.reflectance.a *= sqrt(0.5);
        back.reflectance.a *= sqrt(0.5);
    }
    store(first, front, level);
    store(first + 1u, back, level);
}
