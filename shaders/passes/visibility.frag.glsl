// SPDX-License-Identifier: GPL-3.0-or-later
// Which triangle is seen: its number plus one. Depth is linear over the scene, so that clip planes, however far apart, cost
// no precision.

flat in uint instance_first_triangle;
in float linear_depth;
out uint seen;

void main()
{
    gl_FragDepth = clamp(linear_depth, 0.0, 1.0);
    seen = instance_first_triangle + uint(gl_PrimitiveID) + 1u;
}
