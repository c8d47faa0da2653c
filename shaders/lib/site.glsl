// SPDX-License-Identifier: GPL-3.0-or-later
// Sites: surface points where visibility is traced, one for each voxel face. Threads take them in an order in which
// neighbours are alike: facing by facing.

#include "lib/trace.glsl"
#include "lib/face.glsl"

layout(binding = TEX_FACE_ORDER) uniform usampler2D face_order_tex;

uniform uint site_first;  // of this dispatch
uniform uint face_count;  // of all

struct Site {
    uint face;      // NONE_INDEX: this thread has no site
    vec3 origin;    // where its rays start, grid space
    vec3 normal;
};

Site site_of_thread()
{
    Site site = Site(NONE_INDEX, vec3(0.0), vec3(0.0));
    uint index = site_first + invocation_index();
    if (index < face_count) {
        vec3 position;
        site.face = texelFetch(face_order_tex, list_texel(index), 0).r;
        fetch_face_place(site.face, position, site.normal);
        site.origin = position + site.normal * RAY_START;
    }
    return site;
}
