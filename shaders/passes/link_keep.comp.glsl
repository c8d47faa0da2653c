// SPDX-License-Identifier: GPL-3.0-or-later
// After an edit of the scene: links that stay, and a list of the faces whose links are to be traced again. A ray that
// crosses no box around what was edited, up to where it ended, ends there again, at the face that stands for that place.
// Input: faces, their numbers before and now, links and straight light before.
// Output: link_img, straight_img (HAS_STRAIGHT), changed_img.

#include "lib/link.glsl"
#include "lib/link_ray.glsl"
#include "lib/changed_faces.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_LINKS) uniform usampler2D links_before_tex;
layout(std430, binding = BUF_NUMBERS_NOW) readonly buffer NumbersNow { uint numbers_now[]; };  // shifts of runs, then numbers
layout(binding = IMG_0, rgba32ui) writeonly uniform uimage2D link_img;
#if HAS_STRAIGHT
layout(binding = TEX_STRAIGHT_BEFORE) uniform usampler2D straight_before_tex;
layout(binding = IMG_2, rg32ui) writeonly uniform uimage2D straight_img;
#endif

uniform uint link_count;  // a multiple of four
uniform uint random_seed;
uniform uint run_count;   // of faces before

// From where a ray ends to the place of the face that it was linked to, along each axis at most: a cell (lib/radiance.glsl)
// and a cell.
const float FARTHEST_PLACE = 2.1;

void main()
{
    Site site = site_of_thread();
    if (site.face == NONE_INDEX) {
        return;
    }
    uint before = number_before(site.face);
    bool has_changed = before == NONE_INDEX;
    bool may_cross = lies_above(site.origin, site.normal);
    uint seed = hash(site.seed, random_seed);
    uvec2 shift = link_shift(site.origin, site.normal, random_seed);
    uint quads = link_count / 4u;
    uint q = 0u;
    if (before != NONE_INDEX) do {
        uvec4 links = texelFetch(links_before_tex, list_texel(before * quads + q), 0);
        for (int k = 0; k < 4; ++k) {
            uint linked = linked_face(links[k]);
            uint asked = linked == NONE_INDEX ? 0u : linked;
            uint shift_of_run = numbers_now[asked / NUMBER_RUN];
            uint number = asked + shift_of_run;
            if (shift_of_run == NO_SHIFT) {
                number = numbers_now[run_count + asked];
            }
            number = linked == NONE_INDEX ? NONE_INDEX : number;
            has_changed = has_changed || (number == NONE_INDEX && linked != NONE_INDEX);
            links[k] = (links[k] & ~LINK_FACE_MASK) | (number & LINK_FACE_MASK);
        }
        imageStore(link_img, list_texel(site.face * quads + q), links);
        uint k = 0u;
        if (may_cross && !has_changed) do {
            vec3 direction;
            bool leaves = link_ray(site, 4u * q + k, shift, seed, direction);
            bool is_unsure = leaves && crosses_hull(site.origin, direction);
            uint number = linked_face(links[k]);
            // Of few; what an `if` fetches for threads that it leaves out would come from everywhere.
            uint place_of = is_unsure && number != NONE_INDEX ? number : 0u;
            vec3 place = uintBitsToFloat(texelFetch(face_place_tex, list_texel(place_of), 0).xyz);
            if (is_unsure) {
                // 2: diagonals of cubes, or the wider cells beside
                float farthest = (LEVELS > 0 ? 4.0 : 2.0) * FARTHEST_PLACE * cell_side(place);
                float limit = number == NONE_INDEX ? 1e30 : distance(place, site.origin) + farthest;
                has_changed = has_changed || crosses_box(site.origin, direction, limit, 0.0);
            }
        } while (++k < 4u);
    } while (++q < quads);
    if (has_changed) {
        list_changed(site.face, site.facing);
        return;
    }
#if HAS_STRAIGHT
    imageStore(straight_img, list_texel(site.face), texelFetch(straight_before_tex, list_texel(before), 0));
#endif
}
