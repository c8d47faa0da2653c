// SPDX-License-Identifier: GPL-3.0-or-later
// Sites: surface points where visibility is traced, each for the one or more faces of its cell that lie on one surface.

#include "lib/trace.glsl"
#include "lib/face.glsl"

layout(binding = TEX_SITES) uniform usampler2D sites_tex;

uniform uint site_first;  // of this dispatch
uniform uint site_count;  // of all

struct Site {
    uint face;      // whose place it is; NONE_INDEX: this thread has no site
    vec3 origin;    // where its rays start, grid space
    vec3 normal;
};

Site site_of_thread()
{
    Site site = Site(NONE_INDEX, vec3(0.0), vec3(0.0));
    uint index = site_first + invocation_index();
    if (index < site_count) {
        vec3 position;
        site.face = texelFetch(sites_tex, list_texel(index), 0).r;
        fetch_face_place(site.face, position, site.normal);
        site.origin = position + site.normal * RAY_START;
    }
    return site;
}
