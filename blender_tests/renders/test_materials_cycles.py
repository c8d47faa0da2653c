# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes with constant inputs give the number that Cycles renders (an emission, one pixel)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.host.extract.image import ImageReader  # noqa: E402
from addon.host.extract.material import extract_material  # noqa: E402
from addon.materials.compile import compile_materials  # noqa: E402

#: Added on both sides: an emission cannot be negative.
OFFSET = 100.0


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.use_denoising = 1, 0, False
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(tmp_path_factory.mktemp("cycles") / "pixel.exr")
    bpy.ops.mesh.primitive_plane_add(size=4)
    bpy.context.object.data.materials.append(bpy.data.materials.new("Test"))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 1.0, (0.0, 0.0, 3.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    yield scene


def agree(scene: Any, idname: str, inputs: dict[Any, Any], **properties: Any) -> None:
    """Renders the first visible output of a node and compares. Inputs by identifier or index."""
    material = bpy.data.materials["Test"]
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    names = ("ShaderNodeOutputMaterial", "ShaderNodeEmission", "ShaderNodeVectorMath", idname)
    output, emission, add, node = (tree.nodes.new(name) for name in names)
    for name, value in properties.items():
        setattr(node, name, value)
    for index, socket in enumerate(node.inputs):
        for key in (index, socket.identifier):
            if key in inputs:
                socket.default_value = inputs[key]
    add.inputs[1].default_value = (OFFSET,) * 3
    tree.links.new(next(s for s in node.outputs if s.enabled), add.inputs[0])
    tree.links.new(add.outputs[0], emission.inputs[0])
    tree.links.new(emission.outputs[0], output.inputs[0])
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath, check_existing=False)
    pixels = np.empty(64, dtype=np.float32)
    picture.pixels.foreach_get(pixels)
    bpy.data.images.remove(picture)
    assert Path(scene.render.filepath).exists()
    ours = compile_materials([extract_material(material, ImageReader(), [])]).materials[0].parameters[0, :3]
    np.testing.assert_allclose(ours - OFFSET, pixels[20:23] - OFFSET, rtol=1e-3, atol=1e-3)


def choices(idname: str, name: str) -> list[str]:
    return [item.identifier for item in getattr(bpy.types, idname).bl_rna.properties[name].enum_items]


@pytest.mark.parametrize("operation", choices("ShaderNodeMath", "operation"))
def test_math(scene: Any, operation: str) -> None:
    agree(scene, "ShaderNodeMath", {0: -1.5, 1: 3.0, 2: 0.7}, operation=operation)
    agree(scene, "ShaderNodeMath", {0: 1.3, 1: 0.0, 2: 0.2}, operation=operation)


@pytest.mark.parametrize("operation", choices("ShaderNodeVectorMath", "operation"))
def test_vector_math(scene: Any, operation: str) -> None:
    inputs = {0: (0.3, -1.2, 2.0), 1: (0.5, 0.0, -1.5), 2: (0.2, 0.4, 0.1), 3: 0.6}
    agree(scene, "ShaderNodeVectorMath", inputs, operation=operation)


@pytest.mark.parametrize("blend", choices("ShaderNodeMix", "blend_type"))
def test_mix(scene: Any, blend: str) -> None:
    for factor, a, b in (
        (0.4, (0.2, 0.7, 0.0, 1.0), (0.6, 0.1, 0.9, 1.0)),
        (0.8, (0.0, 0.9, 1.5, 1.0), (0.0, 0.0, 1.2, 1.0)),
    ):
        inputs = {"Factor_Float": factor, "A_Color": a, "B_Color": b}
        agree(scene, "ShaderNodeMix", inputs, data_type="RGBA", blend_type=blend)


@pytest.mark.parametrize("kind", choices("ShaderNodeMapRange", "interpolation_type"))
def test_map_range(scene: Any, kind: str) -> None:
    for values in ((0.3, 0, 1, 2, 5, 4), (1.7, 0, 1, 2, 5, 3), (0.3, 1, 0, 2, 5, 4), (0.3, 1, 1, 2, 5, 4)):
        agree(scene, "ShaderNodeMapRange", dict(enumerate(values)), interpolation_type=kind)


@pytest.mark.parametrize("kind", choices("ShaderNodeMapping", "vector_type"))
def test_mapping(scene: Any, kind: str) -> None:
    inputs = {0: (0.3, 0.5, 0.7), 1: (0.1, 0.2, 0.3), 2: (0.4, 0.5, 0.6), 3: (2.0, 3.0, 0.5)}
    agree(scene, "ShaderNodeMapping", inputs, vector_type=kind)


@pytest.mark.parametrize("mode", ["RGB", "HSV", "HSL"])
def test_color_spaces(scene: Any, mode: str) -> None:
    agree(scene, "ShaderNodeSeparateColor", {0: (0.2, 0.5, 0.8, 1.0)}, mode=mode)
    agree(scene, "ShaderNodeCombineColor", {0: 0.3, 1: 0.6, 2: 0.7}, mode=mode)


def test_color_adjustments(scene: Any) -> None:
    agree(scene, "ShaderNodeGamma", {0: (0.5, -0.2, 0.0, 1.0), 1: 2.2})
    agree(scene, "ShaderNodeBrightContrast", {0: (0.5, 0.2, 0.9, 1.0), 1: 0.1, 2: 0.4})
    agree(scene, "ShaderNodeHueSaturation", {0: 0.7, 1: 1.4, 2: 1.2, 3: 0.6, 4: (0.2, 0.5, 0.8, 1.0)})
    agree(scene, "ShaderNodeInvert", {0: 0.3, 1: (0.2, 0.5, 0.8, 1.0)})
    agree(scene, "ShaderNodeRGBToBW", {0: (0.2, 0.5, 0.8, 1.0)})
    agree(scene, "ShaderNodeClamp", {0: 2.0, 1: 3.0, 2: 1.0}, clamp_type="RANGE")
