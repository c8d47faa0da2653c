# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions -> GLSL. Equal expressions are written once; parameters, layers and textures get slots in order of use.

The text depends on the structure alone: two materials that differ in numbers, images and layer names get the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from .expression import FLOAT, VEC3, VEC4, Expr, Ramp, Sample
from .graph import ImageData, ImageEncoding
from .operations import OPERATIONS

_LEAF_GLSL = {
    "position_ws": "p.position_ws", "position_os": "p.position_os", "generated": "p.generated",
    "normal_ws": "p.normal_ws", "normal_os": "p.normal_os", "geometric_normal_ws": "p.geometric_normal_ws",
    "incoming_ws": "p.incoming_ws", "back_facing": "float(p.back_facing)", "object_random": "p.object_random",
    "object_index": "p.object_index", "object_position_ws": "p.object_position_ws", "direction_ws": "direction_ws",
    "specular_cosine": "specular_cosine(p.geometric_normal_ws, p.incoming_ws, p.normal_ws)",
    "view_cosine": "abs(dot(p.normal_ws, p.incoming_ws))",
}  # fmt: skip
_LAYER_GLSL = {
    "uv": "vec3(p.uv[{}], 0.0)", "uv_tangent": "p.uv_tangent_ws[{}]", "uv_bitangent": "p.uv_bitangent_ws[{}]",
    "uv_footprint": "p.uv_footprint[{}]", "color": "p.color[{}]",
}  # fmt: skip

_INFIX = ("add", "sub", "mul")  # GLSL mixes float and vec3 in these
_COMPONENTS = {FLOAT: "", VEC3: "xyz", VEC4: "xyzw"}


def number_text(value: float) -> str:
    """A float literal of GLSL."""
    text = f"{float(value):.9g}"
    return text if any(c in text for c in ".e") else text + ".0"


def _literal_text(value: npt.NDArray[np.float64]) -> str:
    if value.ndim == 0:
        return number_text(float(value))
    same = bool((value == value[0]).all())
    return f"vec{len(value)}({', '.join(number_text(v) for v in (value[:1] if same else value))})"


#: Samplers that every GL 4.3 driver has left for a material's images.
LEAST_TEXTURES = 8


def mean_colour(image: ImageData) -> npt.NDArray[np.float64]:
    """RGBA, linear: what an image looks like from afar. sRGB is undone after the mean, which is near enough."""
    mean: npt.NDArray[np.float64] = image.pixels.reshape(-1, 4).mean(axis=0, dtype=np.float64)
    if image.pixels.dtype == np.uint8:
        mean = mean / 255.0
        if image.encoding is ImageEncoding.SRGB:
            mean[:3] = mean[:3] ** 2.2
    return mean


@dataclass(eq=False)
class Emitter:
    """Writes the statements of one function and remembers which slots they use.

    ``prefix`` is 'material' or 'world': names of the textures and of the parameter function start with it. Images
    beyond ``max_textures`` become their mean colour; their names are in ``left_out``.
    """

    prefix: str
    max_textures: int = LEAST_TEXTURES
    left_out: list[str] = field(default_factory=list)
    statements: list[str] = field(default_factory=list)
    uv_layers: list[str | None] = field(default_factory=list)
    color_layers: list[str | None] = field(default_factory=list)
    textures: list[tuple[ImageData, str, str]] = field(default_factory=list)  # image, extension, interpolation
    leaves: set[str] = field(default_factory=set)
    _names: dict[int, str] = field(default_factory=dict)  # id(expr) -> GLSL
    _by_key: dict[Any, str] = field(default_factory=dict)
    _constants: list[tuple[str, npt.NDArray[np.float64]]] = field(default_factory=list)
    _tables: list[tuple[str, npt.NDArray[np.float64]]] = field(default_factory=list)
    _kept: list[Expr] = field(default_factory=list)  # so that no id is used twice

    def write(self, expr: Expr) -> str:
        """GLSL of the value of ``expr``: a variable or a literal. Adds the statements it needs."""
        pending = [expr]
        while pending:
            current = pending[-1]
            if id(current) in self._names:
                pending.pop()
                continue
            missing = [arg for arg in current.args if id(arg) not in self._names]
            if missing:
                pending.extend(reversed(missing))
                continue
            pending.pop()
            self._kept.append(current)
            self._names[id(current)] = self._name(current)
        return self._names[id(expr)]

    def write_as(self, expr: Expr, type: str) -> str:
        text = self.write(expr)
        return f"vec3({text})" if type == VEC3 and expr.type == FLOAT else text

    def _name(self, expr: Expr) -> str:
        if expr.kind == "literal":
            return _literal_text(expr.value)
        if expr.kind == "constant":
            name = f"c{len(self._constants)}"
            self._constants.append((expr.type, expr.value))
            return name
        if expr.kind == "leaf":
            return self._leaf(*expr.value)
        args = [self._names[id(arg)] for arg in expr.args]
        key = (expr.kind, tuple(args), _value_key(expr.value))
        if key not in self._by_key:
            if expr.kind == "sample":
                text = self._sample(expr.value, *args)
                text = f"divided_by_alpha({text})" if expr.value.divides else text
            elif expr.kind == "ramp":
                text = self._ramp(expr.value, *args)
            else:
                text = self._operation(expr, args)
            self._by_key[key] = self._variable(expr.type, text)
        return self._by_key[key]

    def _variable(self, type: str, text: str) -> str:
        name = f"v{len(self.statements)}"
        self.statements.append(f"{type} {name} = {text};")
        return name

    def _leaf(self, name: str, layer: str | None) -> str:
        self.leaves.add(name)
        if name not in _LAYER_GLSL:
            return _LEAF_GLSL[name]
        layers = self.color_layers if name == "color" else self.uv_layers
        if layer not in layers:
            layers.append(layer)
        return _LAYER_GLSL[name].format(layers.index(layer))

    def _operation(self, expr: Expr, args: list[str]) -> str:
        spec = OPERATIONS[expr.kind]
        types = [arg.type for arg in expr.args]
        if spec.is_scalar and expr.type != FLOAT:
            parts = [
                spec.glsl.format(*(a if t == FLOAT else f"{a}.{c}" for a, t in zip(args, types, strict=True)))
                for c in _COMPONENTS[expr.type]
            ]
            return f"{expr.type}({', '.join(parts)})"
        if spec.result == "same" and expr.type == VEC3 and expr.kind not in _INFIX:
            args = [f"vec3({a})" if t == FLOAT else a for a, t in zip(args, types, strict=True)]
        return spec.glsl.format(*args)

    def _sample(self, sample: Sample, coordinate: str, footprint: str) -> str:
        function = "sample_image_clipped" if sample.extension == "CLIP" else "sample_image"
        if sample.is_udim:
            tile = self._variable(FLOAT, f"udim_tile({coordinate}.xy)")
            local = self._variable("vec2", f"fract({coordinate}.xy)")
            text = "vec4(1.0, 0.0, 1.0, 1.0)"
            texts = [self._image(image, sample, "sample_image", local, footprint) for _, image in sample.tiles]
            for (number, _), one in reversed(list(zip(sample.tiles, texts, strict=True))):
                text = f"{tile} == {number_text(number)} ? {one} :\n        {text}"
            return f"({text})"
        place = f"mirrored({coordinate}.xy)" if sample.extension == "MIRROR" else f"{coordinate}.xy"
        return self._image(sample.tiles[0][1], sample, function, place, footprint)

    def _image(self, image: ImageData, sample: Sample, function: str, coordinate: str, footprint: str) -> str:
        slot = self._texture(image, sample)
        if slot is None:
            if image.name not in self.left_out:
                self.left_out.append(image.name)
            return _literal_text(mean_colour(image))
        return f"{function}({slot}, {coordinate}, {footprint})"

    def _texture(self, image: ImageData, sample: Sample) -> str | None:
        for slot, (other, extension, interpolation) in enumerate(self.textures):
            if other is image and (extension, interpolation) == (sample.extension, sample.interpolation):
                return f"{self.prefix}_texture_{slot}"
        if len(self.textures) >= self.max_textures:
            return None
        self.textures.append((image, sample.extension, sample.interpolation))
        return f"{self.prefix}_texture_{len(self.textures) - 1}"

    def _ramp(self, ramp: Ramp, factor: str) -> str:
        """A ramp of a few stops is written out; a long uniform one is a loop-free look-up of two parameters."""
        if ramp.is_uniform:
            base = f"r{len(self._tables)}"
            self._tables.append((base, ramp.table[:, 1:]))
            count = len(ramp.table)
            at = self._variable(FLOAT, f"clamp({factor}, 0.0, 1.0) * {number_text(count - 1)}")
            low = self._variable("int", f"min(int({at}), {count - 2})")
            fetch = f"{self.prefix}_parameter({base} + {low}"
            return f"mix({fetch}), {fetch} + 1), {at} - float({low}))"
        positions, colors = [], []
        for position, *color in ramp.table:
            positions.append(self._constant(FLOAT, np.asarray(position)))
            colors.append(self._constant(VEC4, np.asarray(color)))
        text = colors[0]
        for i in range(1, len(colors)):
            if ramp.is_constant:
                text = f"({factor} >= {positions[i]} ? {colors[i]} : {text})"
            else:
                step = f"ramp_step({positions[i - 1]}, {positions[i]}, {factor})"
                text = self._variable(VEC4, f"mix({text}, {colors[i]}, {step})")
        return text

    def _constant(self, type: str, value: npt.NDArray[np.float64]) -> str:
        self._constants.append((type, value))
        return f"c{len(self._constants) - 1}"

    def parameters(self) -> tuple[list[str], npt.NDArray[np.float32]]:
        """(declarations of the constants used, their values as (P, 4) float32). Floats fill the gaps after vec3."""
        rows: list[list[float]] = []
        gaps: list[tuple[int, int]] = []
        places: dict[int, tuple[int, str]] = {}
        order = sorted(range(len(self._constants)), key=lambda i: {VEC4: 0, VEC3: 1, FLOAT: 2}[self._constants[i][0]])
        for i in order:
            type, value = self._constants[i]
            if type == FLOAT:
                if not gaps:
                    rows.append([0.0] * 4)
                    gaps = [(len(rows) - 1, k) for k in range(4)]
                row, column = gaps.pop(0)
                rows[row][column] = float(value)
                places[i] = (row, "." + "xyzw"[column])
            else:
                rows.append([*map(float, value), 0.0][:4])
                places[i] = (len(rows) - 1, "" if type == VEC4 else ".xyz")
                if type == VEC3:
                    gaps.append((len(rows) - 1, 3))
        lines = [
            f"{self._constants[i][0]} c{i} = {self.prefix}_parameter({row}){swizzle};"
            for i, (row, swizzle) in sorted(places.items())
        ]
        for name, table in self._tables:
            lines.append(f"const int {name} = {len(rows)};")
            rows.extend([list(map(float, row)) for row in table])
        return lines, np.array(rows, dtype=np.float32).reshape(-1, 4)


def _value_key(value: Any) -> Any:
    """Equal for look-ups that are the same."""
    if isinstance(value, Sample):
        tiles = tuple((number, id(image)) for number, image in value.tiles)
        return tiles, value.extension, value.interpolation, value.divides
    return id(value) if isinstance(value, Ramp) else None
