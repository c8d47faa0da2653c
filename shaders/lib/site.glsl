// SPDX-License-Identifier: GPL-3.0-or-later
// Sites: surface points where visibility is traced, one for each voxel face. Threads take them in an order in which
// neighbours are alike: facing by facing.
//
// The including program may define
//     HAS_SHADING_NORMALS  1: light is received as by a surface with another normal than the triangle's

#include "lib/trace.glsl"
#include "lib/face.glsl"

layout(binding = TEX_FACE_ORDER) uniform usampler2D face_order_tex;
#if HAS_SHADING_NORMALS
layout(binding = TEX_FACE_SHADING) uniform usampler2D face_shading_tex;
#endif

uniform uint site_first;  // of this dispatch
uniform uint face_count;  // of all

const uint FACE_MASK = (1u << FACING_SHIFT) - 1u;

struct Site {
    uint face;      // NONE_INDEX: this thread has no site
    uint facing;
    uint seed;      // of random numbers
    vec3 position;  // grid space
    vec3 origin;    // where its rays start
    vec3 normal;    // geometric: no light comes from behind it
    vec3 shading_normal;  // of the cosine of light that is received
};

Site site_of_thread()
{
    Site site = Site(NONE_INDEX, 0u, 0u, vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    uint index = site_first + invocation_index();
    if (index < face_count) {
        uint ordered = texelFetch(face_order_tex, list_texel(index), 0).r;
        site.face = ordered & FACE_MASK;
        site.facing = ordered >> FACING_SHIFT;
        site.seed = face_seed(site.face);
        fetch_face_place(site.face, site.position, site.normal);
        site.origin = site.position + site.normal * ray_start(site.position);
        site.shading_normal = site.normal;
#if HAS_SHADING_NORMALS
        site.shading_normal = octahedral_decode(unpackSnorm2x16(texelFetch(face_shading_tex, list_texel(site.face), 0).r));
#endif
    }
    return site;
}

// Whether a direction that is above the shading normal's horizon is above the surface's.
bool leaves_surface(Site site, vec3 direction)
{
#if HAS_SHADING_NORMALS
    return dot(site.normal, direction) > 0.0;
#else
    return true;
#endif
}
