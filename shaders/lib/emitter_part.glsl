// SPDX-License-Identifier: GPL-3.0-or-later
// Equal parts of a triangle: its edges are divided by n, which makes n^2. Row r along corner 2 has 2 (n - r) - 1 parts,
// every other one upside down.

// Part k in barycentric coordinates: one corner, and the edges that leave it.
void emitter_part(uint k, uint n, out vec2 corner, out vec2 edge_1, out vec2 edge_2)
{
    uint row = 0u;
    while (row + 1u < n && (row + 1u) * (2u * n - row - 1u) <= k) {
        ++row;
    }
    uint column = k - row * (2u * n - row);
    bool turned = (column & 1u) == 1u;
    float side = 1.0 / float(n);
    corner = vec2(float(column / 2u), float(row)) * side + (turned ? vec2(side) : vec2(0.0));
    edge_1 = vec2(turned ? -side : side, 0.0);
    edge_2 = vec2(0.0, turned ? -side : side);
}

// The part that a point of the triangle lies in.
uint emitter_part_at(vec2 barycentric, uint n)
{
    vec2 scaled = clamp(barycentric, 0.0, 1.0) * float(n);
    uint row = min(uint(scaled.y), n - 1u);
    uint column = min(uint(scaled.x), n - 1u - row);
    bool turned = scaled.x - float(column) + scaled.y - float(row) > 1.0 && column + row + 1u < n;
    return row * (2u * n - row) + 2u * column + (turned ? 1u : 0u);
}
