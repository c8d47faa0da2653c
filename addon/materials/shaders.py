# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes -> closures. Energy follows Cycles' Principled BSDF; what is approximated is said by name."""

from __future__ import annotations

from .closure import ONE, ZERO, Closure, mean_fresnel, mixed
from .expression import Expr, clamp, literal, maximum, minimum, operation, structural, unless_zero
from .graph import Node
from .nodes_input import view_cosine
from .reader import GraphReader, shader_node


def dielectric_f0(ior: Expr) -> Expr:
    """Reflectance at normal incidence of a smooth dielectric in air: ((ior - 1) / (ior + 1))^2."""
    ratio = (ior - 1.0) / (ior + 1.0)
    return ratio * ratio


def grazing_reflectance(f0: Expr) -> Expr:
    """f90 of a dielectric: 1, but fading to 0 below f0 = 0.02 (ior 1.33), where the surface ceases to be one.

    Schlick's formula would else leave a rim of reflection on what does not reflect.
    """
    return minimum(f0 * 50.0, 1.0)


def with_energy(f0: Expr, f90: Expr, roughness: Expr, cosine: Expr, keeps_energy: bool) -> tuple[Expr, Expr, Expr]:
    """(f0, f90, directional albedo) of a GGX lobe; ``keeps_energy`` adds what single scattering loses.

    The factor 1 + F (1 - E) / E, with E the albedo of a lobe that reflects all and F its mean Fresnel reflectance, is
    Turquin's: "Practical multiple scattering compensation for microfacet models", Industrial Light & Magic 2019.
    """
    if f0.is_literal(0.0) and f90.is_literal(0.0):
        return f0, f90, ZERO
    split = operation("specular_split", cosine, roughness)
    albedo = f0 * split.x + f90 * split.y
    if keeps_energy:
        whole = split.x + split.y
        scale = 1.0 + mean_fresnel(f0, f90) * ((1.0 - whole) / maximum(whole, 0.1))
        return f0 * scale, f90 * scale, albedo * scale
    return f0, f90, albedo


def _keeps_energy(node: Node) -> bool:
    return node.properties.get("distribution", "MULTI_GGX") == "MULTI_GGX"


def _roughness(reader: GraphReader, node: Node, identifier: str = "Roughness", default: float = 0.5) -> Expr:
    return clamp(reader.number(node, identifier, default))


def _is_zero(reader: GraphReader, node: Node, identifier: str) -> bool:
    return identifier not in node.inputs or reader.weight(node, identifier).is_literal(0.0)


_NOT_YET = {
    "Transmission Weight": "transmission", "Coat Weight": "coat", "Sheen Weight": "sheen",
    "Subsurface Weight": "subsurface scattering", "Thin Film Thickness": "thin film", "Anisotropic": "anisotropy",
    "Diffuse Roughness": "diffuse roughness",
}  # fmt: skip


@shader_node("ShaderNodeBsdfPrincipled")
def principled(reader: GraphReader, node: Node) -> Closure:
    missing = [what for identifier, what in _NOT_YET.items() if not _is_zero(reader, node, identifier)]
    if missing:
        reader.warn(node, f"is rendered without {', '.join(missing)}")
    alpha = structural(clamp(reader.number(node, "Alpha", 1.0)))
    if alpha.is_literal(0.0):
        return Closure(transparency=ONE)
    base = maximum(reader.color(node, "Base Color", (0.8, 0.8, 0.8)), 0.0)
    metallic = structural(clamp(reader.number(node, "Metallic")))
    roughness = _roughness(reader, node)
    normal = reader.normal(node)
    cosine = view_cosine(reader, normal)
    dielectric = 1.0 - metallic

    level = maximum(reader.number(node, "Specular IOR Level", 0.5), 0.0)
    reflectance = unless_zero(minimum(dielectric_f0(maximum(reader.number(node, "IOR", 1.5), 1e-5)) * 2.0 * level, 1.0))
    tint = maximum(reader.color(node, "Specular Tint", (1.0, 1.0, 1.0)), 0.0)
    f0, f90, albedo = with_energy(
        reflectance * tint, grazing_reflectance(reflectance).rgb, roughness, cosine, _keeps_energy(node)
    )
    metal_f0, metal_f90, _ = with_energy(base, literal((1.0,) * 3), roughness, cosine, _keeps_energy(node))

    strength = unless_zero(reader.number(node, "Emission Strength"))
    emission = unless_zero(reader.color(node, "Emission Color", (1.0, 1.0, 1.0))) * strength
    return Closure(
        diffuse=base * (1.0 - albedo) * dielectric,
        specular_f0=f0 * dielectric + metal_f0 * metallic,
        specular_f90=f90 * dielectric + metal_f90 * metallic,
        roughness=roughness,
        emission=emission,
        normal=normal,
    ).scaled(alpha).plus(Closure(transparency=1.0 - alpha))  # fmt: skip


@shader_node("ShaderNodeBsdfDiffuse")
def diffuse(reader: GraphReader, node: Node) -> Closure:
    if not _is_zero(reader, node, "Roughness"):
        reader.warn(node, "is rendered without its roughness")
    return Closure(diffuse=reader.color(node, "Color", (0.8, 0.8, 0.8)), normal=reader.normal(node))


@shader_node("ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfGlossy")
def glossy(reader: GraphReader, node: Node) -> Closure:
    """A mirror of constant colour: f0 = f90."""
    if not _is_zero(reader, node, "Anisotropy"):
        reader.warn(node, "is rendered without anisotropy")
    color = reader.color(node, "Color", (0.8, 0.8, 0.8))
    roughness, normal = _roughness(reader, node), reader.normal(node)
    f0, f90, _ = with_energy(color, color, roughness, view_cosine(reader, normal), _keeps_energy(node))
    return Closure(specular_f0=f0, specular_f90=f90, roughness=roughness, normal=normal)


@shader_node("ShaderNodeBsdfMetallic")
def metallic(reader: GraphReader, node: Node) -> Closure:
    if not _is_zero(reader, node, "Anisotropy") or not _is_zero(reader, node, "Thin Film Thickness"):
        reader.warn(node, "is rendered without anisotropy and thin film")
    if node.properties.get("fresnel_type") == "PHYSICAL_CONDUCTOR":
        # Normal incidence on a conductor: ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
        n, k = reader.vector(node, "IOR"), reader.vector(node, "Extinction")
        color = ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k)
    else:
        if not reader.color(node, "Edge Tint", 1.0).is_literal(1.0):
            reader.warn(node, "is rendered without its edge tint")
        color = reader.color(node, "Base Color", (0.617, 0.577, 0.54))
    roughness, normal = _roughness(reader, node), reader.normal(node)
    white = literal((1.0,) * 3)
    f0, f90, _ = with_energy(color, white, roughness, view_cosine(reader, normal), _keeps_energy(node))
    return Closure(specular_f0=f0, specular_f90=f90, roughness=roughness, normal=normal)


@shader_node("ShaderNodeEmission", "ShaderNodeBackground")
def emission(reader: GraphReader, node: Node) -> Closure:
    color = unless_zero(reader.color(node, "Color", (1.0, 1.0, 1.0)))
    return Closure(emission=color * unless_zero(reader.number(node, "Strength", 1.0)))


@shader_node("ShaderNodeBsdfTransparent")
def transparent(reader: GraphReader, node: Node) -> Closure:
    return Closure(transparency=unless_zero(reader.color(node, "Color", (1.0, 1.0, 1.0))))


@shader_node("ShaderNodeMixShader")
def mix_shader(reader: GraphReader, node: Node) -> Closure:
    factor = structural(clamp(reader.number(node, "Fac", 0.5)))
    if factor.is_literal(0.0):
        return reader.closure(node, "Shader")
    if factor.is_literal(1.0):
        return reader.closure(node, "Shader_001")
    return mixed(reader.closure(node, "Shader"), reader.closure(node, "Shader_001"), factor)


@shader_node("ShaderNodeAddShader")
def add_shader(reader: GraphReader, node: Node) -> Closure:
    return reader.closure(node, "Shader").plus(reader.closure(node, "Shader_001"))


@shader_node("ShaderNodeHoldout")
def holdout(reader: GraphReader, node: Node) -> Closure:
    reader.warn(node, "cuts no hole yet; it is black")
    return Closure()


# --- stand-ins: what is nearest among the lobes there are --------------------


@shader_node("ShaderNodeBsdfGlass")
def glass(reader: GraphReader, node: Node) -> Closure:
    reader.warn(node, "lets light straight through instead of bending it")
    color, normal = reader.color(node, "Color", (1.0, 1.0, 1.0)), reader.normal(node)
    roughness = _roughness(reader, node, default=0.0)
    reflectance = dielectric_f0(maximum(reader.number(node, "IOR", 1.5), 1e-5))
    cosine = view_cosine(reader, normal)
    f0, f90, albedo = with_energy(reflectance * color, color, roughness, cosine, _keeps_energy(node))
    return Closure(
        specular_f0=f0, specular_f90=f90, roughness=roughness, transparency=color * (1.0 - albedo), normal=normal
    )


@shader_node("ShaderNodeBsdfRefraction", "ShaderNodeBsdfRayPortal")
def refraction(reader: GraphReader, node: Node) -> Closure:
    reader.warn(node, "lets light straight through instead of bending it")
    return Closure(transparency=reader.color(node, "Color", (1.0, 1.0, 1.0)))


@shader_node(
    "ShaderNodeBsdfTranslucent", "ShaderNodeBsdfSheen", "ShaderNodeBsdfToon", "ShaderNodeSubsurfaceScattering",
    "ShaderNodeBsdfHair", "ShaderNodeBsdfHairPrincipled", "ShaderNodeBsdfVelvet",
)  # fmt: skip
def as_diffuse(reader: GraphReader, node: Node) -> Closure:
    reader.warn(node, "is shown as diffuse of its colour")
    return Closure(diffuse=reader.color(node, "Color", (0.8, 0.8, 0.8)), normal=reader.normal(node))


@shader_node("ShaderNodeEeveeSpecular")
def specular(reader: GraphReader, node: Node) -> Closure:
    if not _is_zero(reader, node, "Clear Coat"):
        reader.warn(node, "is rendered without clear coat")
    opacity = structural(1.0 - clamp(reader.number(node, "Transparency")))
    f0 = reader.color(node, "Specular", (0.03, 0.03, 0.03))
    return Closure(
        diffuse=reader.color(node, "Base Color", (0.8, 0.8, 0.8)),
        specular_f0=f0,
        specular_f90=grazing_reflectance(maximum(maximum(f0.x, f0.y), f0.z)).rgb,
        roughness=_roughness(reader, node, default=0.2),
        emission=unless_zero(reader.color(node, "Emissive Color")),
        normal=reader.normal(node),
    ).scaled(opacity).plus(Closure(transparency=1.0 - opacity))  # fmt: skip
