# SPDX-License-Identifier: GPL-3.0-or-later
"""Random node graphs, made in Blender: each gives a picture of numbers, whatever is plugged into what."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

pytest.importorskip("bpy")

from blender_tests.scenes import build, rendering

EXAMPLES = int(os.environ.get("CONELIGHT_EXAMPLES", "0"))
some = settings(
    derandomize=not EXAMPLES, max_examples=EXAMPLES or 8, deadline=None, database=None,
    suppress_health_check=list(HealthCheck), phases=[Phase.generate],
)  # fmt: skip

VALUES = (
    "Math", "VectorMath", "MixRGB", "Mix", "MapRange", "Clamp", "CombineColor", "SeparateColor", "CombineXYZ",
    "SeparateXYZ", "Gamma", "BrightContrast", "HueSaturation", "Invert", "RGBToBW", "ValToRGB", "Value", "RGB",
    "TexCoord", "NewGeometry", "ObjectInfo", "LayerWeight", "Fresnel", "Blackbody", "TexChecker", "TexNoise",
    "TexGradient", "TexImage", "Mapping", "NormalMap", "Bump", "LightPath", "Attribute", "UVMap", "VertexColor",
)  # fmt: skip
SHADERS = (
    "BsdfPrincipled", "BsdfDiffuse", "Emission", "BsdfGlass", "BsdfTransparent", "BsdfTranslucent", "BsdfRefraction",
    "MixShader", "AddShader", "SubsurfaceScattering", "BsdfSheen", "Holdout", "BsdfAnisotropic",
)  # fmt: skip
ENUMERATIONS = ("operation", "blend_type", "data_type", "distribution", "gradient_type", "space", "mode")


def _set_enumerations(node: Any, choose: Any) -> None:
    """Gives operations, blend modes and the like a random value."""
    for prop in node.bl_rna.properties:
        if prop.identifier in ENUMERATIONS and prop.type == "ENUM" and not prop.is_readonly:
            choices = [item.identifier for item in prop.enum_items]
            try:
                setattr(node, prop.identifier, choices[choose(len(choices))])
            except TypeError:
                continue  # not of this node, in this state


def _set_value(socket: Any, choose: Any) -> None:
    numbers = (0.0, 1.0, 0.5, -1.0, 2.0, 1e-6, 1e6)
    if socket.type == "VALUE":
        socket.default_value = numbers[choose(len(numbers))]
    elif socket.type == "RGBA":
        socket.default_value = (*(abs(numbers[choose(5)]) for _ in range(3)), 1.0)
    elif socket.type == "VECTOR" and len(socket.default_value) == 3:
        socket.default_value = [numbers[choose(5)] for _ in range(3)]


def _grow(tree: Any, wanted: Any, depth: int, choose: Any, made: list[Any]) -> None:
    """Links a random node into a socket, and others into that one's."""
    is_shader = wanted.type == "SHADER"
    kinds = SHADERS if is_shader else VALUES
    if not is_shader and made and choose(4) == 0:
        node = made[choose(len(made))]  # one output for several sockets
    else:
        node = tree.nodes.new("ShaderNode" + kinds[choose(len(kinds))])
        _set_enumerations(node, choose)
        for socket in node.inputs:
            if not socket.enabled or socket.is_unavailable:
                continue
            if depth > 0 and (socket.type == "SHADER" or choose(3) == 0):
                _grow(tree, socket, depth - 1, choose, made)
            elif hasattr(socket, "default_value"):
                _set_value(socket, choose)
        if not is_shader:
            made.append(node)  # only now: links never lead round
    outputs = [o for o in node.outputs if o.enabled and (o.type == "SHADER") == is_shader]
    if outputs:
        tree.links.new(outputs[choose(len(outputs))], wanted)


@some
@given(choices=st.lists(st.integers(0, 2**16), min_size=60, max_size=60))
def test_any_graph_gives_numbers(choices: list[int]) -> None:
    build.empty_scene()
    numbers = np.random.default_rng(choices)

    def choose(count: int) -> int:
        return int(numbers.integers(count))

    for name, place in (("Left", -1.2), ("Right", 1.2)):
        material, tree, surface = build.bare_material(name)
        _grow(tree, surface, 3, choose, [])
        build.add_sphere(name, 1.0, (place, 0.0, 1.0), material, segments=12)
    build.add_plane("Floor", 6.0, build.diffuse("Floor", (0.5, 0.5, 0.5)))
    build.add_light("POINT", (0, -2, 4), energy=200.0)
    build.set_world((0.2, 0.3, 0.4))
    build.add_camera((0, -6, 2.5), (0, 0, 0.8))
    picture = rendering.conelight((16, 12), voxels=16, samples=2, debug_checks=True)
    assert np.isfinite(picture).all() and (picture >= 0.0).all()
    assert picture[..., :3].max() > 0.0
