# SPDX-License-Identifier: GPL-3.0-or-later
"""Metal and dielectric balls, roughness 0.05 to 1, in a room with coloured walls under an area light."""

from __future__ import annotations

from typing import Any

from . import build

ROUGHNESS = (0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


def room(width: float = 6.0, depth: float = 4.0, height: float = 3.0) -> None:
    """Floor, ceiling, back, red left and green right wall, a lamp and a camera; the middle of the floor is 0."""
    w, d, h = width / 2, depth / 2, height
    white = build.diffuse("White", (0.7, 0.7, 0.7))
    blue = build.diffuse("Blue", (0.25, 0.35, 0.6))
    build.add_quad("Floor", [(-w, -d, 0), (w, -d, 0), (w, d, 0), (-w, d, 0)], white)
    build.add_quad("Ceiling", [(-w, d, h), (w, d, h), (w, -d, h), (-w, -d, h)], white)
    build.add_quad("Back", [(-w, d, 0), (w, d, 0), (w, d, h), (-w, d, h)], blue)
    build.add_quad("Left", [(-w, -d, 0), (-w, d, 0), (-w, d, h), (-w, -d, h)], build.diffuse("Red", (0.6, 0.08, 0.06)))
    build.add_quad("Right", [(w, d, 0), (w, -d, 0), (w, -d, h), (w, d, h)], build.diffuse("Green", (0.1, 0.45, 0.1)))
    build.add_light("AREA", (0, 0, height - 0.02), (0, 0, 0), energy=200.0, shape="RECTANGLE", size=1.5, size_y=1.0)
    build.add_camera((0, -9, 1.5), (0, 0, 1.25), lens=46.0)


def scene() -> Any:
    result = build.empty_scene()
    room()
    for i, roughness in enumerate(ROUGHNESS):
        x = 0.95 * (i - 2.5)
        metal = build.principled(f"Metal {roughness}", Base_Color=(0.9, 0.65, 0.35), Metallic=1.0, Roughness=roughness)
        plastic = build.principled(f"Plastic {roughness}", Base_Color=(0.5, 0.12, 0.3), Roughness=roughness)
        build.add_sphere(metal.name, 0.42, (x, 0.3, 1.65), metal, segments=64)
        build.add_sphere(plastic.name, 0.42, (x, -0.3, 0.5), plastic, segments=64)
    return result
