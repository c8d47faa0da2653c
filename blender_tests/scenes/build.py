# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of test scenes: meshes, materials, lights, cameras, worlds. Lengths in metres, angles in radians."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import bpy
from mathutils import Matrix, Vector

Color = tuple[float, float, float]
Point = Sequence[float]

WHITE: Color = (1.0, 1.0, 1.0)


def empty_scene() -> Any:
    """A new file with one scene and nothing in it; its picture is black, and saved without a view transform."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.world = None
    scene.render.resolution_percentage = 100
    return scene


def use_nodes(owner: Any) -> Any:
    """The node tree of a material, world or light, switched on where Blender still has the switch."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        if owner.node_tree is None or bpy.app.version < (5, 0, 0):
            owner.use_nodes = True
    return owner.node_tree


# ---- geometry ----------------------------------------------------------------------------------------------------


def add_object(name: str, data: Any, location: Point = (0, 0, 0)) -> Any:
    """An object in the scene's own collection."""
    thing = bpy.data.objects.new(name, data)
    thing.location = location
    bpy.context.scene.collection.objects.link(thing)
    return thing


def new_mesh(
    name: str, vertices: Sequence[Point], faces: Sequence[Sequence[int]], material: Any = None,
    uv: Sequence[Point] | None = None, smooth: bool = False,
) -> Any:
    """A mesh; ``uv`` has one pair for each corner of the faces, in their order."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(v) for v in vertices], [], [tuple(f) for f in faces])
    if material is not None:
        mesh.materials.append(material)
    if uv is not None:
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", [value for pair in uv for value in pair])
    if smooth:
        mesh.shade_smooth()
    mesh.update()
    return mesh


def add_quad(name: str, corners: Sequence[Point], material: Any = None) -> Any:
    """A face whose front is where its corners go round counter-clockwise, with UVs (0,0) (1,0) (1,1) (0,1)."""
    uv = [(0, 0), (1, 0), (1, 1), (0, 1)]
    return add_object(name, new_mesh(name, corners, [(0, 1, 2, 3)], material, uv))


def add_plane(name: str, size: float, material: Any = None, z: float = 0.0) -> Any:
    """A square of side ``size``, facing up."""
    h = size / 2
    return add_quad(name, [(-h, -h, z), (h, -h, z), (h, h, z), (-h, h, z)], material)


def box_faces(inward: bool = False) -> list[tuple[int, ...]]:
    """Faces of the vertices that :func:`box_vertices` gives."""
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return [face[::-1] for face in faces] if inward else faces


def box_vertices(low: Point, high: Point) -> list[tuple[float, float, float]]:
    """Corners of a box; bit 0 of the index is x, bit 1 is y, bit 2 is z."""
    ends = (low, high)
    return [(ends[i & 1][0], ends[i >> 1 & 1][1], ends[i >> 2][2]) for i in range(8)]


def add_box(
    name: str, size: Point, location: Point, turn: float = 0.0, material: Any = None, inward: bool = False
) -> Any:
    """A box around ``location``, turned about z."""
    half = [side / 2 for side in size]
    mesh = new_mesh(name, box_vertices([-h for h in half], half), box_faces(inward), material)
    thing = add_object(name, mesh, location)
    thing.rotation_euler = (0, 0, turn)
    return thing


def sphere_mesh(name: str, radius: float, material: Any = None, segments: int = 32, smooth: bool = True) -> Any:
    """A UV sphere with ``segments`` around and half as many from pole to pole."""
    rings = segments // 2
    vertices: list[Point] = [(0, 0, radius)]
    for i in range(1, rings):
        theta = math.pi * i / rings
        for j in range(segments):
            phi = 2 * math.pi * j / segments
            vertices.append((
                radius * math.sin(theta) * math.cos(phi), radius * math.sin(theta) * math.sin(phi),
                radius * math.cos(theta),
            ))
    vertices.append((0, 0, -radius))
    last = len(vertices) - 1

    def at(ring: int, j: int) -> int:
        return 1 + (ring - 1) * segments + j % segments

    faces: list[tuple[int, ...]] = []
    for j in range(segments):
        faces.append((0, at(1, j), at(1, j + 1)))
        faces.append((last, at(rings - 1, j + 1), at(rings - 1, j)))
        for i in range(1, rings - 1):
            faces.append((at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)))
    return new_mesh(name, vertices, faces, material, smooth=smooth)


def add_sphere(name: str, radius: float, location: Point, material: Any = None, segments: int = 32) -> Any:
    return add_object(name, sphere_mesh(name, radius, material, segments), location)


# ---- materials ---------------------------------------------------------------------------------------------------


def bare_material(name: str) -> tuple[Any, Any, Any]:
    """A material with nothing but an output: (material, node tree, socket Surface of the output)."""
    material = bpy.data.materials.new(name)
    tree = use_nodes(material)
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    return material, tree, output.inputs["Surface"]


def new_node(tree: Any, kind: str, **inputs: Any) -> Any:
    """A node of the type ``ShaderNode`` + kind; ``inputs`` by name, with _ for a space."""
    node = tree.nodes.new("ShaderNode" + kind)
    for name, value in inputs.items():
        socket = node.inputs[name.replace("_", " ")]
        socket.default_value = (*value, 1.0) if socket.type == "RGBA" and len(value) == 3 else value
    return node


def diffuse(name: str, color: Color) -> Any:
    material, tree, surface = bare_material(name)
    tree.links.new(new_node(tree, "BsdfDiffuse", Color=color).outputs[0], surface)
    return material


def emission(name: str, color: Color, strength: float = 1.0) -> Any:
    material, tree, surface = bare_material(name)
    tree.links.new(new_node(tree, "Emission", Color=color, Strength=strength).outputs[0], surface)
    return material


def diffuse_and_emission(name: str, albedo: float, radiance: float) -> Any:
    """Grey: reflects ``albedo`` and emits ``radiance``, W/(m2 sr)."""
    material, tree, surface = bare_material(name)
    both = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(new_node(tree, "BsdfDiffuse", Color=(albedo,) * 3).outputs[0], both.inputs[0])
    tree.links.new(new_node(tree, "Emission", Color=WHITE, Strength=radiance).outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], surface)
    return material


def principled(name: str, **inputs: Any) -> Any:
    """A Principled BSDF; ``inputs`` by name, with _ for a space."""
    material, tree, surface = bare_material(name)
    tree.links.new(new_node(tree, "BsdfPrincipled", **inputs).outputs[0], surface)
    return material


def packed_image(name: str, pixels: Any, colorspace: str = "sRGB") -> Any:
    """An image of the file itself. ``pixels``: (H, W, 4) numbers 0..1 as encoded, row 0 at the bottom."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=True)
    image.colorspace_settings.name = colorspace
    image.pixels.foreach_set(pixels.astype("float32").ravel())
    image.update()
    image.pack()
    return image


def image_node(tree: Any, image: Any, interpolation: str = "Linear") -> Any:
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    node.interpolation = interpolation
    return node


# ---- light and camera --------------------------------------------------------------------------------------------


def set_world(color: Color, strength: float = 1.0) -> Any:
    """A world of one colour: radiance = color x strength, W/(m2 sr)."""
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    background = next(n for n in use_nodes(world).nodes if n.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength
    return world


def aim(thing: Any, location: Point, target: Point) -> None:
    """Places a camera or light, -z towards ``target`` and y up where that can be."""
    direction = Vector(target) - Vector(location)
    rotation = direction.to_track_quat("-Z", "Y").to_matrix().to_4x4()
    thing.matrix_world = Matrix.Translation(location) @ rotation


def add_light(kind: str, location: Point, target: Point = (0, 0, 0), name: str = "Light", **properties: Any) -> Any:
    """A light of type POINT, SPOT, SUN or AREA; ``properties`` by their RNA names."""
    light = bpy.data.lights.new(name, kind)
    for key, value in properties.items():
        setattr(light, key, value)
    thing = add_object(name, light)
    aim(thing, location, target)
    return thing


def add_camera(
    location: Point, target: Point, lens: float | None = None, ortho_scale: float | None = None, name: str = "Camera"
) -> Any:
    """The scene's camera: perspective by a lens in millimetres (sensor 36), or orthographic by a scale in metres."""
    data = bpy.data.cameras.new(name)
    data.sensor_width = 36.0
    if lens is not None:
        data.lens = lens
    if ortho_scale is not None:
        data.type = "ORTHO"
        data.ortho_scale = ortho_scale
    camera = add_object(name, data)
    aim(camera, location, target)
    bpy.context.scene.camera = camera
    return camera
