# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials and worlds at the ends of their ranges."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import bpy

from blender_tests.scenes import build

from . import stage
from .case import Case
from .shapes import ALL_ONE, SUN, crossing_boxes

#: Operations of the node Math whose results are not numbers.
UNDEFINED = (("DIVIDE", 1.0, 0.0), ("LOGARITHM", 0.0, 0.0), ("POWER", -2.0, 0.5))
#: Why checks do not hold.
MIRRORS = "voxels send light on as matte surfaces do: what mirrors throw on the floor is spread, and there are 8 layers"
WHITE_WORLD = "what reflects everything cannot be told from a world of 1"


def court_of(material: Any, world: float = 1.0, lamp: bool = False) -> None:
    """The court, all of one material."""
    stage.court(lamp=lamp, world=world)
    for thing in bpy.context.scene.objects:
        if thing.type == "MESH":
            thing.data.materials.clear()
            thing.data.materials.append(material())


def matte(albedo: float) -> Any:
    return build.diffuse("Matte", (albedo,) * 3)


def metal(roughness: float) -> Any:
    return build.principled("Metal", Base_Color=build.WHITE, Metallic=1.0, Roughness=roughness)


def ball_of(material: Any, world: float = 1.0) -> None:
    build.add_sphere("Ball", 1.0, (0, 0, 0), material(), segments=48)
    build.set_world((world,) * 3)
    stage.camera((0, -3.5, 0.5), (0, 0, 0), lens=50)


def glass() -> Any:
    material, tree, surface = build.bare_material("Glass")
    tree.links.new(build.new_node(tree, "BsdfGlass", Color=build.WHITE, Roughness=0.0, IOR=1.45).outputs[0], surface)
    return material


def two_walls(albedo: float) -> None:
    """Two walls that face each other and reflect more than they get: no finite answer."""
    for x in (-1.0, 1.0):
        build.add_quad(f"Wall {x}", [(x, -1, -1), (x, 1, -1), (x, 1, 1), (x, -1, 1)], matte(albedo))
    build.add_light("POINT", (0, 0, 0), energy=10.0, shadow_soft_size=0.1)
    stage.camera((0, -4, 0), (0, 0, 0))


def sunlit_plane(albedo: float) -> None:
    stage.plane(albedo)
    build.add_light("SUN", (0, 0, 5), energy=SUN, angle=0.0)
    stage.patch_seen(1.0)


def mirror_corridor() -> None:
    """Two mirrors face each other; between them stands a lit box."""
    for y, normal in ((-2.0, 1), (2.0, -1)):
        corners = [(-3, y, 0), (3, y, 0), (3, y, 3), (-3, y, 3)]
        mirror = build.principled("Mirror", Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.0)
        build.add_quad(f"Mirror {y}", corners[::normal], mirror)
    build.add_plane("Floor", 6.0, matte(0.5))
    build.add_box("Box", (0.8, 0.8, 0.8), (0.3, 0.2, 0.4), 0.4, build.diffuse("Box", (0.7, 0.3, 0.2)))
    build.add_light("AREA", (0, 0, 4), (0, 0, 0), energy=100.0, shape="SQUARE", size=1.0)
    build.set_world((0.2, 0.2, 0.2))
    stage.camera((-2.2, -1.2, 1.4), (1.0, 1.0, 0.6), lens=24)


def veils(count: int) -> None:
    """Cards of a tenth of a matter's opacity, one behind the other, all of radiance 1."""
    build.set_world((1.0, 1.0, 1.0))
    material, tree, surface = build.bare_material("Veil")
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.1
    tree.links.new(tree.nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[1])
    both = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(build.new_node(tree, "BsdfDiffuse", Color=(0.8,) * 3).outputs[0], both.inputs[0])
    tree.links.new(build.new_node(tree, "Emission", Color=build.WHITE, Strength=0.2).outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], surface)
    for k in range(count):
        build.add_plane(f"Veil {k}", 2.0, material, 0.05 * k)
    stage.camera((0.3, -2.0, 4.0), (0, 0, 0.5), lens=35)


def undefined_numbers() -> None:
    """Colours out of 1/0, 0/0, the logarithm of 0, roots of negative numbers: Blender defines all of them."""
    stage.court()
    for thing in [t for t in bpy.context.scene.objects if t.type == "MESH"]:
        material, tree, surface = build.bare_material(thing.name)
        colour = build.new_node(tree, "CombineColor")
        for socket, (operation, a, b) in enumerate(UNDEFINED):
            math_node = tree.nodes.new("ShaderNodeMath")
            math_node.operation = operation
            math_node.inputs[0].default_value, math_node.inputs[1].default_value = a, b
            plus = tree.nodes.new("ShaderNodeMath")
            plus.inputs[1].default_value = 0.6
            tree.links.new(math_node.outputs[0], plus.inputs[0])
            tree.links.new(plus.outputs[0], colour.inputs[socket])
        matte_node = tree.nodes.new("ShaderNodeBsdfDiffuse")
        tree.links.new(colour.outputs[0], matte_node.inputs["Color"])
        tree.links.new(matte_node.outputs[0], surface)
        thing.data.materials.clear()
        thing.data.materials.append(material)


CASES = (
    Case("albedo_0", "black boxes under a white world", lambda: court_of(lambda: matte(0.0))),
    Case("albedo_0_lamp", "the court in black under its lamp alone", lambda: court_of(lambda: matte(0.0), 0.0, True),
         exact=0.0, formula="black in the dark", skipped={"parts": "all is black"}),
    Case("albedo_1", "the court in white under a world of 1", lambda: court_of(lambda: matte(1.0)), exact=1.0,
         formula=WHITE_WORLD),
    Case("albedo_5", "a plane that reflects five times the light of a sun", partial(sunlit_plane, 5.0),
         exact=SUN * 5.0 / math.pi, formula="3 W/m2 x 5 / pi"),
    Case("albedo_5_walls", "two walls of albedo 5 that face each other", partial(two_walls, 5.0),
         skipped=dict.fromkeys(("brightness", "parts", "translation", "rotation", "scale"),
                               "light between them grows without end: only that pictures are finite is asked")),
    Case("furnace_1e5", "a world of 1e5 W/(m2 sr)",
         lambda: crossing_boxes_in(1e5), exact=1e5, formula=ALL_ONE + ", times 1e5"),
    Case("furnace_1e-5", "a world of 1e-5 W/(m2 sr)", lambda: crossing_boxes_in(1e-5), exact=1e-5,
         formula=ALL_ONE + ", times 1e-5"),
    Case("world_0", "no light at all", lambda: court_of(lambda: matte(0.8), 0.0), exact=0.0, formula="dark",
         skipped={"parts": "all is black"}),
    Case("world_1e5", "the court under a world of 1e5", lambda: court_of(lambda: matte(0.5), 1e5)),
    Case("roughness_0", "a perfect mirror under a world of 1", lambda: ball_of(partial(metal, 0.0)), exact=1.0,
         formula=WHITE_WORLD),
    Case("roughness_1", "metal of roughness 1 under a world of 1", lambda: ball_of(partial(metal, 1.0)), exact=1.0,
         formula=WHITE_WORLD),
    Case("roughness_1_court", "the court in rough metal", lambda: court_of(partial(metal, 1.0), 0.3, True),
         missed={"brightness": "voxels send light on as matte surfaces do, which rough metal is not quite"}),
    Case("roughness_0_court", "the court in mirrors", lambda: court_of(partial(metal, 0.0), 1.0), exact=1.0,
         formula=WHITE_WORLD),
    Case("glass_ball", "a ball of glass under a world of 1", lambda: ball_of(glass), exact=1.0, formula=WHITE_WORLD),
    Case("mirror_corridor", "two mirrors that face each other", mirror_corridor,
         missed=dict.fromkeys(("brightness", "parts"), MIRRORS)),
    Case("veils", "32 cards of opacity 0.1", partial(veils, 32), exact=1.0, formula=ALL_ONE),
    Case("undefined_numbers", "colours out of 1/0, log 0 and roots of negative numbers", undefined_numbers),
)


def crossing_boxes_in(radiance: float) -> None:
    crossing_boxes(stage.white_world(radiance=radiance))
    stage.court_camera()
