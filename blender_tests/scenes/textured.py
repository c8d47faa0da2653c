# SPDX-License-Identifier: GPL-3.0-or-later
"""A quad with a packed image, sRGB, beside one with the same image repeated and turned by a Mapping node."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import build


def checker_pixels(size: int = 32, cells: int = 4) -> Any:
    """(size, size, 4) in 0..1: a checker of colours whose red grows to the right and green upwards, one blue corner."""
    y, x = np.mgrid[0:size, 0:size]
    odd = (x * cells // size + y * cells // size) % 2
    pixels = np.ones((size, size, 4), np.float32)
    pixels[..., 0] = np.where(odd, (x + 0.5) / size, 0.9)
    pixels[..., 1] = np.where(odd, (y + 0.5) / size, 0.9)
    pixels[..., 2] = np.where(odd, 0.1, 0.9)
    corner = size // cells
    pixels[:corner, :corner, :3] = (0.05, 0.1, 0.9)
    return pixels


def scene() -> Any:
    result = build.empty_scene()
    image = build.packed_image("Checker", checker_pixels())

    plain, tree, surface = build.bare_material("Plain")
    bsdf = build.new_node(tree, "BsdfDiffuse")
    tree.links.new(build.image_node(tree, image, "Closest").outputs["Color"], bsdf.inputs["Color"])
    tree.links.new(bsdf.outputs[0], surface)

    turned, tree, surface = build.bare_material("Turned")
    bsdf = build.new_node(tree, "BsdfPrincipled", Roughness=1.0, Specular_IOR_Level=0.0)
    texture = build.image_node(tree, image)
    mapping = build.new_node(tree, "Mapping", Scale=(2.0, 2.0, 1.0), Rotation=(0.0, 0.0, 0.5))
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], bsdf.inputs["Base Color"])
    tree.links.new(bsdf.outputs[0], surface)

    build.add_quad("Left", [(-2.1, 0, 0), (-0.1, 0, 0), (-0.1, 0, 2), (-2.1, 0, 2)], plain)
    build.add_quad("Right", [(0.1, 0, 0), (2.1, 0, 0), (2.1, 0, 2), (0.1, 0, 2)], turned)
    build.add_plane("Floor", 5.0, build.diffuse("Floor", (0.7, 0.7, 0.7)), z=-0.05)
    build.add_light("SUN", (-1, -2, 2), energy=2.5, angle=0.05)
    build.set_world((0.3, 0.3, 0.35))
    build.add_camera((0, -6, 1.6), (0, 0, 0.9), lens=45.0)
    return result
