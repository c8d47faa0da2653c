# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of USD scenes, besides those of ``blender_tests/scenes/make_usd.py``. Metres, z up, angles in degrees.

Strengths are what Blender makes of them on import, in W, m and sr.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from blender_tests.scenes.make_usd import Point, add_material, add_mesh

Color = tuple[float, float, float]

#: Irradiance (W/m2) that Blender gives a distant light of intensity 1, on a surface that faces it.
SUN_UNIT = 4.0

WHITE: Color = (0.75, 0.75, 0.75)
RED: Color = (0.6, 0.06, 0.06)
GREEN: Color = (0.1, 0.45, 0.1)


def new_stage(path: Path) -> Usd.Stage:
    """An empty stage; its objects go under ``/World``."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    return stage


# ---- materials ---------------------------------------------------------------------------------------------------


def matte(stage: Usd.Stage, name: str, color: Color) -> UsdShade.Material:
    """Lambert's law: an index of refraction of 1 reflects nothing at the surface."""
    return add_material(stage, name, diffuseColor=color, roughness=1.0, ior=1.0)


def glowing(stage: Usd.Stage, name: str, radiance: Color) -> UsdShade.Material:
    """Emits ``radiance``, W/(m2 sr), and reflects nothing."""
    return add_material(stage, name, diffuseColor=(0.0, 0.0, 0.0), emissiveColor=radiance, roughness=1.0, ior=1.0)


def cut_out(stage: Usd.Stage, name: str, texture: str) -> UsdShade.Material:
    """Matte, with colour and opacity from a picture with an alpha channel."""
    material = add_material(stage, name, texture, roughness=1.0, ior=1.0)
    path = material.GetPath()
    image = UsdShade.Shader.Get(stage, path.AppendChild("Texture"))
    surface = UsdShade.Shader.Get(stage, path.AppendChild("Surface"))
    alpha = image.CreateOutput("a", Sdf.ValueTypeNames.Float)
    surface.CreateInput("opacity", Sdf.ValueTypeNames.Float).ConnectToSource(alpha)
    return material


# ---- shapes ------------------------------------------------------------------------------------------------------


def add_quad(stage: Usd.Stage, name: str, corners: Sequence[Point], material: UsdShade.Material) -> UsdGeom.Mesh:
    """A face whose front is where its corners go round counter-clockwise, with UVs (0,0) (1,0) (1,1) (0,1)."""
    uv = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    return add_mesh(stage, f"/World/{name}", corners, [(0, 1, 2, 3)], material, uv)


def add_box(
    stage: Usd.Stage, name: str, low: Point, high: Point, material: UsdShade.Material, turn: float = 0.0
) -> UsdGeom.Mesh:
    """A box, turned by ``turn`` degrees about the vertical through its middle."""
    middle = [0.5 * (a + b) for a, b in zip(low, high, strict=True)]
    xs, ys, zs = ([a - m, b - m] for a, b, m in zip(low, high, middle, strict=True))
    mesh = add_solid(stage, name, (xs, ys, zs), np.ones((1, 1, 1), int), [material])[0]
    mesh.AddTranslateOp().Set(Gf.Vec3d(*middle))
    mesh.AddRotateZOp().Set(turn)
    return mesh


def add_sphere(
    stage: Usd.Stage, name: str, centre: Point, radius: float, material: UsdShade.Material, segments: int = 64
) -> UsdGeom.Mesh:
    """A smooth sphere with ``segments`` around and half as many from pole to pole."""
    rings = segments // 2
    theta = np.pi * np.arange(1, rings) / rings
    phi = 2 * np.pi * np.arange(segments) / segments
    ring = np.stack(np.broadcast_arrays(
        np.sin(theta)[:, None] * np.cos(phi), np.sin(theta)[:, None] * np.sin(phi), np.cos(theta)[:, None]
    ), axis=-1).reshape(-1, 3)
    normals = np.concatenate([[[0.0, 0.0, 1.0]], ring, [[0.0, 0.0, -1.0]]])
    at = np.arange(1, 1 + len(ring)).reshape(rings - 1, segments)
    after = np.roll(at, -1, axis=1)
    faces: list[tuple[int, ...]] = []
    for j in range(segments):
        faces.append((0, int(at[0, j]), int(after[0, j])))
        faces.append((len(normals) - 1, int(after[-1, j]), int(at[-1, j])))
        faces += [(int(at[i, j]), int(at[i + 1, j]), int(after[i + 1, j]), int(after[i, j])) for i in range(rings - 2)]
    mesh = add_mesh(stage, f"/World/{name}", [tuple(p) for p in radius * normals], faces, material)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals.astype(np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.AddTranslateOp().Set(Gf.Vec3d(*centre))
    return mesh


def add_solid(
    stage: Usd.Stage, name: str, planes: tuple[Sequence[float], Sequence[float], Sequence[float]],
    solid: npt.NDArray[np.int_], materials: Sequence[UsdShade.Material],
) -> list[UsdGeom.Mesh]:
    """The surface of what is solid among the boxes between axis-parallel planes: closed, and no two faces coincide.

    ``planes``: ascending x, y, z, metres. ``solid`` (nx - 1, ny - 1, nz - 1): 0 for air, i for ``materials[i - 1]``.
    One mesh for each material, in their order. Faces share no points, or else Blender would shade over their edges.
    """
    padded = np.pad(np.asarray(solid), 1)
    result = []
    for number, material in enumerate(materials, 1):
        points: list[Point] = []
        for axis in range(3):
            for side in (0, 1):
                outside = np.roll(padded, 1 - 2 * side, axis)
                u, v = (axis + 1) % 3, (axis + 2) % 3
                for cell in np.argwhere((padded == number) & (outside == 0)) - 1:
                    corners: list[Point] = []
                    for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        corner = cell.copy()
                        corner[axis] += side
                        corner[u] += du
                        corner[v] += dv
                        x, y, z = (float(values[i]) for values, i in zip(planes, corner, strict=True))
                        corners.append((x, y, z))
                    points += corners if side else corners[::-1]
        faces = [tuple(range(i, i + 4)) for i in range(0, len(points), 4)]
        suffix = f"_{number}" if len(materials) > 1 else ""
        result.append(add_mesh(stage, f"/World/{name}{suffix}", points, faces, material))
    return result


# ---- light and camera --------------------------------------------------------------------------------------------


def look(thing: Any, location: Point, target: Point) -> None:
    """Places a camera or light, -z towards ``target`` and y up where that can be."""
    back = Gf.Vec3d(*location) - Gf.Vec3d(*target)
    up = Gf.Vec3d(0, 1, 0) if math.hypot(back[0], back[1]) < 1e-9 else Gf.Vec3d(0, 0, 1)
    matrix = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*location), Gf.Vec3d(*target), up).GetInverse()
    UsdGeom.Xformable(thing).AddTransformOp().Set(matrix)


def add_sun(stage: Usd.Stage, towards: Point, irradiance: float, angle: float = 0.5) -> UsdLux.DistantLight:
    """Lights a surface that faces it with ``irradiance``, W/m2, along ``towards``; ``angle``: its apparent diameter."""
    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(irradiance / SUN_UNIT)
    sun.CreateAngleAttr(angle)
    sun.CreateNormalizeAttr(True)  # or else the strength is that of the disk of the sun, per solid angle
    look(sun, (0.0, 0.0, 0.0), towards)
    return sun


def add_area_light(
    stage: Usd.Stage, location: Point, target: Point, size: tuple[float, float], intensity: float
) -> UsdLux.RectLight:
    light = UsdLux.RectLight.Define(stage, "/World/AreaLight")
    light.CreateWidthAttr(size[0])
    light.CreateHeightAttr(size[1])
    light.CreateIntensityAttr(intensity)
    look(light, location, target)
    return light


def add_sky(stage: Usd.Stage, color: Color = (1.0, 1.0, 1.0), texture: str | None = None) -> UsdLux.DomeLight:
    """A sky of one colour, or of a picture in latitude and longitude."""
    dome = UsdLux.DomeLight.Define(stage, "/World/Sky")
    dome.CreateColorAttr(Gf.Vec3f(*color))
    dome.CreateIntensityAttr(1.0)
    if texture is not None:
        dome.CreateTextureFileAttr(texture)
        dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        dome.AddRotateXOp().Set(90.0)  # the poles of such a picture are along y
    return dome


def add_camera(stage: Usd.Stage, location: Point, target: Point, lens: float) -> UsdGeom.Camera:
    """``lens``: millimetres, on a sensor of 36 mm."""
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.CreateFocalLengthAttr(lens)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(27.0)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1000.0))
    look(camera, location, target)
    return camera
