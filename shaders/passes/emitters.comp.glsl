// SPDX-License-Identifier: GPL-3.0-or-later
// What emitters are: the part of a triangle that each stands for, and what it emits to either side, seen straight on.
// Input: work items of one batch, triangles, materials.    Output: emitters, without what their powers decide.

#include "lib/geometry.glsl"
#include "lib/emitter_part.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Work { uvec4 work[]; };  // triangle, part, parts of an edge
layout(std430, binding = BUF_RESULTS) writeonly buffer Emitters { Emitter emitters[]; };

uniform uint work_count;

void main()
{
    uint number = invocation_index();
    if (number >= work_count) {
        return;
    }
    Triangle t = fetch_triangle(work[number].x);
    vec2 corner, edge_1, edge_2;
    emitter_part(work[number].y, work[number].z, corner, edge_1, edge_2);
    Emitter e;
    e.corner_grid = t.corner + t.edge_1 * corner.x + t.edge_2 * corner.y;
    e.edge_1 = t.edge_1 * edge_1.x;
    e.edge_2 = t.edge_2 * edge_2.y;
    e.flags = t.flags;
    vec3 area = cross(e.edge_1, e.edge_2);
    float size = length(area);
    vec3 normal = size > 0.0 ? area / size : vec3(0.0, 0.0, 1.0);
    vec2 centre = corner + (edge_1 + edge_2) / 3.0;
    Surface front = surface_at(t, shading_point(t, centre, normal, sqrt(0.5 * size)));
    Surface back = surface_at(t, shading_point(t, centre, -normal, sqrt(0.5 * size)));
    // As seen by the rays that do not pass through: their share is the opacity.
    vec2 opacity = 1.0 - clamp(vec2(luminance(front.transparency), luminance(back.transparency)), 0.0, 1.0);
    e.opacity = max(opacity.x, opacity.y);
    e.front = front.emission / max(e.opacity, 1e-3);
    e.back = back.emission / max(e.opacity, 1e-3);
    e.cumulative = e.density = e.pad = 0.0;
    emitters[number] = e;
}
