// SPDX-License-Identifier: GPL-3.0-or-later
// Bricks in which an edit may have changed the shadows of lights: some ray between the brick and a light may cross a box
// around what was edited. All that lies between two bodies stays as near to the line between their centres as the larger
// of them reaches.
// Input: bricks, lights, boxes.    Output: reach_img: 1 for such bricks.

#include "lib/grid.glsl"
#include "lib/light.glsl"
#include "lib/changed_boxes.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = IMG_0, r8ui) writeonly uniform uimage3D reach_img;

uniform ivec3 brick_count;
uniform float farthest;  // from one place in the grid to another

const float HALF_BRICK = 0.5 * float(BRICK) + 0.1;  // places of faces lie on sides of cells, but for rounding
const float SPREAD = 1.5;  // from an area light's half side to its corner

void main()
{
    int index = int(invocation_index());
    if (index >= brick_count.x * brick_count.y * brick_count.z) {
        return;
    }
    ivec3 brick = ivec3(index % brick_count.x, index / brick_count.x % brick_count.y,
                        index / (brick_count.x * brick_count.y));
    uvec4 record = fetch_source(bricks_tex, brick);
    int level = level_of_cell(brick * BRICK);
    float side = level_side(level);
    vec3 centre = (vec3(from_stack(brick * BRICK, level)) + 0.5 * float(BRICK)) * side;
    float half_brick = HALF_BRICK * side;
    bool crosses = crosses_box(centre, vec3(0.0, 0.0, 1.0), 0.0, half_brick);  // where points of a face lie, for one
    uint end = (record.x | record.y) != 0u ? light_count : 0u;
    uint k = 0u;
    if (k < end) do {
        Light light = fetch_light(lights_tex, k);
        vec3 to_light = light.position_grid - centre;
        float reach = max(length(to_light), 1e-6);
        vec3 direction = to_light / reach;
        float margin = max(half_brick, SPREAD * light.radius_grid);
        if (light.kind == LIGHT_SUN) {
            direction = light.axis_z;
            reach = 1e30;
            margin = half_brick + 2.0 * light.radius_grid * farthest;
        }
        bool asks = (light.flags & LIGHT_CASTS_SHADOW) != 0u && (light.flags & RAY_DIFFUSE) != 0u;
        crosses = crosses || (asks && crosses_box(centre, direction, reach + margin, margin));
    } while (++k < end);
    imageStore(reach_img, brick, uvec4(crosses ? 1u : 0u));
}
