# SPDX-License-Identifier: GPL-3.0-or-later
"""Generated materials on the GPU against numpy: every operation, and materials with textures and normals."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.materials.compile import compile_materials
from addon.materials.expression import constant, leaf, operation
from addon.materials.graph import AlphaMode, ImageData, ImageEncoding, ImageSet, MaterialData
from addon.materials.nodes_color import BLEND, hsl_to_rgb, hsv_to_rgb, rgb_to_hsl, rgb_to_hsv
from addon.materials.nodes_math import MATH, VECTOR_MATH
from addon.materials.operations import dielectric_scale_bias
from addon.materials.reader import VALUE_NODES
from blender_tests.material_shader import compute_shader, material, node

moderngl = pytest.importorskip("moderngl")

POINTS = np.array([-7.5, -2.0, -1.0, -0.4, 0.0, 0.25, 0.5, 0.7, 1.0, 1.5, 2.0, 3.3], dtype=np.float32)


@pytest.fixture
def context(gpu: GpuContext) -> Any:
    return gpu.mgl


def evaluate(ctx: Any, data: MaterialData, textures: dict[int, Any] | None = None) -> dict[str, np.ndarray]:
    """The Surface at each of POINTS."""
    result = compile_materials([data])
    family, compiled = result.families[0], result.materials[0]
    program = ctx.compute_shader(compute_shader(family))
    parameters = compiled.parameters if len(compiled.parameters) else np.zeros((1, 4), np.float32)
    buffers = [ctx.buffer(parameters.tobytes()), ctx.buffer(reserve=len(POINTS) * 80), ctx.buffer(POINTS.tobytes())]
    for slot, buffer in enumerate(buffers):
        buffer.bind_to_storage_buffer(slot)
    held = []
    for slot, binding in enumerate(compiled.textures):
        image = result.images[binding.image]
        height, width = image.pixels.shape[:2]
        texture = ctx.texture((width, height), 4, image.pixels.tobytes(), dtype="f1")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.repeat_x = texture.repeat_y = binding.extension == "REPEAT"
        texture.use(slot)
        program[f"material_texture_{slot}"] = slot
        held.append(texture)
    program.run(len(POINTS))
    ctx.finish()
    values = np.frombuffer(buffers[1].read(), dtype=np.float32).reshape(len(POINTS), 5, 4)
    for thing in (*held, *buffers, program):
        thing.release()
    return {
        "diffuse": values[:, 0, :3], "roughness": values[:, 0, 3], "f0": values[:, 1, :3],
        "transparency": values[:, 1, 3], "f90": values[:, 2, :3], "emission": values[:, 3, :3],
        "normal": values[:, 4, :3],
    }  # fmt: skip


@pytest.fixture
def run_expression(context: Any) -> Iterator[Any]:
    """Runs function(x) on the GPU, x being the leaf of the surface's position, and folds it in Python at the same x.

    It comes back as emission, which is at least 0: once as it is and once negated.
    """
    current: list[Any] = []
    VALUE_NODES["ShaderNodeTestExpression"] = lambda reader, n, output: current[0]
    data = material(node("T", "TestExpression"), node("E", "Emission", Color="T.Color", Strength=1.0), surface="E.E")

    def run(function: Any) -> tuple[np.ndarray, np.ndarray]:
        halves = []
        for sign in (1.0, -1.0):
            current[:] = [function(leaf("position_ws")).rgb * sign]
            halves.append(evaluate(context, dataclasses.replace(data))["emission"])  # one object is compiled once
        expected = [np.broadcast_to(function(constant((float(x), 0.25, 0.5))).value, 3) for x in POINTS]
        return halves[0] - halves[1], np.array(expected)

    yield run
    del VALUE_NODES["ShaderNodeTestExpression"]


def assert_close(pair: tuple[np.ndarray, np.ndarray]) -> None:
    measured, expected = pair
    assert np.isfinite(measured).all()
    np.testing.assert_allclose(measured, expected, rtol=5e-4, atol=1e-4)


@pytest.mark.parametrize("name", sorted(MATH))
def test_math(name: str, run_expression: Any) -> None:
    b, c = constant(1.7), constant(0.31)
    assert_close(run_expression(lambda p: MATH[name](p.x, b, c)))
    assert_close(run_expression(lambda p: MATH[name](b, p.x, c)))


@pytest.mark.parametrize("name", sorted(VECTOR_MATH))
def test_vector_math(name: str, run_expression: Any) -> None:
    b, c = constant((0.3, 2.0, -0.5)), constant((0.1, 0.4, -0.2))
    assert_close(run_expression(lambda p: VECTOR_MATH[name](p, b, c, constant(0.7))))
    assert_close(run_expression(lambda p: VECTOR_MATH[name](b, p, c, constant(1.4))))


@pytest.mark.parametrize("name", sorted(BLEND))
def test_blend(name: str, run_expression: Any) -> None:
    color, half = constant((0.3, 0.6, 0.9)), constant(0.5)
    assert_close(run_expression(lambda p: BLEND[name](p, color, half)))
    assert_close(run_expression(lambda p: BLEND[name](color, p, half)))


@pytest.mark.parametrize("function", [rgb_to_hsv, hsv_to_rgb, rgb_to_hsl, hsl_to_rgb])
def test_color_spaces(function: Any, run_expression: Any) -> None:
    assert_close(run_expression(function))


@pytest.mark.parametrize("cosine", [0.1, 0.5, 1.0])
def test_specular_split(cosine: float, run_expression: Any) -> None:
    for ior in (0.0, 0.7, 1.5):
        index = constant(ior)
        assert_close(run_expression(lambda p, i=index: operation("specular_split", constant(cosine), p.x, i)))


@pytest.mark.parametrize("interpolation", ["LINEAR", "CONSTANT"])
@pytest.mark.parametrize("count", [3, 40])
def test_ramp(interpolation: str, count: int, context: Any) -> None:
    stops = tuple((float(p), (float(p**2), 0.5, 1.0 - float(p), 1.0)) for p in np.linspace(0.0, 1.0, count))
    ramp = node("R", "ValToRGB", ramp=stops, Fac="G.Position", p_ramp_interpolation=interpolation)
    split = node("S", "SeparateXYZ", Vector="G.Position")
    ramp.inputs["Fac"] = type(ramp.inputs["Fac"])("Fac", "VALUE", None, ("S", "X"))
    nodes = [node("G", "NewGeometry"), split, ramp, node("E", "Emission", Color="R.Color", Strength=1.0)]
    measured = evaluate(context, material(*nodes, surface="E.E"))["emission"]
    positions, colors = [s[0] for s in stops], np.array([s[1] for s in stops])
    if interpolation == "CONSTANT":
        index = np.maximum(np.searchsorted(positions, POINTS, side="right") - 1, 0)
        expected = colors[index, :3]
    else:
        expected = np.stack([np.interp(POINTS, positions, colors[:, i]) for i in range(3)], axis=-1)
    np.testing.assert_allclose(measured, expected, atol=1e-4)


def strip(*colors: tuple[int, int, int, int], alpha_mode: AlphaMode = AlphaMode.NONE) -> ImageData:
    """A row of texels."""
    return ImageData("strip", np.array([colors], dtype=np.uint8), ImageEncoding.DATA, alpha_mode)


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP"])
def test_image_texture(extension: str, context: Any) -> None:
    image = ImageSet("strip", {1001: strip((255, 0, 0, 255), (0, 255, 0, 255))})
    texture = node("T", "TexImage", image=image, p_extension=extension)
    emission = node("E", "Emission", Color="T.Color", Strength=1.0)
    measured = evaluate(context, material(texture, emission, surface="E.E"))["emission"]
    u = {"REPEAT": POINTS % 1.0, "EXTEND": np.clip(POINTS, 0, 1), "CLIP": POINTS}[extension]
    expected = np.where((u < 0.5)[:, None], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    if extension == "CLIP":
        expected[(u < 0) | (u > 1)] = 0.0
    away = np.abs(POINTS * 2 - np.round(POINTS * 2)) > 0.01  # not on the edge of two texels
    np.testing.assert_allclose(measured[away], expected[away], atol=1e-3)


def test_udim(context: Any) -> None:
    tiles = {1001: strip((255, 0, 0, 255)), 1003: strip((0, 0, 255, 255))}
    texture = node("T", "TexImage", image=ImageSet("set", tiles, is_udim=True))
    measured = evaluate(context, material(texture, node("E", "Emission", Color="T.Color"), surface="E.E"))["emission"]
    colors = {0: (1.0, 0.0, 0.0), 2: (0.0, 0.0, 1.0)}
    expected = [colors.get(int(np.floor(x)), (1.0, 0.0, 1.0)) for x in POINTS]
    np.testing.assert_allclose(measured, expected, atol=1e-3)


def test_normal_map(context: Any) -> None:
    """The colour (1, 0.5, 0.5) bends the normal along u; strength one half halfway."""
    for strength, expected in ((1.0, (1.0, 0.0, 0.0)), (0.5, (0.7071, 0.0, 0.7071))):
        bend = node("N", "NormalMap", Color=(1.0, 0.5, 0.5, 1.0), Strength=strength, p_uv_map="map")
        data = material(bend, node("D", "BsdfDiffuse", Normal="N.Normal"), surface="D.BSDF")
        assert compile_materials([data]).families[0].reads_normal
        np.testing.assert_allclose(evaluate(context, data)["normal"], [expected] * len(POINTS), atol=1e-3)


def test_white_principled_keeps_all_light(context: Any) -> None:
    """Seen head on, a white dielectric reflects as much by its two lobes as it receives."""
    for roughness in (0.2, 0.6, 1.0):
        data = material(
            node("P", "BsdfPrincipled", Base_Color=(1.0,) * 4, Roughness=roughness, IOR=1.5), surface="P.BSDF"
        )
        surface = evaluate(context, data)
        scale, bias = dielectric_scale_bias(1.0, roughness, 1.5)
        total = surface["diffuse"] + surface["f0"] * scale + surface["f90"] * bias
        np.testing.assert_allclose(total, 1.0, atol=2e-3)
        assert surface["roughness"] == pytest.approx(roughness)


def test_odd_numbers_give_a_surface(context: Any) -> None:
    """Infinite strength, tangents of poles, a normal of no length."""
    zero = node("N", "NormalMap", Color=(0.5, 0.5, 0.5, 1.0))
    split = node("S", "SeparateXYZ", Vector="G.Position")
    big = node("X", "Math", Value="S.X", Value_001=1e30, p_operation="MULTIPLY")
    bigger = node("Y", "Math", Value="X.Value", Value_001="X.Value", p_operation="MULTIPLY")
    shader = node("P", "BsdfPrincipled", Normal="N.Normal", Emission_Strength="Y.Value", Roughness="Y.Value")
    surface = evaluate(context, material(node("G", "NewGeometry"), split, big, bigger, zero, shader, surface="P.BSDF"))
    for name, values in surface.items():
        assert np.isfinite(values).all(), name
    np.testing.assert_allclose(np.linalg.norm(surface["normal"], axis=-1), 1.0, atol=1e-4)
