# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks one node graph from its output and asks the table of nodes for expressions and closures."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

from .closure import Closure
from .expression import FLOAT, VEC3, Expr, average, constant, leaf, literal, luminance, splat, structural, unless_zero
from .graph import Node, NodeGraph, Socket

#: Outputs of these identifiers are vectors; other outputs of three components are colours. (A vector becomes a number
#: by its mean, a colour by its luminance.)
VECTOR_OUTPUTS = frozenset(
    ["Vector", "Normal", "True Normal", "Tangent", "Tangent Normal", "Position", "Incoming", "Parametric", "Generated",
     "UV", "Object", "Camera", "Window", "Reflection", "Location", "View Vector", "Velocity", "Angular Velocity",
     "Result_Vector", "Result_Rotation"]
)  # fmt: skip

#: Nodes that are read within each other before those that a node hangs on are read first, one after the other: Python
#: allows about a thousand functions within each other, and a node takes up to ten.
DEEPEST = 32

ValueHandler = Callable[["GraphReader", Node, str], Expr]
ShaderHandler = Callable[["GraphReader", Node], Closure]

VALUE_NODES: dict[str, ValueHandler] = {}
SHADER_NODES: dict[str, ShaderHandler] = {}


def value_node(*idnames: str) -> Callable[[ValueHandler], ValueHandler]:
    """Registers ``function(reader, node, output identifier) -> Expr`` for these Blender types."""

    def register(function: ValueHandler) -> ValueHandler:
        VALUE_NODES.update(dict.fromkeys(idnames, function))
        return function

    return register


def shader_node(*idnames: str) -> Callable[[ShaderHandler], ShaderHandler]:
    """Registers ``function(reader, node) -> Closure`` for these Blender types."""

    def register(function: ShaderHandler) -> ShaderHandler:
        SHADER_NODES.update(dict.fromkeys(idnames, function))
        return function

    return register


class GraphReader:
    """Expressions of one graph. Every output is read once, so that what nodes share is shared."""

    def __init__(self, graph: NodeGraph, owner: str, is_world: bool = False, uv_layers: Collection[str] = ()) -> None:
        """``owner`` names the material or world in messages. ``uv_layers``: names of UV layers in the scene."""
        self.graph = graph
        self.owner = owner
        self.is_world = is_world
        self.known_uv_layers = frozenset(uv_layers)
        self.warnings: list[str] = []
        self.samples: dict[str, Expr] = {}  # look-up of each texture node, shared by its outputs
        self._values: dict[tuple[str, str], Expr] = {}
        self._closures: dict[str, Closure] = {}
        self._inputs: dict[tuple[str, str], Expr] = {}
        self._open: set[tuple[str, str]] = set()
        self._linked_outputs = {s.link for node in graph.nodes.values() for s in node.inputs.values() if s.link}

    def warn(self, node: Node, what: str) -> None:
        """Notes once that a node does not do all that it says."""
        label = node.idname.removeprefix("ShaderNode")
        message = f"{self.owner}: node '{node.name}' ({label}) {what}"
        if message not in self.warnings:
            self.warnings.append(message)

    # --- inputs of a node --------------------

    def is_linked(self, node: Node, identifier: str) -> bool:
        socket = node.inputs.get(identifier)
        return socket is not None and socket.link is not None

    def is_output_used(self, node: Node, identifier: str) -> bool:
        return (node.name, identifier) in self._linked_outputs

    def number(self, node: Node, identifier: str, default: float = 0.0) -> Expr:
        """Input as a float."""
        return self._input(node, identifier, FLOAT, default)

    def color(self, node: Node, identifier: str, default: float | tuple[float, float, float] = 0.0) -> Expr:
        """Input as three components."""
        return self._input(node, identifier, VEC3, default)

    vector = color

    def weight(self, node: Node, identifier: str, default: float = 0.0) -> Expr:
        """Input as a float; exactly 0 or 1 decides what is computed at all."""
        return structural(self.number(node, identifier, default))

    def normal(self, node: Node, identifier: str = "Normal") -> Expr:
        """Input as a unit normal in world space; the surface's own when nothing is linked."""
        return self.vector(node, identifier) if self.is_linked(node, identifier) else self.default_normal()

    def default_normal(self) -> Expr:
        return -leaf("direction_ws") if self.is_world else leaf("normal_ws")

    def _input(self, node: Node, identifier: str, type: str, default: float | tuple[float, ...]) -> Expr:
        key = (node.name, identifier + "/" + type)
        if key not in self._inputs:
            self._inputs[key] = self._read_input(node.inputs.get(identifier), type, default)
        return self._inputs[key]

    def _read_input(self, socket: Socket | None, type: str, default: float | tuple[float, ...]) -> Expr:
        if socket is None:
            return converted(constant(default), type, is_vector=False)
        if socket.link is not None:
            name, output = socket.link
            if name in self.graph.nodes:
                return converted(self.output(name, output), type, output in VECTOR_OUTPUTS)
        value = socket.value
        if isinstance(value, bool | int | float):
            expr = constant(float(value))
        elif isinstance(value, tuple) and len(value) in (2, 3, 4):
            expr = constant((*value, 0.0)[:3])
        else:
            expr = constant(default)
        return converted(expr, type, socket.kind not in ("RGBA",))

    # --- outputs --------------------

    def output(self, name: str, identifier: str) -> Expr:
        """Value of a node's output, as the node makes it (float, vec3 or vec4)."""
        key = (name, identifier)
        if key in self._values:
            return self._values[key]
        node = self.graph.nodes[name]
        if key in self._open:
            self.warn(node, "is linked to itself in a circle; the circle is cut here")
            return literal(0.0)
        self._read_ahead(name)
        self._open.add(key)
        handler = VALUE_NODES.get(node.idname)
        if handler is not None:
            expr = handler(self, node, identifier)
        else:
            self.warn(node, "is not supported; a neutral value takes its place")
            expr = self.neutral(node, identifier)
        self._open.discard(key)
        self._values[key] = expr
        return expr

    def _read_ahead(self, name: str) -> None:
        """Where a node lies deep, reads what its inputs hang on, the farthest first."""
        if len(self._open) < DEEPEST:
            return
        seen = {name}
        path: list[tuple[str, str, bool]] = []  # node, output, is a shader
        inputs = [self._links(name)]  # of the node that is looked at, and of those on the path to it
        while inputs:
            link = next(inputs[-1], None)
            if link is None:
                inputs.pop()
                if path:
                    other, output, is_shader = path.pop()
                    if is_shader:
                        self.node_closure(other, output)
                    else:
                        self.output(other, output)
            elif link[0] not in seen and link[0] not in self._closures and link[:2] not in self._values:
                seen.add(link[0])
                path.append(link)
                inputs.append(self._links(link[0]))

    def _links(self, name: str) -> Iterator[tuple[str, str, bool]]:
        """Node and output that each input of a node is linked to, and whether that is a shader."""
        for socket in self.graph.nodes[name].inputs.values():
            if socket.link is not None and socket.link[0] in self.graph.nodes:
                yield *socket.link, socket.kind == "SHADER"

    def neutral(self, node: Node, identifier: str) -> Expr:
        """What an output gives that cannot be computed: the input of the same name, or else the middle of its range."""
        if identifier in ("Normal", "True Normal"):
            return self.normal(node)
        if identifier in ("Color", "Vector") and identifier in node.inputs:
            return self.color(node, identifier)
        if identifier in ("Color", "Fac", "Factor"):
            return literal(0.5)
        return literal(0.0)

    def closure(self, node: Node, identifier: str) -> Closure:
        """The shader linked to an input; empty when nothing is."""
        socket = node.inputs.get(identifier)
        if socket is None or socket.link is None or socket.link[0] not in self.graph.nodes:
            return Closure()
        return self.node_closure(*socket.link)

    def node_closure(self, name: str, output: str) -> Closure:
        if name in self._closures:
            return self._closures[name]
        node = self.graph.nodes[name]
        key = (name, "")
        if key in self._open:
            self.warn(node, "is linked to itself in a circle; the circle is cut here")
            return Closure()
        self._read_ahead(name)
        self._open.add(key)
        if node.idname in SHADER_NODES:
            closure = SHADER_NODES[node.idname](self, node)
        elif node.idname in VALUE_NODES:  # a colour linked to a shader input glows, as in Blender
            closure = Closure(emission=unless_zero(converted(self.output(name, output), VEC3, False)))
        else:
            self.warn(node, "is not supported; it is shown as grey diffuse")
            closure = Closure(diffuse=constant((0.8, 0.8, 0.8)))
        self._open.discard(key)
        self._closures[name] = closure
        return closure


def converted(expr: Expr, type: str, is_vector: bool) -> Expr:
    """``expr`` as a float or vec3, as Blender converts between sockets."""
    if expr.type == type:
        return expr
    if type == VEC3:
        return splat(expr) if expr.type == FLOAT else expr.rgb
    return average(expr.rgb) if is_vector else luminance(expr.rgb)
