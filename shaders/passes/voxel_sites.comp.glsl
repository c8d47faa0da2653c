// SPDX-License-Identifier: GPL-3.0-or-later
// A surface that lies at an angle is in up to three facings of a cell, and the same light falls on all of them. Find
// these: of each group one facing is the site, where visibility is traced, and the others point to it.
// Input: faces' places.    Output: cell_img: bits 6 to 23 of w, three for each facing: facing of its site.

#include "lib/grid.glsl"
#include "lib/face.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = IMG_0, rgba32ui) uniform uimage2D cell_img;

uniform uint cell_count;

const float SAME_NORMAL = 0.95;    // cosine: 18 degrees
const float SAME_PLACE = 0.35;     // cells

void main()
{
    uint index = invocation_index();
    if (index >= cell_count) {
        return;
    }
    uvec4 record = imageLoad(cell_img, list_texel(index));
    uint sites = 0u;
    for (uint facing = 0u; facing < 6u; ++facing) {
        uint site = facing;
        if ((record.w >> facing & 1u) != 0u) {
            vec3 position, normal;
            fetch_face_place(face_index(record, facing), position, normal);
            for (uint other = 0u; other < facing; ++other) {
                bool is_site = (record.w >> other & 1u) != 0u && (sites >> (3u * other) & 7u) == other;
                if (is_site && site == facing) {
                    vec3 other_position, other_normal;
                    fetch_face_place(face_index(record, other), other_position, other_normal);
                    bool same = dot(normal, other_normal) > SAME_NORMAL &&
                                distance(position, other_position) < SAME_PLACE;
                    site = same ? other : site;
                }
            }
        }
        sites |= site << (3u * facing);
    }
    record.w = (record.w & 63u) | sites << 6;
    imageStore(cell_img, list_texel(index), record);
}
