// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles of one mesh's instances, in clip space.

uniform mat4 clip_from_grid;

in vec3 position_os;
in vec4 grid_from_object_x;
in vec4 grid_from_object_y;
in vec4 grid_from_object_z;
in uint first_triangle;

flat out uint instance_first_triangle;

void main()
{
    vec4 p = vec4(position_os, 1.0);
    vec3 position_grid = vec3(dot(grid_from_object_x, p), dot(grid_from_object_y, p), dot(grid_from_object_z, p));
    gl_Position = clip_from_grid * vec4(position_grid, 1.0);
    instance_first_triangle = first_triangle;
}
