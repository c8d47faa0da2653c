# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's node graphs as plain data: what ``host/extract`` writes and ``materials/compile.py`` reads."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Any

import numpy.typing as npt


class ImageEncoding(enum.Enum):
    """How an image's numbers become scene-linear."""

    SRGB = "srgb"  # sRGB transfer function on colour, alpha linear
    LINEAR = "linear"  # already scene-linear
    DATA = "data"  # Non-Color: use as they are


class AlphaMode(enum.Enum):
    STRAIGHT = "straight"
    PREMULTIPLIED = "premultiplied"
    CHANNEL_PACKED = "channel_packed"
    NONE = "none"


@dataclass(frozen=True, eq=False)
class ImageData:
    """Pixels of one image (or of one tile of a UDIM set). Row 0 is the bottom row, as in Blender and GL."""

    name: str
    pixels: npt.NDArray[Any]  # (H, W, 4) uint8 (0..255) or float32
    encoding: ImageEncoding
    alpha_mode: AlphaMode = AlphaMode.STRAIGHT


@dataclass(frozen=True, eq=False)
class ImageSet:
    """What an Image Texture node refers to: one image, or the tiles of a UDIM set by tile number (1001 + u + 10 v).

    ``tiles`` is empty when nothing could be loaded: the node then gives Blender's magenta, and ``problem`` says why.
    """

    name: str
    tiles: dict[int, ImageData]  # a plain image is tile 1001
    is_udim: bool = False
    problem: str | None = None


Value = float | tuple[float, ...] | str | bool | None


@dataclass(frozen=True, eq=False)
class Socket:
    """An input of a node: a link, or else a value."""

    identifier: str
    kind: str  # Blender's socket type: VALUE, INT, BOOLEAN, VECTOR, RGBA, SHADER, ...
    value: Value = None
    link: tuple[str, str] | None = None  # (node name, output identifier)


@dataclass(frozen=True, eq=False)
class Node:
    """A node by its Blender type, with its inputs by identifier and the properties that matter."""

    name: str
    idname: str  # bl_idname, such as ShaderNodeBsdfPrincipled
    inputs: dict[str, Socket] = field(default_factory=dict)
    properties: dict[str, Any] = field(default_factory=dict)  # RNA enum/bool/number properties by RNA name
    image: ImageSet | None = None
    ramp: tuple[tuple[float, tuple[float, float, float, float]], ...] = ()  # ColorRamp stops: position, RGBA
    output_values: dict[str, Value] = field(default_factory=dict)  # RGB and Value nodes: output identifier -> value


@dataclass(frozen=True, eq=False)
class NodeGraph:
    """A flat graph: no groups, no reroutes, no muted nodes."""

    nodes: dict[str, Node]
    output: str | None  # name of the active output node; None: nothing to evaluate


@dataclass(frozen=True, eq=False)
class MaterialData:
    name: str
    graph: NodeGraph | None  # None: the material has no nodes; ``color`` etc. are used
    color: tuple[float, float, float] = (0.8, 0.8, 0.8)  # viewport settings of a material without nodes
    metallic: float = 0.0
    roughness: float = 0.5
    use_backface_culling: bool = False
    uid: int = 0  # identity that survives renames and undo (session_uid); 0: none


@dataclass(frozen=True, eq=False)
class WorldData:
    name: str
    graph: NodeGraph | None  # None: ``color`` everywhere
    color: tuple[float, float, float] = (0.0, 0.0, 0.0)  # radiance, W/(m2 sr)
