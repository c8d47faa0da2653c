# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials and worlds -> GLSL and numbers. Materials of one structure share one text: a *family*.

Nothing here raises on odd input: what is not understood becomes a default and a warning that names it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from . import nodes_color, nodes_input, nodes_math, nodes_texture, shaders  # noqa: F401  they register their nodes
from .closure import ONE, Closure
from .emit import LEAST_TEXTURES, Emitter
from .expression import FLOAT, VEC3, Expr, constant, leaf, unless_zero
from .graph import ImageData, MaterialData, NodeGraph, WorldData
from .reader import GraphReader

FloatArray = npt.NDArray[np.float32]


@dataclass(frozen=True)
class TextureBinding:
    """What a sampler slot holds for one material."""

    image: int  # index into ``images`` of what was compiled
    extension: str  # REPEAT, EXTEND, CLIP (transparent outside: the shader does it), MIRROR
    interpolation: str  # LINEAR, CLOSEST, CUBIC


@dataclass(frozen=True)
class MaterialFamily:
    """One ``evaluate_material`` and what it reads.

    ``source`` uses ``vec4 material_parameter(int)`` and ``uniform sampler2D material_texture_0 ...`` (mip-mapped, sRGB
    decoded by the hardware), which the including program declares before it, after lib/surface.glsl.
    """

    source: str
    uv_layers: int
    color_layers: int
    textures: int  # sampler slots
    parameters: int  # vec4
    has_diffuse: bool
    has_specular: bool
    has_transmission: bool
    has_coat: bool
    has_emission: bool
    has_transparency: bool
    reads_normal: bool  # bends the normal
    is_constant: bool  # nothing varies over a surface, but for the angle to the viewer
    emission_varies: bool  # over one triangle
    transparency_varies: bool  # likewise


@dataclass(frozen=True, eq=False)
class CompiledMaterial:
    """One material's share of its family."""

    name: str
    family: int
    parameters: FloatArray  # (P, 4)
    textures: tuple[TextureBinding, ...]
    uv_layers: tuple[str | None, ...]  # names in slot order; None: the active layer
    color_layers: tuple[str | None, ...]
    least_roughness: float  # of what is glossy; 0 where it varies, 1 when nothing is glossy


@dataclass(frozen=True, eq=False)
class CompiledMaterials:
    families: list[MaterialFamily]
    materials: list[CompiledMaterial]  # in the order given
    images: list[ImageData]  # each once
    warnings: list[str]


@dataclass(frozen=True, eq=False)
class CompiledWorld:
    """``radiance`` when the world is the same in all directions, else ``source``.

    ``source`` defines ``vec3 evaluate_world(vec3 direction_ws)`` and uses ``vec4 world_parameter(int)`` and
    ``uniform sampler2D world_texture_0 ...``.
    """

    name: str
    radiance: FloatArray | None  # (3,) W/(m2 sr)
    source: str | None = None
    parameters: FloatArray = field(default_factory=lambda: np.zeros((0, 4), np.float32))
    textures: tuple[TextureBinding, ...] = ()
    images: list[ImageData] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def compile_materials(
    materials: Sequence[MaterialData], uv_layers: Collection[str] = (), max_textures: int = LEAST_TEXTURES
) -> CompiledMaterials:
    """Compiles all materials of a scene. ``uv_layers``: names of UV layers there are, for Attribute nodes.
    ``max_textures``: images that one material can have; the others become their mean colour."""
    families: dict[MaterialFamily, int] = {}
    images: list[ImageData] = []
    warnings: list[str] = []
    compiled = []
    for material in materials:
        read = frozenset(uv_layers), max_textures
        found = _known.get(material)
        if found is None or found[0] != read:
            found = _known[material] = read, _compile(material, *read)
        made = found[1]
        warnings += [message for message in made.messages if message not in warnings]
        compiled.append(
            CompiledMaterial(
                material.name,
                families.setdefault(made.family, len(families)),
                made.parameters,
                _bindings(made.emitter, images),
                tuple(made.emitter.uv_layers),
                tuple(made.emitter.color_layers),
                made.least_roughness,
            )
        )
    return CompiledMaterials(list(families), compiled, images, warnings)


@dataclass(frozen=True, eq=False)
class _Compiled:
    """One material by itself."""

    family: MaterialFamily
    emitter: Emitter
    parameters: FloatArray
    messages: list[str]
    least_roughness: float


#: Materials that were compiled, for as long as they are used, and what they were compiled for: of a scene that is
#: edited one material changes, and the others are the same objects.
_known: WeakKeyDictionary[MaterialData, tuple[tuple[frozenset[str], int], _Compiled]] = WeakKeyDictionary()


def _compile(material: MaterialData, uv_layers: Collection[str], max_textures: int) -> _Compiled:
    closure, messages = _material_closure(material, uv_layers)
    try:
        family, emitter, parameters = _emit_material(closure, max_textures)
        messages += _left_out(_owner(material), emitter)
    except (RecursionError, ArithmeticError, KeyError, TypeError, ValueError, IndexError) as error:
        messages.append(_failure(_owner(material), error))
        closure = _default_closure(material)
        family, emitter, parameters = _emit_material(closure, max_textures)
    return _Compiled(family, emitter, parameters, messages, _least_roughness(closure))


def _owner(material: MaterialData) -> str:
    return f"material '{material.name}'"


def _failure(owner: str, error: Exception) -> str:
    return f"{owner} could not be compiled and is shown in its viewport colour ({type(error).__name__}: {error})"


def _default_closure(material: MaterialData) -> Closure:
    """A material without nodes: diffuse of its viewport colour, as in Cycles."""
    return Closure(diffuse=constant(tuple(material.color)))


def _material_closure(material: MaterialData, uv_layers: Collection[str]) -> tuple[Closure, list[str]]:
    if material.graph is None:
        return _default_closure(material), []
    owner = _owner(material)
    reader = GraphReader(material.graph, owner, uv_layers=uv_layers)
    try:
        closure = _output_closure(reader, material.graph)
    except (RecursionError, ArithmeticError, KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        return _default_closure(material), [*reader.warnings, _failure(owner, error)]
    return closure, reader.warnings


def _output_closure(reader: GraphReader, graph: NodeGraph) -> Closure:
    output = graph.nodes.get(graph.output) if graph.output is not None else None
    if output is None:
        reader.warnings.append(f"{reader.owner} has no output node and is black; add one and connect a shader to it")
        return Closure()
    if reader.is_linked(output, "Displacement"):
        reader.warn(output, "has displacement, which is not rendered")
    if reader.is_linked(output, "Volume"):
        reader.warn(output, "has a volume, which is not rendered")
        if not reader.is_linked(output, "Surface"):
            return Closure(transparency=ONE)
    return reader.closure(output, "Surface")


def _least_roughness(closure: Closure) -> float:
    """Of all lobes; 1 when there are none."""
    known = [float(lobe.roughness.value) if lobe.roughness.is_known else 0.0 for lobe in closure.lobes]
    return min(known, default=1.0)


def _bindings(emitter: Emitter, images: list[ImageData]) -> tuple[TextureBinding, ...]:
    bindings = []
    for image, extension, interpolation in emitter.textures:
        index = next((i for i, other in enumerate(images) if other is image), None)
        if index is None:
            index = len(images)
            images.append(image)
        bindings.append(TextureBinding(index, extension, interpolation))
    return tuple(bindings)


_INCLUDES = ['#include "lib/closure.glsl"', '#include "lib/material_nodes.glsl"', ""]


def _function(signature: str, emitter: Emitter, results: list[str]) -> tuple[str, FloatArray]:
    declarations, parameters = emitter.parameters()
    body = [f"    {line}" for line in (*declarations, *emitter.statements, *results)]
    return "\n".join([*_INCLUDES, signature + " {", *body, "}", ""]), parameters


def _left_out(owner: str, emitter: Emitter) -> list[str]:
    if not emitter.left_out:
        return []
    names = ", ".join(f"'{name}'" for name in emitter.left_out)
    return [
        f"{owner} has more images than this graphics driver reads at once ({emitter.max_textures}): {names} "
        "became a plain colour; use fewer images or UDIM tiles"
    ]


def _normal(emitter: Emitter, normal: Expr) -> str:
    return "p.normal_ws" if normal is leaf("normal_ws") else f"valid_normal({emitter.write(normal)}, p.normal_ws)"


def _emit_material(closure: Closure, max_textures: int) -> tuple[MaterialFamily, Emitter, FloatArray]:
    emitter = Emitter("material", max_textures)
    # Field, value, type, largest value: more than 1 in specular makes up for what single scattering loses; what is
    # seen reflects as much as its colour says, as in Cycles (pictures hold 65504, where opacity is a thousandth), while
    # voxels reflect no more than all (pass voxel_accumulate): light between them has an end.
    fields: list[tuple[str, Expr, str, str]] = [
        ("diffuse", closure.diffuse, VEC3, "16.0"),
        ("specular_f0", closure.specular.f0, VEC3, "4.0"),
        ("specular_f90", closure.specular.f90, VEC3, "4.0"),
        ("specular_ior", closure.specular.ior, FLOAT, "100.0"),
        ("roughness", closure.specular.roughness, FLOAT, "1.0"),
        ("glass_f0", closure.glass.f0, VEC3, "4.0"),
        ("glass_f90", closure.glass.f90, VEC3, "4.0"),
        ("glass_transmission", closure.glass.transmission, VEC3, "20.0"),
        ("glass_ior", closure.glass.ior, FLOAT, "100.0"),
        ("glass_roughness", closure.glass.roughness, FLOAT, "1.0"),
        ("coat", closure.coat.f90, FLOAT, "4.0"),
        ("coat_ior", closure.coat.ior, FLOAT, "100.0"),
        ("coat_roughness", closure.coat.roughness, FLOAT, "1.0"),
        ("emission", closure.emission, VEC3, "1e30"),
        ("transparency", closure.transparency, VEC3, "1.0"),
    ]
    results = []
    for name, expr, type, highest in fields:
        expr = unless_zero(expr)
        text = emitter.write_as(expr, type)
        results.append(f"s.{name} = {text};" if expr.kind == "literal" else f"s.{name} = valid({text}, {highest});")
    results.append(f"s.normal_ws = {_normal(emitter, closure.normal)};")
    default_normal = closure.normal is leaf("normal_ws")
    varying = bool(emitter.textures) or bool(emitter.leaves - {"view_cosine", "specular_cosine"})
    coat_bends = closure.coat.is_there and closure.coat_normal is not closure.normal
    results.append(f"s.coat_bends = {str(coat_bends).lower()};")
    results.append(f"s.coat_normal_ws = {_normal(emitter, closure.coat_normal) if coat_bends else 's.normal_ws'};")
    source, parameters = _function("void evaluate_material(in ShadingPoint p, out Surface s)", emitter, results)
    transparency_varies = _varies(closure.transparency)
    family = MaterialFamily(
        source=source,
        uv_layers=len(emitter.uv_layers),
        color_layers=len(emitter.color_layers),
        textures=len(emitter.textures),
        parameters=len(parameters),
        has_diffuse=not unless_zero(closure.diffuse).is_literal(0.0),
        has_specular=bool(closure.lobes),
        has_transmission=closure.glass.is_there,
        has_coat=closure.coat.is_there,
        has_emission=not unless_zero(closure.emission).is_literal(0.0),
        has_transparency=not unless_zero(closure.transparency).is_literal(0.0),
        reads_normal=not default_normal,
        is_constant=default_normal and not varying,
        emission_varies=_varies(closure.emission) or transparency_varies,
        transparency_varies=transparency_varies,
    )
    return family, emitter, parameters


#: What differs from point to point of one flat triangle.
_PLACES = {"position_ws", "position_os", "generated", "uv", "color"}


def _varies(expr: Expr) -> bool:
    pending, seen = [expr], set()
    while pending:
        current = pending.pop()
        if id(current) in seen:
            continue
        seen.add(id(current))
        if current.kind == "leaf" and current.value[0] in _PLACES:
            return True
        pending.extend(current.args)
    return False


def compile_world(world: WorldData | None) -> CompiledWorld:
    """Radiance of the surroundings. None: black."""
    if world is None:
        return CompiledWorld("", np.zeros(3, np.float32))
    if world.graph is None:
        return CompiledWorld(world.name, np.asarray(world.color, dtype=np.float32))
    owner = f"world '{world.name}'"
    reader = GraphReader(world.graph, owner, is_world=True)
    try:
        output = world.graph.nodes.get(world.graph.output) if world.graph.output is not None else None
        if output is not None and reader.is_linked(output, "Volume"):
            reader.warn(output, "has a volume, which is not rendered")
        radiance = unless_zero(reader.closure(output, "Surface").emission) if output is not None else constant(0.0)
        if radiance.is_known:
            color = np.maximum(np.broadcast_to(radiance.value, 3), 0.0).astype(np.float32)
            return CompiledWorld(world.name, color, warnings=reader.warnings)
        emitter = Emitter("world")
        result = f"return valid({emitter.write_as(radiance, VEC3)}, 1e30);"
        source, parameters = _function("vec3 evaluate_world(vec3 direction_ws)", emitter, [result])
    except (RecursionError, ArithmeticError, KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        message = f"{owner} could not be compiled and has one colour ({type(error).__name__}: {error})"
        color = np.asarray(world.color, dtype=np.float32)
        return CompiledWorld(world.name, color, warnings=[*reader.warnings, message])
    images: list[ImageData] = []
    bindings = _bindings(emitter, images)
    messages = [*reader.warnings, *_left_out(owner, emitter)]
    return CompiledWorld(world.name, None, source, parameters, bindings, images, messages)
