# SPDX-License-Identifier: GPL-3.0-or-later
"""Principled balls on a floor: metal of two roughnesses, glossy plastic, and one that glows; sun and sky."""

from __future__ import annotations

from typing import Any

from . import build


def scene() -> Any:
    result = build.empty_scene()
    build.add_plane("Floor", 8.0, build.diffuse("Floor", (0.4, 0.4, 0.4)))
    materials = (
        build.principled("Rough Gold", Base_Color=(1.0, 0.77, 0.34), Metallic=1.0, Roughness=0.45),
        build.principled("Smooth Steel", Base_Color=(0.7, 0.7, 0.72), Metallic=1.0, Roughness=0.15),
        build.principled("Red Plastic", Base_Color=(0.6, 0.05, 0.05), Roughness=0.35),
        build.principled("Glow", Base_Color=(0.1, 0.1, 0.1), Emission_Color=(0.2, 0.6, 1.0), Emission_Strength=2.0),
    )
    for i, material in enumerate(materials):
        build.add_sphere(material.name, 0.75, (1.8 * (i - 1.5), 0, 0.75), material, segments=48)
    build.add_light("SUN", (2, -2, 4), energy=2.0, angle=0.2)
    build.set_world((0.5, 0.6, 0.8))
    build.add_camera((0, -9, 3), (0, 0, 0.6), lens=40.0)
    return result
