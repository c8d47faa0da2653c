# SPDX-License-Identifier: GPL-3.0-or-later
"""Cards that are partly transparent, before a wall: by a texture's alpha, and evenly by half; their shadows too."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import build


def ring_pixels(size: int = 32) -> Any:
    """(size, size, 4): green, opaque in a ring."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size - 0.5
    radius = np.hypot(x, y)
    pixels = np.zeros((size, size, 4), np.float32)
    pixels[..., :3] = (0.2, 0.7, 0.3)
    pixels[..., 3] = (radius > 0.2) & (radius < 0.45)
    return pixels


def scene() -> Any:
    result = build.empty_scene()
    leaf, tree, surface = build.bare_material("Leaf")
    bsdf = build.new_node(tree, "BsdfPrincipled", Roughness=1.0, Specular_IOR_Level=0.0)
    texture = build.image_node(tree, build.packed_image("Ring", ring_pixels()), "Closest")
    tree.links.new(texture.outputs["Color"], bsdf.inputs["Base Color"])
    tree.links.new(texture.outputs["Alpha"], bsdf.inputs["Alpha"])
    tree.links.new(bsdf.outputs[0], surface)
    half = build.principled("Half", Base_Color=(0.8, 0.3, 0.2), Roughness=1.0, Specular_IOR_Level=0.0, Alpha=0.5)

    build.add_quad("Leaf", [(-1.6, 0, 0.2), (-0.2, 0, 0.2), (-0.2, 0, 1.6), (-1.6, 0, 1.6)], leaf)
    build.add_quad("Half", [(0.2, 0, 0.2), (1.6, 0, 0.2), (1.6, 0, 1.6), (0.2, 0, 1.6)], half)
    wall = build.diffuse("Wall", (0.8, 0.8, 0.8))
    build.add_quad("Wall", [(-2.5, 1, 0), (2.5, 1, 0), (2.5, 1, 3), (-2.5, 1, 3)], wall)
    build.add_quad("Floor", [(-2.5, -1, 0), (2.5, -1, 0), (2.5, 1, 0), (-2.5, 1, 0)], wall)
    build.add_light("SUN", (-0.5, -3, 2), energy=3.0, angle=0.01)
    build.set_world((0.3, 0.3, 0.3))
    build.add_camera((0, -6, 1.4), (0, 0, 0.95), lens=45.0)
    return result
