// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles of one mesh's instances, in clip space.

uniform mat4 clip_from_grid;
uniform vec3 camera_position;  // grid space
uniform vec3 camera_forward;   // unit
uniform vec2 depth_range;      // of the scene along forward, cells

in vec3 position_os;
in vec4 grid_from_object_x;
in vec4 grid_from_object_y;
in vec4 grid_from_object_z;
in uint first_triangle;

flat out uint instance_first_triangle;
out float linear_depth;

void main()
{
    vec4 p = vec4(position_os, 1.0);
    vec3 position_grid = vec3(dot(grid_from_object_x, p), dot(grid_from_object_y, p), dot(grid_from_object_z, p));
    gl_Position = clip_from_grid * vec4(position_grid, 1.0);
    instance_first_triangle = first_triangle;
    linear_depth = (dot(position_grid - camera_position, camera_forward) - depth_range.x) / (depth_range.y - depth_range.x);
}
