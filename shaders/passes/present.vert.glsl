// SPDX-License-Identifier: GPL-3.0-or-later
// One triangle over the whole viewport.
// Output: uv, 0..1 over the viewport.

out vec2 uv;

void main()
{
    uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(2.0 * uv - 1.0, 0.0, 1.0);
}
