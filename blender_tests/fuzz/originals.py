# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that others are made from: small, and with a little of everything. Run as a script, it makes them."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from blender_tests.pictures import write
from blender_tests.scenes import build

PICTURES = ("png", "jpg", "exr", "hdr", "tif", "webp")


def make(folder: Path) -> None:
    """Writes all of ``FILES`` of changes.py and what they refer to."""
    pixels = np.random.default_rng(1).random((16, 16, 4), np.float32)
    scene = everything()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "values.blend"), compress=False)
    simple(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "bytes.blend"), compress=False)
    bpy.ops.wm.usd_export(filepath=str(folder / "crate.usdc"))
    bpy.ops.wm.usd_export(filepath=str(folder / "text.usda"))
    bpy.ops.export_scene.gltf(filepath=str(folder / "binary.glb"), export_lights=True, export_cameras=True)
    bpy.ops.export_scene.gltf(
        filepath=str(folder / "json.gltf"), export_format="GLTF_SEPARATE", export_lights=True, export_cameras=True
    )
    bpy.ops.wm.obj_export(filepath=str(folder / "text.obj"))
    for extension in PICTURES:
        write(folder / f"image.{extension}", pixels[..., :3])
        material = f"newmtl m\nmap_Kd image.{extension}\nmap_Ke image.{extension}\n"
        (folder / f"image_{extension}.mtl").write_text(material)
        (folder / f"image_{extension}.obj").write_text(
            f"mtllib image_{extension}.mtl\nusemtl m\nv -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\n"
            "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 4/4 3/3 2/2 1/1\n"
        )


def simple(scene: Any) -> None:
    """Leaves what other formats know too."""
    for thing in list(scene.objects):
        if thing.type not in ("MESH", "LIGHT", "CAMERA"):
            bpy.data.objects.remove(thing)
    for thing in scene.objects:
        thing.modifiers.clear()


def everything() -> Any:
    scene = build.empty_scene()
    scene.render.resolution_x, scene.render.resolution_y = 16, 12
    image = bpy.data.images.new("Image", 8, 8)
    image.pixels[:] = np.random.default_rng(2).random(256, np.float32)
    image.pack()
    material, tree, surface = build.bare_material("Material")
    principled = build.new_node(tree, "BsdfPrincipled", Roughness=0.3)
    texture, ramp = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeValToRGB")
    bump, math, mapping = (tree.nodes.new("ShaderNode" + kind) for kind in ("Bump", "Math", "Mapping"))
    coordinates, curve = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeRGBCurve")
    texture.image = image
    links = (
        (coordinates.outputs["UV"], mapping.inputs["Vector"]), (mapping.outputs[0], texture.inputs[0]),
        (texture.outputs["Color"], curve.inputs["Color"]), (curve.outputs[0], principled.inputs["Base Color"]),
        (texture.outputs["Alpha"], math.inputs[0]), (math.outputs[0], ramp.inputs[0]),
        (ramp.outputs[0], principled.inputs["Emission Color"]), (math.outputs[0], bump.inputs["Height"]),
        (bump.outputs[0], principled.inputs["Normal"]), (principled.outputs[0], surface),
    )  # fmt: skip
    for start, end in links:
        tree.links.new(start, end)
    glass, glass_tree, glass_surface = build.bare_material("Glass")
    glass_tree.links.new(build.new_node(glass_tree, "BsdfGlass", IOR=1.5).outputs[0], glass_surface)
    build.add_plane("Floor", 4.0, material)
    build.add_box("Box", (0.5, 0.5, 0.5), (0.5, 0.5, 0.3), material=glass)
    ball = build.add_sphere("Ball", 0.3, (-0.5, 0, 0.4), material, segments=12)
    ball.modifiers.new("Array", "ARRAY").count = 2
    ball.modifiers.new("Subdivision", "SUBSURF").levels = 1
    build.add_sphere("Lamp", 0.1, (0, 0, 1), build.emission("Glow", (3, 2, 1)), segments=8)
    bpy.ops.object.text_add(location=(0, -1, 0.5))
    bpy.ops.mesh.primitive_cube_add(size=0.2, location=(1, -1, 0.2))
    bpy.context.object.modifiers.new("Particles", "PARTICLE_SYSTEM")
    bpy.context.object.particle_systems[0].settings.count = 20
    for number, kind in enumerate(("POINT", "SPOT", "AREA", "SUN")):
        build.add_light(kind, (number - 1.5, -1, 2), energy=10.0)
    build.set_world((0.1, 0.2, 0.3))
    build.add_camera((0, -4, 3), (0, 0, 0.3), lens=35.0)
    return scene


if __name__ == "__main__":
    make(Path(sys.argv[1]))
    sys.stdout.flush()
    os._exit(0)
