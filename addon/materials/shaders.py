# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes -> closures. Energy follows Cycles' Principled BSDF; what is approximated is said by name."""

from __future__ import annotations

from .closure import ONE, ZERO, Closure, Lobe, mean_fresnel, mixed
from .expression import (
    Expr,
    clamp,
    leaf,
    literal,
    maximum,
    minimum,
    mix,
    operation,
    power,
    select,
    sqrt,
    structural,
    unless_zero,
)
from .graph import Node
from .nodes_input import fresnel_dielectric
from .reader import GraphReader, shader_node

WHITE = literal((1.0, 1.0, 1.0))


def dielectric_f0(ior: Expr) -> Expr:
    """Reflectance at normal incidence of a smooth dielectric in air: ((ior - 1) / (ior + 1))^2."""
    ratio = (ior - 1.0) / (ior + 1.0)
    return ratio * ratio


def ior_of_f0(f0: Expr) -> Expr:
    """The index of refraction, at least 1, of a dielectric that reflects f0 at normal incidence."""
    root = sqrt(minimum(f0, 0.99))
    return (1.0 + root) / (1.0 - root)


def mean_albedo(roughness: Expr) -> Expr:
    """Cosine-weighted mean over the hemisphere of what a GGX lobe of no absorption reflects in one scattering.

    Fitted to the integral of the same lobe as ``specular_scale_bias`` (largest error 0.002).
    """
    squared = roughness * roughness
    return 1.0 - squared * (2.09143 * roughness - 1.24076 * squared - 0.26121)


def specular_cosine(reader: GraphReader, normal: Expr) -> Expr:
    """Cosine between the viewer and the normal that reflection takes: made valid, so that nothing mirrors downwards."""
    if reader.is_world:
        return literal(1.0)
    return leaf("specular_cosine") if normal is leaf("normal_ws") else operation("specular_cosine", normal)


def with_energy(lobe: Lobe, cosine: Expr, keeps_energy: bool) -> tuple[Lobe, Expr]:
    """(the lobe, its directional albedo); ``keeps_energy`` adds what single scattering loses.

    The light lost, 1 - E of a lobe that absorbs nothing, comes back after more scatterings, each of which absorbs:
    Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks", applied as a factor on the lobe as in
    Turquin 2019, "Practical multiple scattering compensation for microfacet models".
    """
    if not lobe.is_there:
        return lobe, ZERO
    split = operation("specular_split", cosine, lobe.roughness, lobe.ior)
    albedo = lobe.f0 * split.x + lobe.f90 * split.y
    if not keeps_energy:
        return lobe, albedo
    whole = split.x + split.y
    fresnel, mean = mean_fresnel(lobe.f0, lobe.f90), mean_albedo(lobe.roughness)
    later = fresnel * mean / (1.0 - fresnel * (1.0 - mean))
    scale = 1.0 + later * ((1.0 - whole) / maximum(whole, 0.1))
    return lobe.scaled(scale), albedo * scale


def largest(color: Expr) -> Expr:
    """What a tinted gloss takes from the layer below is grey, as in Cycles."""
    return color if color.type == "float" else maximum(maximum(color.x, color.y), color.z)


def metal(base: Expr, edge: Expr, roughness: Expr, cosine: Expr, keeps_energy: bool) -> Lobe:
    """Schlick's Fresnel curve of colour ``base``, times ``edge`` at 82 degrees.

    Kutz, Hasan and Edmondson 2021, "Novel aspects of the Adobe Standard Material": F = Schlick - b c (1 - c)^6, with b
    such that F(1/7) = edge Schlick(1/7). As a factor on the lobe by the angle to the normal, not to the facet.
    """
    lobe, _ = with_energy(Lobe(base, WHITE, roughness=roughness), cosine, keeps_energy)
    if edge.is_known and bool((edge.value == 1.0).all()):
        return lobe
    schlick = mix(base, WHITE, literal((6 / 7) ** 5))
    b = schlick * (1.0 - edge) * literal(7.0 / (6 / 7) ** 6)
    grazing = power(1.0 - cosine, literal(5.0))
    whole = mix(base, WHITE, grazing)
    return lobe.scaled(maximum(whole - b * (cosine * grazing * (1.0 - cosine)), 0.0) / maximum(whole, 1e-4))


def _keeps_energy(node: Node) -> bool:
    return node.properties.get("distribution", "MULTI_GGX") == "MULTI_GGX"


def _roughness(reader: GraphReader, node: Node, identifier: str = "Roughness", default: float = 0.5) -> Expr:
    return clamp(reader.number(node, identifier, default))


def _ior(reader: GraphReader, node: Node, identifier: str = "IOR", default: float = 1.5) -> Expr:
    return maximum(reader.number(node, identifier, default), 1e-5)


def _inwards(ior: Expr) -> Expr:
    """The index of refraction of what lies behind the surface as it is seen: inverted from inside."""
    return select(leaf("back_facing"), 1.0 / ior, ior)


def _is_zero(reader: GraphReader, node: Node, identifier: str) -> bool:
    return identifier not in node.inputs or reader.weight(node, identifier).is_literal(0.0)


_NOT_YET = {
    "Sheen Weight": "sheen", "Subsurface Weight": "subsurface scattering", "Thin Film Thickness": "thin film",
    "Anisotropic": "anisotropy", "Diffuse Roughness": "diffuse roughness",
}  # fmt: skip


@shader_node("ShaderNodeBsdfPrincipled")
def principled(reader: GraphReader, node: Node) -> Closure:
    """From the top: coat, emission, metal, glass, dielectric gloss, diffuse. Each gets what those above leave."""
    missing = [what for identifier, what in _NOT_YET.items() if not _is_zero(reader, node, identifier)]
    if missing:
        reader.warn(node, f"is rendered without {', '.join(missing)}")
    alpha = structural(clamp(reader.number(node, "Alpha", 1.0)))
    if alpha.is_literal(0.0):
        return Closure(transparency=ONE)
    base = maximum(reader.color(node, "Base Color", (0.8, 0.8, 0.8)), 0.0)
    metallic = structural(clamp(reader.number(node, "Metallic")))
    transmission = structural(clamp(reader.number(node, "Transmission Weight")))
    roughness = _roughness(reader, node)
    normal = reader.normal(node)
    cosine = specular_cosine(reader, normal)
    keeps_energy = _keeps_energy(node)

    given = _ior(reader, node)
    level = maximum(reader.number(node, "Specular IOR Level", 0.5), 0.0)
    reflectance = unless_zero(minimum(dielectric_f0(given) * 2.0 * level, 1.0))
    tint = maximum(reader.color(node, "Specular Tint", (1.0, 1.0, 1.0)), 0.0)
    gloss, albedo = Lobe(), ZERO
    if not reflectance.is_literal(0.0):
        gloss, albedo = with_energy(
            Lobe(reflectance * tint, WHITE, ior_of_f0(reflectance), roughness), cosine, keeps_energy
        )
    solid = (1.0 - metallic) * (1.0 - transmission)
    closure = Closure(
        diffuse=base * (1.0 - largest(albedo)) * solid,
        specular=gloss.scaled(solid).plus(
            metal(base, minimum(tint, 1.0), roughness, cosine, keeps_energy).scaled(metallic)
        ),
        normal=normal,
    )
    if not transmission.is_literal(0.0):
        glass = _principled_glass(reader, node, base, tint, given, roughness, cosine)
        closure = closure.plus(glass.scaled((1.0 - metallic) * transmission))
    strength = unless_zero(reader.number(node, "Emission Strength"))
    emission = unless_zero(reader.color(node, "Emission Color", (1.0, 1.0, 1.0))) * strength
    closure = closure.plus(Closure(emission=emission))
    coat = structural(clamp(reader.number(node, "Coat Weight")))
    if not coat.is_literal(0.0):
        closure = _coated(reader, node, closure, coat)
    return closure.scaled(alpha).plus(Closure(transparency=1.0 - alpha))


def _principled_glass(
    reader: GraphReader, node: Node, base: Expr, tint: Expr, ior: Expr, roughness: Expr, cosine: Expr
) -> Closure:
    """The colour is that of light that has gone in and out again."""
    f0, normal, through = dielectric_f0(ior) * tint, reader.normal(node), sqrt(base)
    if _is_zero(reader, node, "Thin Wall"):
        return Closure(glass=Lobe(f0, WHITE, _inwards(ior), roughness, through), normal=normal)
    # Both sides of a pane at once: r + t^2 r / (1 - r^2) = 2 r / (1 + r), and light goes straight on.
    once = fresnel_dielectric(cosine, maximum(ior, 1.0))
    twice = 2.0 / (1.0 + once)
    pane = Lobe(f0, WHITE, maximum(ior, 1.0), roughness).scaled(twice)
    return Closure(specular=pane, transparency=base * (1.0 - once * twice), normal=normal)


def _coated(reader: GraphReader, node: Node, below: Closure, weight: Expr) -> Closure:
    """A clear layer over everything. Its tint absorbs along the bent ray, as Cycles has it."""
    normal = reader.normal(node, "Coat Normal")
    cosine = specular_cosine(reader, normal)
    ior = maximum(reader.number(node, "Coat IOR", 1.5), 1.0)
    lobe = Lobe(dielectric_f0(ior), ONE, ior, _roughness(reader, node, "Coat Roughness", 0.03))
    lobe, albedo = with_energy(lobe, cosine, keeps_energy=True)
    passed = 1.0 - weight * albedo
    tint = maximum(reader.color(node, "Coat Tint", (1.0, 1.0, 1.0)), 0.0)
    if not (tint.is_known and bool((tint.value == 1.0).all())):
        bent = sqrt(1.0 - (1.0 - cosine * cosine) / (ior * ior))
        passed = mix(ONE, power(tint, 1.0 / maximum(bent, 1e-3)), weight) * passed
    over = below.scaled(passed)
    return Closure(
        over.diffuse, over.specular, over.glass, lobe.scaled(weight), over.emission, over.transparency, over.normal,
        normal,
    )  # fmt: skip


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
    normal = reader.normal(node)
    lobe = Lobe(color, color, roughness=_roughness(reader, node))
    lobe, _ = with_energy(lobe, specular_cosine(reader, normal), _keeps_energy(node))
    return Closure(specular=lobe, normal=normal)


@shader_node("ShaderNodeBsdfMetallic")
def metallic(reader: GraphReader, node: Node) -> Closure:
    if not _is_zero(reader, node, "Anisotropy") or not _is_zero(reader, node, "Thin Film Thickness"):
        reader.warn(node, "is rendered without anisotropy and thin film")
    edge = WHITE
    if node.properties.get("fresnel_type") == "PHYSICAL_CONDUCTOR":
        # Normal incidence on a conductor: ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
        n, k = reader.vector(node, "IOR"), reader.vector(node, "Extinction")
        color = ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k)
    else:
        edge = clamp(reader.color(node, "Edge Tint", (1.0, 1.0, 1.0)))
        color = reader.color(node, "Base Color", (0.617, 0.577, 0.54))
    normal = reader.normal(node)
    lobe = metal(color, edge, _roughness(reader, node), specular_cosine(reader, normal), _keeps_energy(node))
    return Closure(specular=lobe, normal=normal)


@shader_node("ShaderNodeBsdfGlass")
def glass(reader: GraphReader, node: Node) -> Closure:
    """A dielectric that tints what it reflects and what it lets through."""
    color, ior = reader.color(node, "Color", (1.0, 1.0, 1.0)), _ior(reader, node)
    lobe = Lobe(dielectric_f0(ior) * color, color, _inwards(ior), _roughness(reader, node, default=0.0), color)
    return Closure(glass=lobe, normal=reader.normal(node))


@shader_node("ShaderNodeBsdfRefraction")
def refraction(reader: GraphReader, node: Node) -> Closure:
    """Glass that reflects nothing: what its transmission leaves for reflection is given back, by angle."""
    color, normal = reader.color(node, "Color", (1.0, 1.0, 1.0)), reader.normal(node)
    ior = _inwards(_ior(reader, node, default=1.45))
    passed = 1.0 - fresnel_dielectric(specular_cosine(reader, normal), ior)
    lobe = Lobe(ior=ior, roughness=_roughness(reader, node, default=0.0), transmission=color / maximum(passed, 0.05))
    return Closure(glass=lobe, normal=normal)


@shader_node("ShaderNodeBsdfRayPortal")
def ray_portal(reader: GraphReader, node: Node) -> Closure:
    reader.warn(node, "lets light straight through")
    return Closure(transparency=reader.color(node, "Color", (1.0, 1.0, 1.0)))


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
    lobe = Lobe(
        reader.color(node, "Specular", (0.03, 0.03, 0.03)), WHITE, roughness=_roughness(reader, node, default=0.2)
    )
    return Closure(
        diffuse=reader.color(node, "Base Color", (0.8, 0.8, 0.8)),
        specular=lobe,
        emission=unless_zero(reader.color(node, "Emissive Color")),
        normal=reader.normal(node),
    ).scaled(opacity).plus(Closure(transparency=1.0 - opacity))  # fmt: skip
