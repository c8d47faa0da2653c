# SPDX-License-Identifier: GPL-3.0-or-later
"""Glass: clear, tinted and rough balls, a pane and a block in a room, by Principled, Glass and Refraction nodes."""

from __future__ import annotations

from typing import Any

from . import build
from .gloss_room import room


def glass(name: str, kind: str = "BsdfGlass", **inputs: Any) -> Any:
    material, tree, surface = build.bare_material(name)
    tree.links.new(build.new_node(tree, kind, **inputs).outputs[0], surface)
    return material


def scene() -> Any:
    result = build.empty_scene()
    room()
    balls = (
        build.principled("Clear", Base_Color=(1.0, 1.0, 1.0), Transmission_Weight=1.0, Roughness=0.0, IOR=1.5),
        glass("Tinted", Color=(0.6, 0.9, 0.7), Roughness=0.0, IOR=1.33),
        build.principled("Rough", Base_Color=(1.0, 0.9, 0.8), Transmission_Weight=1.0, Roughness=0.3, IOR=1.5),
        glass("Rougher", Color=(0.9, 0.9, 1.0), Roughness=0.6, IOR=1.5),
        glass("Refraction", "BsdfRefraction", Color=(0.9, 0.9, 0.9), Roughness=0.1, IOR=1.4),
    )
    for i, material in enumerate(balls):
        build.add_sphere(material.name, 0.48, (1.1 * (i - 2), 0.2, 0.5), material, segments=64)
    build.add_box("Pane", (2.2, 0.05, 1.0), (-1.3, 0.6, 2.0), 0.2, balls[0])
    build.add_box("Block", (0.8, 0.8, 0.8), (1.4, 0.5, 1.9), 0.5, balls[1])
    return result
