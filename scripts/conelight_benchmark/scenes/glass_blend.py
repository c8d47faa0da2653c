# SPDX-License-Identifier: GPL-3.0-or-later
"""Glass: a clear and a rough ball and a pane, before a chequered wall. USD's preview surface has no transmission."""

from __future__ import annotations

from typing import Any

from blender_tests.scenes import build, textured


def glass() -> Any:
    result = build.empty_scene()
    checker, tree, surface = build.bare_material("Checker")
    bsdf = build.new_node(tree, "BsdfDiffuse")
    image = build.image_node(tree, build.packed_image("Checker", textured.checker_pixels()), "Closest")
    tree.links.new(image.outputs["Color"], bsdf.inputs["Color"])
    tree.links.new(bsdf.outputs[0], surface)
    build.add_quad("Back", [(-2.5, 1.5, 0), (2.5, 1.5, 0), (2.5, 1.5, 2.6), (-2.5, 1.5, 2.6)], checker)
    build.add_plane("Floor", 6.0, build.diffuse("Floor", (0.6, 0.6, 0.6)))
    clear = build.principled("Clear", Base_Color=(1.0, 1.0, 1.0), Roughness=0.0, Transmission_Weight=1.0, IOR=1.45)
    rough = build.principled("Rough", Base_Color=(0.8, 0.95, 0.9), Roughness=0.3, Transmission_Weight=1.0, IOR=1.45)
    build.add_sphere("Clear Ball", 0.5, (-1.2, 0, 0.5), clear, segments=64)
    build.add_sphere("Rough Ball", 0.5, (0.0, 0, 0.5), rough, segments=64)
    build.add_box("Pane", (0.9, 0.04, 1.2), (1.2, 0, 0.6), turn=0.4, material=clear)
    build.add_light("AREA", (-1.0, -2.0, 3.5), (0, 0, 0.3), size=1.2, energy=120.0)
    build.set_world((0.4, 0.45, 0.5))
    build.add_camera((0, -6.0, 1.6), (0, 0, 0.7), lens=45.0)
    return result
