# SPDX-License-Identifier: GPL-3.0-or-later
"""Metal and dielectric spheres, from nearly smooth to rough, between coloured walls."""

from __future__ import annotations

from pathlib import Path

from blender_tests.scenes.make_usd import add_material

from . import stage as parts
from .stage import GREEN, RED, WHITE

ROUGHNESS = (0.05, 0.15, 0.3, 0.5, 0.75, 1.0)
RADIUS = 0.27


def spheres(path: Path) -> None:
    """Two rows: gold above, red plastic below; a red wall left, a green one right, an area light above."""
    stage = parts.new_stage(path)
    white = parts.matte(stage, "White", WHITE)
    w, d, h = 2.1, 1.6, 2.4  # half width, depth behind the spheres, height
    parts.add_quad(stage, "Floor", [(-w, -d, 0), (w, -d, 0), (w, d, 0), (-w, d, 0)], white)
    parts.add_quad(stage, "Back", [(-w, d, 0), (w, d, 0), (w, d, h), (-w, d, h)], white)
    parts.add_quad(stage, "Left", [(-w, -d, 0), (-w, d, 0), (-w, d, h), (-w, -d, h)], parts.matte(stage, "Red", RED))
    parts.add_quad(stage, "Right", [(w, d, 0), (w, -d, 0), (w, -d, h), (w, d, h)], parts.matte(stage, "Green", GREEN))
    rows = (("Plastic", (0.15, 0.25, 0.6), 0.0, 0.35), ("Gold", (1.0, 0.77, 0.34), 1.0, 1.25))
    for name, color, metallic, z in rows:
        for i, roughness in enumerate(ROUGHNESS):
            material = add_material(
                stage, f"{name}_{i}", diffuseColor=color, metallic=metallic, roughness=roughness, ior=1.5
            )
            parts.add_sphere(stage, f"{name}_Sphere_{i}", (0.66 * (i - 2.5), 0.0, z), RADIUS, material)
    parts.add_area_light(stage, (0.0, -0.6, 2.9), (0.0, 0.2, 0.6), (1.6, 1.0), 12.0)
    parts.add_sky(stage, (0.15, 0.17, 0.2))
    parts.add_camera(stage, (0.0, -5.2, 1.3), (0.0, 0.0, 0.9), lens=42.0)
    stage.Save()
