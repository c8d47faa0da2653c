# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs built by hand, compiled: families, pruning, folded numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from addon.materials.blackbody import blackbody_rgb
from addon.materials.closure import Lobe
from addon.materials.compile import CompiledMaterials, compile_materials, compile_world
from addon.materials.expression import constant
from addon.materials.graph import (
    AlphaMode,
    ImageData,
    ImageEncoding,
    ImageSet,
    MaterialData,
    Node,
    NodeGraph,
    Socket,
    WorldData,
)
from addon.materials.nodes_color import BLEND, hsl_to_rgb, hsv_to_rgb, rgb_to_hsl, rgb_to_hsv
from addon.materials.nodes_math import MATH, VECTOR_MATH
from addon.materials.operations import specular_scale_bias
from addon.materials.shaders import mean_albedo, metal, with_energy
from blender_tests.material_shader import check_glsl, compute_shader, material, node


def image(name: str = "image", alpha_mode: AlphaMode = AlphaMode.NONE) -> ImageSet:
    data = ImageData(name, np.full((2, 2, 4), 128, np.uint8), ImageEncoding.SRGB, alpha_mode)
    return ImageSet(name, {1001: data})


def compiled(*materials: MaterialData) -> CompiledMaterials:
    result = compile_materials(materials)
    for family in result.families:
        check_glsl(compute_shader(family))
    return result


def principled(name: str = "P", **inputs: object) -> Node:
    values = {"Base_Color": (0.8, 0.4, 0.2, 1.0), "Roughness": 0.5, "Metallic": 0.0, "IOR": 1.5, "Alpha": 1.0,
              "Specular_IOR_Level": 0.5, "Emission_Strength": 0.0}  # fmt: skip
    return node(name, "BsdfPrincipled", **{**values, **inputs})


# --- families --------------------


def test_materials_that_differ_in_numbers_share_a_family() -> None:
    result = compiled(
        material(principled(), surface="P.BSDF", name="a"),
        material(principled(Base_Color=(0.0, 0.0, 1.0, 1.0), Roughness=1.0, IOR=1.45), surface="P.BSDF", name="b"),
        material(principled(Base_Color=(0.5, 0.5, 0.5, 1.0), Roughness=0.5), surface="P.BSDF", name="c"),
    )
    assert len(result.families) == 1
    assert [m.family for m in result.materials] == [0, 0, 0]
    assert [m.name for m in result.materials] == ["a", "b", "c"]
    assert not np.array_equal(result.materials[0].parameters, result.materials[1].parameters)


def test_textures_and_layers_are_slots_not_text() -> None:
    def textured(picture: ImageSet, layer: str) -> MaterialData:
        uv = node("UV", "UVMap", p_uv_map=layer)
        texture = node("T", "TexImage", image=picture, Vector="UV.UV")
        return material(uv, texture, principled(Base_Color="T.Color"), surface="P.BSDF")

    result = compiled(textured(image("x"), "one"), textured(image("y"), 'two"; evil'))
    family = result.families[0]
    assert len(result.families) == 1 and len(result.images) == 2
    assert (family.textures, family.uv_layers) == (1, 1)
    assert [m.textures[0].image for m in result.materials] == [0, 1]
    assert [m.uv_layers for m in result.materials] == [("one",), ('two"; evil',)]
    assert "evil" not in family.source and "one" not in family.source.split("vec3 c0")[1]


def test_an_image_used_twice_has_one_slot() -> None:
    shared = image()
    nodes = [node(name, "TexImage", image=shared) for name in ("T1", "T2")]
    result = compiled(material(*nodes, principled(Base_Color="T1.Color", Roughness="T2.Color"), surface="P.BSDF"))
    assert result.families[0].textures == 1 and len(result.images) == 1
    assert result.families[0].source.count("sample_image(") == 1


# --- what a material lacks costs nothing --------------------


def test_plain_principled_has_no_more_than_it_needs() -> None:
    family = compiled(material(principled(), surface="P.BSDF")).families[0]
    assert family.is_constant and family.has_specular and family.has_diffuse
    assert not family.has_emission and not family.has_transparency and not family.reads_normal
    assert "s.emission = vec3(0.0);" in family.source and "s.transparency = vec3(0.0);" in family.source


def test_branches_of_weight_zero_are_gone() -> None:
    assert not compiled(material(principled(Metallic=1.0), surface="P.BSDF")).families[0].has_diffuse
    assert not compiled(material(principled(Specular_IOR_Level=0.0), surface="P.BSDF")).families[0].has_specular
    glow = node("T", "TexImage", image=image())
    dark = compiled(material(glow, principled(Emission_Color="T.Color"), surface="P.BSDF"))
    assert dark.families[0].textures == 0 and not dark.images
    mixed = node("M", "MixShader", Fac=1.0, Shader="P.BSDF", Shader_001="E.Emission")
    result = compiled(material(principled(), node("E", "Emission", Strength=2.0), mixed, surface="M.Shader"))
    assert not result.families[0].has_specular and result.families[0].has_emission


def test_alpha_is_opacity_of_everything() -> None:
    result = compiled(material(principled(Alpha=0.25, Specular_IOR_Level=0.0), surface="P.BSDF"))
    family = result.families[0]
    assert family.has_transparency
    assert result.materials[0].parameters[0, :3] == pytest.approx([0.2, 0.1, 0.05])  # 0.25 of the base colour
    assert 0.75 in result.materials[0].parameters


def test_alpha_of_an_image_is_associated() -> None:
    """Bytes of 128 with alpha 128: 128 * 128 / 255 = 64, without Alpha; half the light, an sRGB byte of 93, with it.
    An image without alpha makes no transparency."""
    straight = node("T", "TexImage", image=image(alpha_mode=AlphaMode.STRAIGHT))
    alone = compiled(material(straight, principled(Base_Color="T.Color"), surface="P.BSDF"))
    assert tuple(alone.images[0].pixels[0, 0]) == (64, 64, 64, 128)
    both = compiled(material(straight, principled(Base_Color="T.Color", Alpha="T.Alpha"), surface="P.BSDF"))
    assert both.families[0].has_transparency and tuple(both.images[0].pixels[0, 0]) == (93, 93, 93, 128)
    assert "divided_by_alpha(sample" in both.families[0].source and "divided" not in alone.families[0].source
    multiplied = node("T", "TexImage", image=image(alpha_mode=AlphaMode.PREMULTIPLIED))
    divided = compiled(material(multiplied, principled(Base_Color="T.Color", Alpha="T.Alpha"), surface="P.BSDF"))
    assert tuple(divided.images[0].pixels[0, 0]) == (188, 188, 188, 128)  # white, half of its light
    opaque = node("T", "TexImage", image=image())
    result = compiled(material(opaque, principled(Base_Color="T.Color", Alpha="T.Alpha"), surface="P.BSDF"))
    assert not result.families[0].has_transparency


# --- numbers from paper --------------------


def test_dielectric_reflectance() -> None:
    """Index 1.5 reflects (0.5 / 2.5)^2 = 4 %; index 2 reflects 1/9; level 1 doubles."""
    for ior, level, expected in ((1.5, 0.5, 0.04), (2.0, 0.5, 1 / 9), (1.5, 1.0, 0.08)):
        glossy = principled(IOR=ior, Specular_IOR_Level=level)
        assert expected == pytest.approx(compiled(material(glossy, surface="P.BSDF")).materials[0].parameters[1, 0])


def integrated_scale_bias(cosine: float, roughness: float, n: int = 96) -> tuple[float, float]:
    """Splits the albedo of a GGX lobe into factors of f0 and f90 by quadrature over its half vectors.

    Half vectors follow D cos (u = cos^2 and azimuth uniform after the usual substitution), Smith's masking is height
    correlated (Heitz 2014).
    """
    alpha2 = max(roughness**4, 1e-8)
    u, phi = np.meshgrid((np.arange(4 * n) + 0.5) / (4 * n), 2 * np.pi * (np.arange(n) + 0.5) / n)
    cos2 = (1 - u) / (1 + (alpha2 - 1) * u)
    hx, hz = np.sqrt(1 - cos2) * np.cos(phi), np.sqrt(cos2)
    view_half = np.sqrt(1 - cosine**2) * hx + cosine * hz
    light = 2 * view_half * hz - cosine

    def smith(z: np.ndarray) -> np.ndarray:
        return (np.sqrt(1 + alpha2 * (1 - z * z) / (z * z)) - 1) / 2

    lit = (light > 1e-6) & (view_half > 0)
    masking = 1 / (1 + smith(np.asarray(cosine)) + smith(np.where(lit, light, 1.0)))
    weight = np.where(lit, masking * view_half / (hz * cosine), 0.0)
    schlick = (1 - np.clip(view_half, 0, 1)) ** 5
    return float((weight * (1 - schlick)).mean()), float((weight * schlick).mean())


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("cosine", [0.1, 0.3, 0.6, 1.0])
def test_fit_of_specular_albedo(cosine: float, roughness: float) -> None:
    scale, bias = specular_scale_bias(cosine, roughness)
    expected = integrated_scale_bias(cosine, roughness)
    assert scale + bias == pytest.approx(sum(expected), abs=0.012)
    assert bias == pytest.approx(expected[1], abs=0.012)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_mean_albedo(roughness: float) -> None:
    """2 times the integral of albedo times cosine, by the midpoint rule."""
    cosines = (np.arange(40) + 0.5) / 40
    expected = np.mean([2 * c * sum(integrated_scale_bias(c, roughness)) for c in cosines])
    assert float(mean_albedo(constant(roughness)).value) == pytest.approx(expected, abs=0.005)


def test_white_metal_reflects_all() -> None:
    """A lobe that absorbs nothing and keeps its energy reflects everything, however rough."""
    white = constant((1.0, 1.0, 1.0))
    for roughness in (0.2, 0.6, 1.0):
        _, albedo = with_energy(Lobe(white, white, roughness=constant(roughness)), constant(0.7), True)
        assert value_of(albedo) == pytest.approx([1.0, 1.0, 1.0], abs=1e-4)


def value_of(expr: object) -> list[float]:
    return np.atleast_1d(expr.value).round(5).tolist()  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("operation", "a", "b", "c", "expected"),
    [
        ("DIVIDE", 1.0, 0.0, 0.0, 0.0),
        ("POWER", -2.0, 3.0, 0.0, -8.0),
        ("POWER", -2.0, 0.5, 0.0, 0.0),
        ("POWER", 0.0, 0.0, 0.0, 1.0),
        ("LOGARITHM", 8.0, 2.0, 0.0, 3.0),
        ("LOGARITHM", -1.0, 2.0, 0.0, 0.0),
        ("SQRT", -4.0, 0.0, 0.0, 0.0),
        ("INVERSE_SQRT", 4.0, 0.0, 0.0, 0.5),
        ("MODULO", -3.5, 2.0, 0.0, -1.5),
        ("FLOORED_MODULO", -3.5, 2.0, 0.0, 0.5),
        ("FLOORED_MODULO", 1.0, 0.0, 0.0, 0.0),
        ("WRAP", 5.5, 3.0, 1.0, 1.5),
        ("SNAP", 7.3, 2.0, 0.0, 6.0),
        ("PINGPONG", 3.0, 2.0, 0.0, 1.0),
        ("COMPARE", 1.0, 1.1, 0.2, 1.0),
        ("COMPARE", 1.0, 1.5, 0.2, 0.0),
        ("SMOOTH_MIN", 1.0, 1.0, 0.6, 0.9),
        ("SMOOTH_MAX", 1.0, 1.0, 0.6, 1.1),
        ("ROUND", 2.5, 0.0, 0.0, 3.0),
        ("ARCSINE", 2.0, 0.0, 0.0, 1.5708),
        ("EXPONENT", 1000.0, 0.0, 0.0, 9.253781725587789e29),
        ("DEGREES", np.pi, 0.0, 0.0, 180.0),
        ("LESS_THAN", 1.0, 2.0, 0.0, 1.0),
        ("GREATER_THAN", 1.0, 2.0, 0.0, 0.0),
        ("FRACT", -0.25, 0.0, 0.0, 0.75),
    ],
)
def test_math(operation: str, a: float, b: float, c: float, expected: float) -> None:
    assert value_of(MATH[operation](constant(a), constant(b), constant(c)))[0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("operation", "expected"),
    [
        ("CROSS_PRODUCT", [0.0, 0.0, 4.0]),
        ("PROJECT", [0.0, 0.0, 0.0]),
        ("REFLECT", [1.0, 0.0, 0.0]),
        ("DOT_PRODUCT", [0.0]),
        ("DISTANCE", [4.12311]),
        ("LENGTH", [1.0]),
        ("SCALE", [0.5, 0.0, 0.0]),
    ],
)
def test_vector_math(operation: str, expected: list[float]) -> None:
    a, b = constant((1.0, 0.0, 0.0)), constant((0.0, 4.0, 0.0))
    assert value_of(VECTOR_MATH[operation](a, b, b, constant(0.5))) == expected


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("MIX", 0.4),
        ("DARKEN", 0.2),
        ("MULTIPLY", 0.16),
        ("ADD", 0.5),
        ("SUBTRACT", -0.1),
        ("SCREEN", 0.44),
        ("OVERLAY", 0.22),
        ("DODGE", 0.2857143),
        ("BURN", 0.0),
        ("DIFFERENCE", 0.3),
        ("EXCLUSION", 0.38),
        ("DIVIDE", 0.2666667),
        ("LIGHTEN", 0.4),
        ("LINEAR_LIGHT", 0.3),
        ("SOFT_LIGHT", 0.216),
    ],
)
def test_blend_of_two_greys(kind: str, expected: float) -> None:
    """Lower 0.2, upper 0.6, factor one half."""
    a, b, half = constant((0.2,) * 3), constant((0.6,) * 3), constant(0.5)
    assert value_of(BLEND[kind](a, b, half)) == pytest.approx([expected] * 3, abs=1e-4)


def test_hsv_and_hsl() -> None:
    orange = constant((1.0, 0.5, 0.0))
    assert value_of(rgb_to_hsv(orange)) == pytest.approx([1 / 12, 1.0, 1.0], abs=1e-4)
    assert value_of(rgb_to_hsl(orange)) == pytest.approx([1 / 12, 1.0, 0.5], abs=1e-4)
    for color in ((0.1, 0.7, 0.3), (0.9, 0.2, 0.8), (0.5, 0.5, 0.5), (0.0, 0.0, 0.0), (1.0, 0.0, 0.2)):
        assert value_of(hsv_to_rgb(rgb_to_hsv(constant(color)))) == pytest.approx(color, abs=1e-4)
        assert value_of(hsl_to_rgb(rgb_to_hsl(constant(color)))) == pytest.approx(color, abs=1e-4)
    assert value_of(BLEND["HUE"](orange, constant((0.0, 0.0, 1.0)), constant(1.0))) == pytest.approx([0.0, 0.0, 1.0])


def test_blackbody_is_near_blenders() -> None:
    """Blender's light of 3000 K has the colour 1.7708, 0.8443, 0.2722."""
    assert blackbody_rgb(3000.0) == pytest.approx([1.7708, 0.8443, 0.2722], rel=0.015)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("POINT", [0.9, 2.2, 0.3]),
        ("TEXTURE", [-0.975, 0.45, -0.075]),
        ("VECTOR", [-0.1, 0.2, 0.0]),
        ("NORMAL", [-0.447214, 0.894427, 0.0]),
    ],
)
def test_mapping(kind: str, expected: list[float]) -> None:
    """(0.1, 0.05, 0) scaled by (2, 2, 4) and turned by 90 degrees about z, moved by (1, 2, 0.3).

    As TEXTURE the other way round: back by the location is (-0.9, -1.95, -0.3), turned back (-1.95, 0.9, -0.3), halved.
    """
    mapped = node(
        "M", "Mapping", Vector=(0.1, 0.05, 0.0), Location=(1.0, 2.0, 0.3), Rotation=(0.0, 0.0, float(np.pi / 2)),
        Scale=(2.0, 2.0, 4.0), p_vector_type=kind,
    )  # fmt: skip
    bright = node("B", "VectorMath", Vector="M.Vector", Vector_001=(5.0, 5.0, 5.0), p_operation="ADD")
    result = compiled(material(mapped, bright, node("E", "Emission", Color="B.Vector", Strength=1.0), surface="E.E"))
    assert result.materials[0].parameters[0, :3] - 5.0 == pytest.approx(expected, abs=1e-5)


def test_color_becomes_number_by_luminance_vector_by_mean() -> None:
    color = Node("C", "ShaderNodeRGB", output_values={"Color": (1.0, 0.0, 0.0, 1.0)})
    result = compiled(material(color, node("E", "Emission", Color=(1.0,) * 4, Strength="C.Color"), surface="E.E"))
    assert result.materials[0].parameters[0, 0] == pytest.approx(0.2126)
    vector = node("C", "CombineXYZ", X=3.0, Y=0.0, Z=0.0)
    result = compiled(material(vector, node("E", "Emission", Color=(1.0,) * 4, Strength="C.Vector"), surface="E.E"))
    assert result.materials[0].parameters[0, 0] == pytest.approx(1.0)


def test_mix_of_shaders_adds_reflectances() -> None:
    red = node("R", "BsdfDiffuse", Color=(1.0, 0.0, 0.0, 1.0))
    mirror = node("G", "BsdfAnisotropic", Color=(0.5, 0.5, 0.5, 1.0), Roughness=0.0, p_distribution="GGX")
    both = node("M", "MixShader", Fac=0.25, Shader="R.BSDF", Shader_001="G.BSDF")
    parameters = compiled(material(red, mirror, both, surface="M.Shader")).materials[0].parameters
    assert parameters[0, :3] == pytest.approx([0.75, 0.0, 0.0])
    assert parameters[1, :3] == pytest.approx([0.125] * 3) and parameters[2, :3] == pytest.approx([0.125] * 3)
    assert parameters[0, 3] == 0.0  # the roughness is the mirror's: diffuse has none to say


# --- odd input --------------------


def test_unknown_nodes_are_named_and_neutral() -> None:
    noise = node("Grain", "TexNoise", Scale=5.0)
    result = compiled(material(noise, principled(Base_Color="Grain.Color"), surface="P.BSDF", name="Rock"))
    assert result.warnings == [
        "material 'Rock': node 'Grain' (TexNoise) is not supported; a neutral value takes its place"
    ]
    result = compiled(material(node("S", "BsdfMagic"), surface="S.BSDF"))
    assert result.families[0].has_diffuse and "'S' (BsdfMagic)" in result.warnings[0]


def test_missing_layers_of_principled_are_named_only_when_used() -> None:
    quiet = compiled(material(principled(Coat_Weight=0.0, Transmission_Weight=0.0), surface="P.BSDF"))
    assert not quiet.warnings
    loud = compiled(material(principled(Sheen_Weight=0.5), surface="P.BSDF"))
    assert "sheen" in loud.warnings[0]


def test_edge_tint_is_the_colour_at_82_degrees() -> None:
    """F(1/7) = tint * Schlick(1/7); head on it does nothing."""
    base, tint = constant((0.8, 0.5, 0.2)), constant((0.5, 0.8, 0.0))
    for cosine, expected in ((1 / 7, (0.5, 0.8, 0.0)), (1.0, (1.0, 1.0, 1.0))):
        lobe = metal(base, tint, constant(0.1), constant(cosine), False)
        share = (1.0 - cosine) ** 5
        found = (1.0 - share) * lobe.f0.value + share * lobe.f90.value
        schlick = base.value + (1.0 - base.value) * share
        np.testing.assert_allclose(found, schlick * expected, atol=1e-4)


def test_features_of_glass_and_coat() -> None:
    plain = compiled(material(principled(Roughness=0.4), surface="P.BSDF")).families[0]
    assert plain.has_specular and not plain.has_transmission and not plain.has_coat
    glass = compiled(material(principled(Transmission_Weight=1.0), surface="P.BSDF")).families[0]
    assert glass.has_transmission and not glass.has_diffuse and not glass.has_transparency
    coated = compiled(material(principled(Coat_Weight=0.5, Coat_Roughness=0.1), surface="P.BSDF"))
    assert coated.families[0].has_coat and coated.families[0].has_diffuse
    assert coated.materials[0].least_roughness == pytest.approx(0.1)


def test_circles_end() -> None:
    a = node("A", "Math", Value="B.Value", Value_001=1.0)
    b = node("B", "Math", Value="A.Value", Value_001=1.0)
    result = compiled(material(a, b, node("E", "Emission", Strength="A.Value", Color=(1.0,) * 4), surface="E.E"))
    assert "circle" in result.warnings[0]
    shader = node("M", "MixShader", Fac=0.5, Shader="M.Shader")
    assert "circle" in compiled(material(shader, surface="M.Shader")).warnings[0]


def test_long_chains() -> None:
    """Longer than Python allows functions within each other; of values, and of shaders."""
    count = 3000
    chain = [node("N0", "NewGeometry"), node("N1", "Math", Value="N0.Backfacing", Value_001=1.0)]
    chain += [node(f"N{i}", "Math", Value=f"N{i - 1}.Value", Value_001=1.0) for i in range(2, count)]
    result = compile_materials(
        [material(*chain, node("E", "Emission", Strength=f"N{count - 1}.Value"), surface="E.E", name="Long")]
    )
    assert result.warnings == []
    assert result.families[0].source.count(" + ") >= count - 1
    shaders = [node("S0", "Emission", Color=(1.0,) * 4, Strength=1.0), principled("S1")]
    shaders += [node(f"S{i}", "AddShader", Shader=f"S{i - 1}.Shader", Shader_001="S0.Shader") for i in range(2, count)]
    shaders = [
        replace(n, inputs={k: replace(s, kind="SHADER") if s.link else s for k, s in n.inputs.items()}) for n in shaders
    ]
    result = compile_materials([material(*shaders, surface=f"S{count - 1}.Shader", name="Long")])
    assert result.warnings == []
    assert result.families[0].has_diffuse and result.families[0].has_emission


def test_long_chain_is_glsl() -> None:
    chain = [node("N0", "NewGeometry"), node("N1", "Math", Value="N0.Backfacing", Value_001=1.0)]
    chain += [node(f"N{i}", "Math", Value=f"N{i - 1}.Value", Value_001=1.0) for i in range(2, 300)]
    assert not compiled(material(*chain, node("E", "Emission", Strength="N299.Value"), surface="E.E")).warnings


def test_broken_links() -> None:
    result = compiled(material(principled(Base_Color="gone.Color"), surface="P.BSDF"))
    assert result.families[0].has_diffuse


def test_values_that_are_no_numbers() -> None:
    result = compiled(material(principled(Roughness=float("nan"), IOR=float("inf")), surface="P.BSDF"))
    assert np.isfinite(result.materials[0].parameters).all()
    odd = Node("P", "ShaderNodeBsdfPrincipled", {"Base Color": Socket("Base Color", "STRING", "text")})
    assert np.isfinite(compiled(material(odd, surface="P.BSDF")).materials[0].parameters).all()


def test_material_without_nodes_is_its_viewport_colour() -> None:
    result = compiled(MaterialData("plain", None, color=(0.1, 0.2, 0.3)))
    assert result.materials[0].parameters[0, :3] == pytest.approx([0.1, 0.2, 0.3])


def test_too_many_tiles_are_said() -> None:
    tiles = {1001 + i: image(str(i)).tiles[1001] for i in range(14)}
    texture = node("T", "TexImage", image=ImageSet("set", tiles, is_udim=True))
    made = material(texture, principled(Base_Color="T.Color"), surface="P.BSDF")
    result = compile_materials([made], max_textures=24)
    assert result.families[0].textures == 12 and "14 tiles" in result.warnings[0]
    # A driver that binds fewer: the rest become plain colours, and are named.
    few = compile_materials([made], max_textures=8)
    assert few.families[0].textures == 8 and any(
        "'9'" in warning and "plain colour" in warning for warning in few.warnings
    )


# --- worlds --------------------


def test_world_of_one_colour_and_without_nodes() -> None:
    assert compile_world(None).radiance == pytest.approx([0.0, 0.0, 0.0])
    assert compile_world(WorldData("w", None, (0.1, 0.2, 0.3))).radiance == pytest.approx([0.1, 0.2, 0.3])
    background = node("B", "Background", Color=(0.5, 0.25, 0.0, 1.0), Strength=2.0)
    graph = material(background, surface="B.Background").graph
    assert compile_world(WorldData("w", graph)).radiance == pytest.approx([1.0, 0.5, 0.0])


def test_world_of_camera_rays_takes_the_lighting_branch() -> None:
    nodes = [
        node("L", "LightPath"), node("A", "Background", Color=(1.0,) * 4, Strength=1.0),
        node("B", "Background", Color=(1.0,) * 4, Strength=9.0),
        node("M", "MixShader", Fac="L.Is Camera Ray", Shader="A.Background", Shader_001="B.Background"),
    ]  # fmt: skip
    world = compile_world(WorldData("w", material(*nodes, surface="M.Shader").graph))
    assert world.radiance == pytest.approx([1.0, 1.0, 1.0]) and "light" in world.warnings[0]


def test_environment_texture_is_a_function_of_direction() -> None:
    sky = node("T", "TexEnvironment", image=image("sky"))
    graph = material(sky, node("B", "Background", Color="T.Color", Strength=1.0), surface="B.Background").graph
    world = compile_world(WorldData("w", graph))
    assert world.radiance is None and world.source is not None
    assert "vec3 evaluate_world(vec3 direction_ws)" in world.source and len(world.textures) == 1


def test_empty_graph_is_black() -> None:
    result = compiled(MaterialData("none", NodeGraph({}, None)))
    assert not result.families[0].has_diffuse and "'none' has no output" in result.warnings[0]
