// SPDX-License-Identifier: GPL-3.0-or-later
// Which triangle is seen: its number plus one.

flat in uint instance_first_triangle;
out uint seen;

void main()
{
    seen = instance_first_triangle + uint(gl_PrimitiveID) + 1u;
}
