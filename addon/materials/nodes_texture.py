# SPDX-License-Identifier: GPL-3.0-or-later
"""Image Texture and Environment Texture, and stand-ins for a sky."""

from __future__ import annotations

import math

from .expression import (
    VEC4,
    Expr,
    Sample,
    constant,
    dot,
    floor,
    layer_leaf,
    leaf,
    less,
    literal,
    maximum,
    normalize,
    operation,
    select,
    vec3,
)  # fmt: skip
from .graph import AlphaMode, ImageSet, Node
from .images import divides_by_alpha, image_as_read
from .nodes_input import uv
from .reader import GraphReader, value_node

#: Tiles of a UDIM set that one material may read: each takes a texture unit, of which GL promises 16 to a shader.
MOST_TILES = 12

MAGENTA = (1.0, 0.0, 1.0)  # Blender's colour of an image that is missing
_INTERPOLATION = {"Closest": "CLOSEST", "Cubic": "CUBIC", "Smart": "CUBIC"}


def footprint(expr: Expr, known: dict[int, Expr] | None = None) -> Expr:
    """Side of the area that a texture coordinate covers, from the footprint of the UV layers that it is made of.

    Follows scaling by numbers; anything else passes the largest footprint of its arguments on. 0 when the coordinate
    does not come from a UV map.
    """
    known = {} if known is None else known
    if id(expr) not in known:
        known[id(expr)] = _footprint(expr, known)
    return known[id(expr)]


def _footprint(expr: Expr, known: dict[int, Expr]) -> Expr:
    if expr.kind == "leaf":
        name, layer = expr.value
        return layer_leaf("uv_footprint", layer) if name == "uv" else literal(0.0)
    if expr.kind == "dot":
        # The rows of a rotation: the footprint stays.
        expr = next((arg for arg in expr.args if not arg.is_known), expr)
    if expr.kind in ("mul", "div"):
        for a, b in (expr.args, expr.args[::-1]) if expr.kind == "mul" else (expr.args,):
            if b.is_known:
                size = operation("abs", b)
                size = size if size.type == "float" else maximum(size.x, size.y)
                inner = footprint(a, known)
                return inner / size if expr.kind == "div" else inner * size
    if expr.kind == "sample":
        return literal(0.0)
    sizes: list[Expr] = []
    for arg in expr.args:
        size = footprint(arg, known)
        if not size.is_literal(0.0) and size not in sizes:
            sizes.append(size)
    answer = sizes[0] if sizes else literal(0.0)
    for size in sizes[1:]:
        answer = maximum(answer, size)
    return answer


def image_set(reader: GraphReader, node: Node) -> ImageSet | None:
    """The node's images, or None (with a message) when there are none to sample."""
    images = node.image
    if images is None:
        reader.warn(node, "has no image; it is magenta. Choose an image in the node")
        return None
    if images.problem:
        reader.warn(node, images.problem)
    return images if images.tiles else None


def _sample(reader: GraphReader, node: Node, images: ImageSet, coordinate: Expr, extension: str) -> Expr:
    tiles = sorted(images.tiles.items())
    if images.is_udim and len(tiles) > MOST_TILES:
        reader.warn(node, f"reads image '{images.name}' of {len(tiles)} tiles; only the first {MOST_TILES} are shown")
        tiles = tiles[:MOST_TILES]
    if not images.is_udim:
        tiles = [(1001, tiles[0][1])]
    interpolation = _INTERPOLATION.get(str(node.properties.get("interpolation", "Linear")), "LINEAR")
    is_alpha_used = reader.is_output_used(node, "Alpha")
    sample = Sample(
        tuple((number - 1001, image_as_read(image, is_alpha_used)) for number, image in tiles), images.is_udim,
        "EXTEND" if images.is_udim else extension, interpolation,
        divides=any(divides_by_alpha(image, is_alpha_used) for _, image in tiles),
    )  # fmt: skip
    return Expr(VEC4, "sample", (coordinate, footprint(coordinate)), sample)


@value_node("ShaderNodeTexImage")
def image_texture(reader: GraphReader, node: Node, output: str) -> Expr:
    images = image_set(reader, node)
    if images is None:
        return literal(1.0) if output == "Alpha" else literal(MAGENTA)
    if node.properties.get("projection", "FLAT") != "FLAT":
        reader.warn(node, f"projects as {str(node.properties['projection']).lower()}; it is shown flat")
    if reader.is_linked(node, "Vector"):
        coordinate = reader.vector(node, "Vector")
    else:
        coordinate = uv(reader, None)
    if coordinate.type == "float":
        coordinate = coordinate.rgb
    extension = str(node.properties.get("extension", "REPEAT"))
    texel = _shared_sample(reader, node, images, coordinate, extension)
    if output == "Alpha":
        return literal(1.0) if _is_opaque(images) else texel.w
    return texel.rgb


def _is_opaque(images: ImageSet) -> bool:
    return all(image.alpha_mode is AlphaMode.NONE for image in images.tiles.values())


def _shared_sample(reader: GraphReader, node: Node, images: ImageSet, coordinate: Expr, extension: str) -> Expr:
    """One look-up for all outputs of a node."""
    if node.name not in reader.samples:
        reader.samples[node.name] = _sample(reader, node, images, coordinate, extension)
    return reader.samples[node.name]


@value_node("ShaderNodeTexEnvironment")
def environment_texture(reader: GraphReader, node: Node, output: str) -> Expr:
    """Row 0 at the bottom: u = 0.5 - atan2(y, x) / 2 pi, v = 1 - acos(z) / pi; x+ is the middle of the image."""
    images = image_set(reader, node)
    if images is None:
        return literal(MAGENTA)
    default = leaf("direction_ws") if reader.is_world else leaf("position_ws")
    direction = normalize(reader.vector(node, "Vector") if reader.is_linked(node, "Vector") else default)
    if node.properties.get("projection") == "MIRROR_BALL":
        # The ball is seen along +y: the normal that reflects the view into the direction.
        half = normalize(direction + literal((0.0, -1.0, 0.0)))
        coordinate = vec3(half.x * 0.5 + 0.5, half.z * 0.5 + 0.5, 0.0)
    else:
        u = 0.5 - operation("atan2", direction.y, direction.x) * literal(0.5 / math.pi)
        coordinate = vec3(u, 1.0 - operation("acos", direction.z) * literal(1.0 / math.pi), 0.0)
    return _shared_sample(reader, node, images, coordinate, "REPEAT").rgb


@value_node("ShaderNodeTexSky")
def sky_texture(reader: GraphReader, node: Node, output: str) -> Expr:
    """A clear sky without its sun: from a pale horizon to a blue zenith, grey ground below."""
    reader.warn(node, "is shown as a plain gradient without a sun")
    direction = leaf("direction_ws") if reader.is_world else normalize(leaf("position_ws"))
    if reader.is_linked(node, "Vector"):
        direction = normalize(reader.vector(node, "Vector"))
    height = maximum(direction.z, 0.0)
    horizon, zenith, ground = (constant(c) for c in ((0.55, 0.65, 0.75), (0.12, 0.25, 0.55), (0.15, 0.15, 0.15)))
    sky = horizon + (zenith - horizon) * operation("sqrt", height)
    return select(less(direction.z, 0.0), ground, sky)


@value_node("ShaderNodeTexChecker")
def checker_texture(reader: GraphReader, node: Node, output: str) -> Expr:
    coordinate = procedural_coordinate(reader, node) * reader.number(node, "Scale", 5.0)
    cell = floor((coordinate + 1e-6) * literal(0.999999))
    odd = operation("fmod", operation("abs", cell.x + cell.y + cell.z), literal(2.0))
    if output == "Fac":
        return odd
    return select(odd, reader.color(node, "Color1"), reader.color(node, "Color2"))


def procedural_coordinate(reader: GraphReader, node: Node) -> Expr:
    """The Vector input; generated coordinates when nothing is linked."""
    if reader.is_linked(node, "Vector"):
        return reader.vector(node, "Vector")
    return leaf("direction_ws") if reader.is_world else leaf("generated")


@value_node("ShaderNodeTexGradient")
def gradient_texture(reader: GraphReader, node: Node, output: str) -> Expr:
    p = procedural_coordinate(reader, node)
    kind = node.properties.get("gradient_type", "LINEAR")
    clamped_x = operation("max", p.x, literal(0.0))
    t = operation("min", clamped_x, literal(1.0))
    sphere = maximum(0.999999 - operation("sqrt", dot(p, p)), 0.0)
    factor = {
        "LINEAR": p.x,
        "QUADRATIC": clamped_x * clamped_x,
        "EASING": t * t * (3.0 - 2.0 * t),
        "DIAGONAL": (p.x + p.y) * 0.5,
        "RADIAL": operation("atan2", p.y, p.x) * literal(0.5 / math.pi) + 0.5,
        "QUADRATIC_SPHERE": sphere * sphere,
        "SPHERICAL": sphere,
    }.get(str(kind), p.x)
    factor = operation("min", maximum(factor, 0.0), literal(1.0))
    return factor if output == "Fac" else factor.rgb
