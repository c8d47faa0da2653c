// SPDX-License-Identifier: GPL-3.0-or-later
// Sites: surface points where visibility is traced, each for the one or more faces of its cell that lie on one surface.

#include "lib/trace.glsl"
#include "lib/face.glsl"

uniform uint thread_first;
uniform uint cell_count;

struct Site {
    uint face;      // whose place it is; NONE_INDEX: this thread has no site
    vec3 origin;    // where its rays start, grid space
    vec3 normal;
};

// The site that this thread works on, when there is one thread for each facing of each cell.
Site site_of_thread()
{
    Site site = Site(NONE_INDEX, vec3(0.0), vec3(0.0));
    uint thread = thread_first + invocation_index();
    uint facing = facing_of_thread(thread, cell_count);
    uvec4 record = texelFetch(cells_tex, list_texel(cell_of_thread(thread, cell_count)), 0);
    if (has_facing(record, facing) && site_facing(record, facing) == facing) {
        vec3 position;
        site.face = face_index(record, facing);
        fetch_face_place(site.face, position, site.normal);
        site.origin = position + site.normal * RAY_START;
    }
    return site;
}
