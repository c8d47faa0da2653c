# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of Blender, read and compiled: every node type there is, groups, images, odd cases."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.host.extract.image import ImageReader  # noqa: E402
from addon.host.extract.material import extract_material, extract_world  # noqa: E402
from addon.materials.compile import CompiledMaterials, CompiledWorld, compile_materials, compile_world  # noqa: E402
from addon.materials.graph import AlphaMode, ImageEncoding, MaterialData  # noqa: E402
from addon.materials.reader import SHADER_NODES, VALUE_NODES  # noqa: E402
from blender_tests.material_shader import check_glsl, compute_shader, world_shader  # noqa: E402

#: Bases and outputs: no node that anyone links from.
NOT_NODES = {"ShaderNode", "ShaderNodeTree", "ShaderNodeCustomGroup", "ShaderNodeGroup"}


@pytest.fixture(autouse=True)
def empty_file() -> Iterator[None]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yield


@pytest.fixture(scope="module")
def checked() -> set[str]:
    """Sources that were compiled already."""
    return set()


def new_material(name: str = "Test") -> Any:
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    material.node_tree.nodes.clear()
    return material


def add(owner: Any, idname: str, **properties: Any) -> Any:
    """A new node in a material, world or node group."""
    node = getattr(owner, "node_tree", owner).nodes.new(idname)
    for name, value in properties.items():
        setattr(node, name, value)
    return node


def link(owner: Any, a: Any, b: Any) -> None:
    getattr(owner, "node_tree", owner).links.new(a, b)


def emit(material: Any, socket: Any) -> None:
    """Makes the value of a socket the emission of the material; a shader its surface."""
    output = add(material, "ShaderNodeOutputMaterial")
    output.is_active_output = True
    if socket.type != "SHADER":
        emission = add(material, "ShaderNodeEmission")
        link(material, socket, emission.inputs["Color"])
        socket = emission.outputs[0]
    link(material, socket, output.inputs["Surface"])


def compiled(material: Any) -> tuple[MaterialData, CompiledMaterials, list[str]]:
    warnings: list[str] = []
    data = extract_material(material, ImageReader(), warnings)
    result = compile_materials([data])
    return data, result, warnings + result.warnings


def emission_of(material: Any) -> tuple[float, ...]:
    """The constant that the material emits."""
    _, result, warnings = compiled(material)
    assert result.families[0].is_constant and result.families[0].has_emission, (result.families, warnings)
    return tuple(round(float(v), 4) for v in result.materials[0].parameters[0, :3])


def all_node_types() -> list[str]:
    return sorted(name for name in dir(bpy.types) if name.startswith("ShaderNode") and name not in NOT_NODES)


@pytest.mark.parametrize("idname", all_node_types())
def test_every_node_type_compiles_or_is_named(idname: str, checked: set[str]) -> None:
    material = new_material()
    try:
        node = add(material, idname)
    except RuntimeError:
        pytest.skip("not for shader trees")
    node.name = "the node"
    varying = add(material, "ShaderNodeNewGeometry").outputs["Position"]
    for is_linked in (False, True):
        if is_linked:
            for socket in node.inputs:
                if socket.type not in ("SHADER", "CUSTOM"):
                    link(material, varying, socket)
        for socket in [s for s in node.outputs if s.type != "CUSTOM" and s.enabled]:
            emit(material, socket)
            data, result, warnings = compiled(material)
            assert data.graph is not None and data.graph.nodes["the node"].idname == idname
            assert np.isfinite(result.materials[0].parameters).all()
            assert not any("could not" in w for w in warnings), warnings
            if idname not in VALUE_NODES and idname not in SHADER_NODES:
                assert any("'Test'" in w and "'the node'" in w for w in warnings), warnings
            if result.families[0].source not in checked:
                checked.add(result.families[0].source)
                check_glsl(compute_shader(result.families[0]))


@pytest.mark.parametrize(
    ("idname", "name"),
    [("ShaderNodeMath", "operation"), ("ShaderNodeVectorMath", "operation"), ("ShaderNodeMix", "blend_type"),
     ("ShaderNodeMixRGB", "blend_type"), ("ShaderNodeMapRange", "interpolation_type"),
     ("ShaderNodeMapping", "vector_type"), ("ShaderNodeTexGradient", "gradient_type"),
     ("ShaderNodeNormalMap", "space"), ("ShaderNodeVectorRotate", "rotation_type"),
     ("ShaderNodeSeparateColor", "mode"), ("ShaderNodeCombineColor", "mode")],
)  # fmt: skip
def test_every_choice_of_a_node_compiles(idname: str, name: str) -> None:
    """Every operation that Blender offers is known here: none is named as missing."""
    material = new_material()
    node = add(material, idname)
    if idname == "ShaderNodeMix":
        node.data_type = "RGBA"
    varying = add(material, "ShaderNodeNewGeometry").outputs["Position"]
    for socket in node.inputs:
        link(material, varying, socket)
    for choice in [item.identifier for item in node.bl_rna.properties[name].enum_items]:
        setattr(node, name, choice)
        for socket in node.outputs:
            if socket.enabled:
                emit(material, socket)
                _, result, warnings = compiled(material)
                assert not any("does not know" in w or "could not" in w for w in warnings), warnings
                check_glsl(compute_shader(result.families[0]))


def value_group(name: str = "Half") -> Any:
    """A group that halves its input."""
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    group.interface.new_socket("In", in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketFloat")
    inside, outside = add(group, "NodeGroupInput"), add(group, "NodeGroupOutput")
    math = add(group, "ShaderNodeMath", operation="MULTIPLY")
    math.inputs[1].default_value = 0.5
    link(group, inside.outputs[0], math.inputs[0])
    link(group, math.outputs[0], outside.inputs[0])
    return group


def test_groups_in_groups_reroutes_and_muted_nodes() -> None:
    inner = value_group()
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    outer.interface.new_socket("In", in_out="INPUT", socket_type="NodeSocketFloat")
    outer.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketFloat")
    first, last = add(outer, "NodeGroupInput"), add(outer, "NodeGroupOutput")
    once, twice = add(outer, "ShaderNodeGroup", node_tree=inner), add(outer, "ShaderNodeGroup", node_tree=inner)
    reroute = add(outer, "NodeReroute")
    link(outer, first.outputs[0], once.inputs[0])
    link(outer, once.outputs[0], reroute.inputs[0])
    link(outer, reroute.outputs[0], twice.inputs[0])
    link(outer, twice.outputs[0], last.inputs[0])

    material = new_material()
    group = add(material, "ShaderNodeGroup", node_tree=outer)
    group.inputs[0].default_value = 8.0
    muted = add(material, "ShaderNodeMath", operation="ADD", mute=True)
    muted.inputs[1].default_value = 100.0
    link(material, group.outputs[0], muted.inputs[0])
    emit(material, muted.outputs[0])
    assert emission_of(material) == (2.0, 2.0, 2.0)  # 8 / 2 / 2, and the addition of 100 is muted


def test_names_in_messages_are_paths() -> None:
    group = bpy.data.node_groups.new("Stones", "ShaderNodeTree")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    noise = add(group, "ShaderNodeTexNoise", name="Grain")
    link(group, noise.outputs["Color"], add(group, "NodeGroupOutput").inputs[0])
    material = new_material("Rock")
    emit(material, add(material, "ShaderNodeGroup", node_tree=group, name="Stones").outputs[0])
    _, _, warnings = compiled(material)
    assert any("material 'Rock': node 'Stones/Grain' (TexNoise)" in w for w in warnings), warnings


def test_muted_link_and_empty_group_leave_defaults() -> None:
    material = new_material()
    math = add(material, "ShaderNodeMath", operation="ADD")
    math.inputs[0].default_value, math.inputs[1].default_value = 1.0, 2.0
    value = add(material, "ShaderNodeValue")
    value.outputs[0].default_value = 50.0
    link(material, value.outputs[0], math.inputs[0])
    material.node_tree.links[0].is_muted = True
    emit(material, math.outputs[0])
    assert emission_of(material) == (3.0, 3.0, 3.0)
    add(material, "ShaderNodeGroup")  # a group without a tree, unused
    assert emission_of(material) == (3.0, 3.0, 3.0)


def test_empty_slot_and_no_output() -> None:
    data, result, _ = compiled(None)
    assert data.graph is None
    assert result.materials[0].parameters[0, :3] == pytest.approx(0.8)
    _, result, warnings = compiled(new_material("Hollow"))
    assert not result.families[0].has_diffuse
    assert any("'Hollow' has no output" in w for w in warnings)


def test_active_output_wins() -> None:
    material = new_material()
    for strength in (3.0, 7.0):
        emission = add(material, "ShaderNodeEmission")
        emission.inputs["Strength"].default_value = strength
        output = add(material, "ShaderNodeOutputMaterial")
        link(material, emission.outputs[0], output.inputs[0])
        output.is_active_output = strength == 3.0
    assert emission_of(material) == (3.0, 3.0, 3.0)


def test_color_ramp_and_curves() -> None:
    material = new_material()
    ramp = add(material, "ShaderNodeValToRGB")
    ramp.inputs[0].default_value = 0.25
    emit(material, ramp.outputs["Color"])
    assert emission_of(material) == pytest.approx((0.25, 0.25, 0.25), abs=1e-4)
    for interpolation in ("EASE", "CARDINAL", "B_SPLINE"):
        ramp.color_ramp.interpolation = interpolation
        expected = ramp.color_ramp.evaluate(0.25)[0]
        assert emission_of(material)[0] == pytest.approx(expected, abs=2e-3)
    ramp.color_ramp.interpolation = "CONSTANT"
    ramp.inputs[0].default_value = 1.0  # the last stop, white
    assert emission_of(material) == (1.0, 1.0, 1.0)
    curve = add(material, "ShaderNodeRGBCurve")
    curve.mapping.curves[0].points.new(0.5, 0.9)
    curve.mapping.update()
    curve.inputs["Color"].default_value = (0.5, 0.25, 0.25, 1.0)
    emit(material, curve.outputs[0])
    assert emission_of(material) == pytest.approx((0.9, 0.25, 0.25), abs=5e-3)


# --- images --------------------


def save_png(folder: Path, name: str, color: tuple[float, float, float, float], size: int = 4) -> Path:
    image = bpy.data.images.new(name, size, size, alpha=True)
    image.generated_color = color
    path = folder / f"{name}.png"
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
    return path


def test_byte_image_is_read_exactly(tmp_path: Path) -> None:
    image = bpy.data.images.load(str(save_png(tmp_path, "red", (1.0, 0.5, 0.0, 1.0))))
    read = ImageReader().read(image, []).tiles[1001]
    assert read.pixels.dtype == np.uint8 and read.pixels.shape == (4, 4, 4)
    assert tuple(read.pixels[0, 0]) == (255, 128, 0, 255) or tuple(read.pixels[0, 0]) == (255, 188, 0, 255)
    assert read.encoding is ImageEncoding.SRGB
    assert read.alpha_mode is AlphaMode.NONE  # full everywhere
    image.colorspace_settings.name = "Non-Color"
    assert ImageReader().read(image, []).tiles[1001].encoding is ImageEncoding.DATA


def test_rows_start_at_the_bottom_and_alpha_is_kept() -> None:
    image = bpy.data.images.new("rows", 2, 2, alpha=True)
    image.pixels.foreach_set(np.array([1, 0, 0, 0.5] * 2 + [0, 1, 0, 1] * 2, dtype=np.float32))
    read = ImageReader().read(image, []).tiles[1001]
    assert tuple(read.pixels[0, 0]) == (255, 0, 0, 128) and tuple(read.pixels[1, 0]) == (0, 255, 0, 255)
    assert read.alpha_mode is AlphaMode.STRAIGHT


def test_float_image_and_not_a_number() -> None:
    image = bpy.data.images.new("hdr", 2, 1, float_buffer=True)
    image.pixels.foreach_set(np.array([8.0, 0.5, np.nan, 1.0] * 2, dtype=np.float32))
    read = ImageReader().read(image, []).tiles[1001]
    assert read.pixels.dtype == np.float32 and read.encoding is ImageEncoding.LINEAR
    assert tuple(read.pixels[0, 0]) == (8.0, 0.5, 0.0, 1.0)


def test_one_image_of_many_materials_is_read_once() -> None:
    image = bpy.data.images.new("shared", 4, 4)
    reader = ImageReader()
    assert reader.read(image, []) is reader.read(image, [])


def test_missing_file_is_magenta_and_named() -> None:
    image = bpy.data.images.new("gone", 4, 4)
    image.source, image.filepath = "FILE", "/nowhere/gone.png"
    material = new_material("Wall")
    texture = add(material, "ShaderNodeTexImage", image=image)
    emit(material, texture.outputs["Color"])
    _, result, warnings = compiled(material)
    assert tuple(result.materials[0].parameters[0, :3]) == (1.0, 0.0, 1.0)
    assert any("'Wall'" in w and "'gone'" in w and "/nowhere/gone.png" in w for w in warnings), warnings


def test_no_image_is_magenta_and_said() -> None:
    material = new_material()
    emit(material, add(material, "ShaderNodeTexImage").outputs["Color"])
    _, result, *_ = compiled(material)
    assert result.families[0].has_emission
    assert any("image" in warning for warning in result.warnings)


def test_packed_image_without_its_file(tmp_path: Path) -> None:
    path = save_png(tmp_path, "packed", (0.0, 0.0, 1.0, 1.0))
    image = bpy.data.images.load(str(path))
    image.pack()
    path.unlink()
    assert tuple(ImageReader().read(image, []).tiles[1001].pixels[0, 0]) == (0, 0, 255, 255)


@pytest.mark.parametrize("is_packed", [False, True])
def test_udim_tiles(tmp_path: Path, is_packed: bool) -> None:
    paths = [save_png(tmp_path, f"tile.{n}", (float(n == 1001), float(n == 1002), 0.0, 1.0)) for n in (1001, 1002)]
    image = bpy.data.images.load(str(paths[0]))
    image.source, image.filepath = "TILED", str(tmp_path / "tile.<UDIM>.png")
    for number in (1002, 1013):
        if number not in [tile.number for tile in image.tiles]:
            image.tiles.new(number)
    count = len(bpy.data.images)
    if is_packed:
        image.tiles.remove(image.tiles.get(1013))
        image.pack()
        for path in paths:
            path.unlink()
    warnings: list[str] = []
    read = ImageReader().read(image, warnings)
    assert read.is_udim and sorted(read.tiles) == [1001, 1002]
    assert tuple(read.tiles[1001].pixels[0, 0]) == (255, 0, 0, 255)
    assert tuple(read.tiles[1002].pixels[0, 0]) == (0, 255, 0, 255)
    assert is_packed or any("1013" in w for w in warnings)
    assert len(bpy.data.images) == count  # nothing is left behind
    material = new_material()
    emit(material, add(material, "ShaderNodeTexImage", image=image).outputs["Color"])
    family = compiled(material)[1].families[0]
    assert family.textures == 2
    check_glsl(compute_shader(family))


# --- the world --------------------


def world_with(idname: str) -> tuple[Any, Any]:
    """(world, node) with the node's colour in a background of strength 2."""
    world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    world.node_tree.nodes.clear()
    background, output = add(world, "ShaderNodeBackground"), add(world, "ShaderNodeOutputWorld")
    background.inputs["Strength"].default_value = 2.0
    link(world, background.outputs[0], output.inputs["Surface"])
    node = add(world, idname)
    link(world, node.outputs[0], background.inputs["Color"])
    return world, node


def compiled_world(world: Any) -> CompiledWorld:
    warnings: list[str] = []
    data = extract_world(world, ImageReader(), warnings)
    assert not warnings
    result = compile_world(data)
    if result.source is not None:
        check_glsl(world_shader(result.source, len(result.textures)))
    return result


def test_constant_world() -> None:
    world, node = world_with("ShaderNodeRGB")
    node.outputs[0].default_value = (0.1, 0.2, 0.3, 1.0)
    assert compiled_world(world).radiance == pytest.approx((0.2, 0.4, 0.6))
    assert extract_world(None, ImageReader(), []) is None


def test_environment_texture_and_sky() -> None:
    world, node = world_with("ShaderNodeTexEnvironment")
    node.image = bpy.data.images.new("env", 8, 4, float_buffer=True)
    compiled_env = compiled_world(world)
    assert compiled_env.radiance is None and len(compiled_env.images) == 1
    for coordinate in ("Generated", "Normal", "UV"):
        mapping = add(world, "ShaderNodeMapping")
        link(world, add(world, "ShaderNodeTexCoord").outputs[coordinate], mapping.inputs["Vector"])
        mapping.inputs["Rotation"].default_value = (0.1, 0.2, 0.3)
        link(world, mapping.outputs[0], node.inputs["Vector"])
        compiled_world(world)
    world, _ = world_with("ShaderNodeTexSky")
    sky = compiled_world(world)
    assert sky.radiance is None and any("without a sun" in w for w in sky.warnings)
