# SPDX-License-Identifier: GPL-3.0-or-later
"""What the pipeline renders, as plain numpy data: no Blender, no GL.

``host/extract`` fills these from a depsgraph; tests fill them by hand. All lengths are metres, all angles radians,
all colours linear in the scene's working space, radiance is W/(m2 sr). Matrices are row-major float64 and are named
``a_from_b``; they multiply column vectors: ``p_a = a_from_b @ p_b``.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from .materials.graph import MaterialData, WorldData

FloatArray = npt.NDArray[np.float32]
DoubleArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]


class RayVisibility(enum.IntFlag):
    """Which kinds of rays see an object. Bit values are shared with the shaders."""

    CAMERA = 1
    DIFFUSE = 2
    GLOSSY = 4
    TRANSMISSION = 8
    SHADOW = 16
    ALL = 31


def box_around(points: np.ndarray) -> DoubleArray:
    """(2, 3) least and largest coordinates of ``points`` (N, 3), N > 0."""
    columns = np.ascontiguousarray(points.T)  # along short rows numpy takes twenty times as long
    return np.array([columns.min(axis=1), columns.max(axis=1)], np.float64)


@dataclass(frozen=True)
class MeshData:
    """One triangle mesh in object space. Several instances may share it.

    Vertices carry positions; corners (one for each polygon vertex, as in Blender) carry what may have seams.
    """

    name: str
    positions: FloatArray  # (V, 3) metres, object space
    triangle_vertices: IntArray  # (T, 3) index into positions
    triangle_corners: IntArray  # (T, 3) index into the corner arrays
    corner_normals: FloatArray  # (C, 3) unit, object space
    triangle_slots: IntArray  # (T,) material slot of each triangle, already clamped to the slots there are
    uv_layers: dict[str, FloatArray] = field(default_factory=dict)  # name -> (C, 2)
    color_layers: dict[str, FloatArray] = field(default_factory=dict)  # name -> (C, 4) linear
    active_uv: str | None = None  # the layer that an unnamed UV lookup reads
    active_color: str | None = None
    generated_bounds: FloatArray | None = None  # (2, 3) minimum, maximum of "Generated" coordinates; None: of positions

    @cached_property
    def bounds(self) -> DoubleArray:
        """(2, 3) metres, object space: around all triangles, of which there must be one."""
        is_used = np.zeros(len(self.positions), bool)
        is_used[self.triangle_vertices] = True
        return box_around(self.positions[is_used])

    @cached_property
    def area_and_perimeter(self) -> tuple[float, float]:
        """Sums over all triangles, m2 and m, object space."""
        a, b, c = (self.positions[self.triangle_vertices[:, k]].astype(np.float64) for k in range(3))
        area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() * 0.5)
        return area, float(sum(np.linalg.norm(edge, axis=1).sum() for edge in (b - a, c - b, a - c)))


@dataclass(frozen=True)
class InstanceData:
    """One placement of a mesh."""

    name: str  # of the object, for messages
    mesh: int  # index into SceneData.meshes
    world_from_object: DoubleArray  # (4, 4)
    materials: tuple[int, ...]  # material slot -> index into SceneData.materials; never empty
    visibility: RayVisibility = RayVisibility.ALL
    is_holdout: bool = False
    object_index: int = 0  # pass index of the object
    random: float = 0.0  # [0, 1), as Object Info > Random


class LightKind(enum.IntEnum):
    """Values are shared with the shaders."""

    POINT = 0
    SPOT = 1
    SUN = 2
    AREA = 3


class AreaShape(enum.IntEnum):
    RECTANGLE = 0
    ELLIPSE = 1


@dataclass(frozen=True)
class LightData:
    """One light, already in radiometric units.

    ``intensity`` is, by kind: POINT and SPOT radiant intensity W/sr along the axis; SUN irradiance W/m2 on a surface
    facing it; AREA radiance W/(m2 sr) along its normal.
    """

    name: str
    kind: LightKind
    intensity: FloatArray  # (3,) see above
    position: DoubleArray  # (3,) metres, world; unused by SUN
    axes: DoubleArray  # (3, 3) rows: unit x, y, z axes of the light in world space; it shines along -z
    radius: float = 0.0  # POINT, SPOT: metres
    soft_falloff: bool = True  # POINT, SPOT: disk facing the receiver (True) or a true sphere
    spot_angle: float = 0.0  # SPOT: full angle of the cone
    spot_blend: float = 0.0  # SPOT: 0..1
    spot_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)  # SPOT: object scale; makes the cone elliptic
    angle: float = 0.0  # SUN: full angle of the disk
    shape: AreaShape = AreaShape.RECTANGLE  # AREA
    size: tuple[float, float] = (1.0, 1.0)  # AREA: metres along x and y, world scale included
    spread: float = np.pi  # AREA: full angle; off the normal by x: max(0, 1 - tan x / tan(spread / 2)) of the intensity
    casts_shadow: bool = True
    visibility: RayVisibility = RayVisibility.ALL  # which rays see the light itself or are lit by it


class CameraKind(enum.IntEnum):
    PERSPECTIVE = 0
    ORTHOGRAPHIC = 1


@dataclass(frozen=True)
class CameraData:
    """Where the picture is taken from."""

    world_from_camera: DoubleArray  # (4, 4) rigid; the camera looks along -z
    clip_from_camera: DoubleArray  # (4, 4) OpenGL projection of the whole frame: shift, aspect and clip planes included
    kind: CameraKind = CameraKind.PERSPECTIVE
    # Part of the frame that is rendered: x0, y0, x1, y1 in 0..1, origin bottom left.
    border: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True)
class SceneData:
    """Everything one frame of one view layer needs."""

    meshes: tuple[MeshData, ...]
    instances: tuple[InstanceData, ...]
    materials: tuple[MaterialData, ...]
    lights: tuple[LightData, ...]
    world: WorldData | None
    camera: CameraData
    warnings: tuple[str, ...] = ()  # for the user: what could not be rendered as asked, by name
    film_transparent: bool = False
    exposure: float = 1.0  # film exposure factor on everything (linear)
    pixel_filter_width: float = 1.5  # pixels, Blackman-Harris
