# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a USD scene with usd-core alone: UsdPreviewSurface with a texture, instances, a PointInstancer, and each kind
of UsdLux light. ``python make_usd.py FOLDER`` writes ``scene.usda`` and its textures there.

Metres, z up. A room without a ceiling and without a front: floor and two walls.
"""

from __future__ import annotations

import math
import struct
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

Point = tuple[float, float, float]

#: Names of the lights, each of another kind.
LIGHTS = ("Rect", "Sphere", "Distant", "Dome")


def write_png(path: Path, size: int = 64, cells: int = 8) -> None:
    """A checker of orange and white, sRGB."""
    colors = (b"\xe8\xe8\xe0", b"\xd0\x70\x20")
    rows = b"".join(
        b"\0" + b"".join(colors[(x * cells // size + y * cells // size) % 2] for x in range(size)) for y in range(size)
    )

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0)
    compressed = chunk(b"IDAT", zlib.compress(rows))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + compressed + chunk(b"IEND", b""))


def write_hdr(path: Path, width: int = 32) -> None:
    """A sky, Radiance RGBE, equirectangular: blue, brightest above, brown below the horizon."""
    height = width // 2
    rows = bytearray()
    for y in range(height):
        up = math.cos(math.pi * (y + 0.5) / height)
        color = (0.2 + 0.2 * up, 0.25 + 0.3 * up, 0.3 + 0.5 * up) if up > 0 else (0.1, 0.08, 0.06)
        # Shared exponent e: value = (mantissa + 0.5) / 256 2^(e - 128).
        exponent = math.frexp(max(color))[1]
        rows += bytes([*(int(c * 256 / 2**exponent) for c in color), exponent + 128]) * width
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width) + bytes(rows))


def add_material(stage: Usd.Stage, name: str, texture: str | None = None, **inputs: Any) -> UsdShade.Material:
    """A UsdPreviewSurface. ``texture``: file of its diffuse colour, read by the UVs ``st``."""
    path = f"/World/Materials/{name}"
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    for key, value in inputs.items():
        kind = Sdf.ValueTypeNames.Color3f if isinstance(value, tuple) else Sdf.ValueTypeNames.Float
        shader.CreateInput(key, kind).Set(Gf.Vec3f(*value) if isinstance(value, tuple) else value)
    if texture is not None:
        reader = UsdShade.Shader.Define(stage, f"{path}/UV")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        image = UsdShade.Shader.Define(stage, f"{path}/Texture")
        image.CreateIdAttr("UsdUVTexture")
        image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(texture)
        image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        for side in ("wrapS", "wrapT"):
            image.CreateInput(side, Sdf.ValueTypeNames.Token).Set("repeat")
        uv = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        image.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(uv)
        color = image.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(color)
    material.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    return material


def add_mesh(
    stage: Usd.Stage, path: str, points: Sequence[Point], faces: Sequence[Sequence[int]], material: UsdShade.Material,
    uv: Sequence[tuple[float, float]] | None = None,
) -> UsdGeom.Mesh:
    """A mesh of flat faces; ``uv`` has one pair for each corner of each face."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([Gf.Vec3f(*p) for p in points])
    mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
    mesh.CreateFaceVertexIndicesAttr([index for face in faces for index in face])
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    if uv is not None:
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        primvar.Set([Gf.Vec2f(*pair) for pair in uv])
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    return mesh


def add_box(stage: Usd.Stage, path: str, half: float, material: UsdShade.Material) -> UsdGeom.Mesh:
    """A cube on z = 0."""
    points = [(x, y, z) for z in (0.0, 2 * half) for y in (-half, half) for x in (-half, half)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return add_mesh(stage, path, points, faces, material)


def write_scene(folder: Path) -> Path:
    """Writes textures and scene; returns the scene's path."""
    write_png(folder / "checker.png")
    write_hdr(folder / "sky.hdr")
    path = folder / "scene.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    world = UsdGeom.Xform.Define(stage, "/World")
    Usd.ModelAPI(world.GetPrim()).SetKind(Kind.Tokens.assembly)
    stage.SetDefaultPrim(world.GetPrim())

    floor = add_material(stage, "Floor", "./checker.png", roughness=0.9, metallic=0.0)
    wall = add_material(stage, "Wall", diffuseColor=(0.7, 0.7, 0.68), roughness=0.9)
    blue = add_material(stage, "Blue", diffuseColor=(0.1, 0.2, 0.6), roughness=0.6)
    brass = add_material(stage, "Brass", diffuseColor=(0.9, 0.7, 0.3), metallic=1.0, roughness=0.4)
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    quad = [(0, 1, 2, 3)]
    add_mesh(stage, "/World/Floor", [(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], quad, floor, square)
    add_mesh(stage, "/World/Back", [(-3, 3, 0), (3, 3, 0), (3, 3, 3), (-3, 3, 3)], quad, wall)
    add_mesh(stage, "/World/Side", [(-3, -3, 0), (-3, 3, 0), (-3, 3, 3), (-3, -3, 3)], quad, wall)

    # Three references to one prototype, as USD's own instances.
    prototype = UsdGeom.Xform.Define(stage, "/Prototypes/Block")
    add_box(stage, "/Prototypes/Block/Mesh", 0.4, blue)
    prototype.GetPrim().SetSpecifier(Sdf.SpecifierClass)
    for i in range(3):
        block = UsdGeom.Xform.Define(stage, f"/World/Block_{i}")
        block.AddTranslateOp().Set(Gf.Vec3d(-1.6 + 1.3 * i, 1.6, 0.0))
        block.AddRotateZOp().Set(20.0 * i)
        block.GetPrim().GetReferences().AddInternalReference("/Prototypes/Block")
        block.GetPrim().SetInstanceable(True)

    # Small boxes along a line, by a PointInstancer.
    scatter = UsdGeom.PointInstancer.Define(stage, "/World/Scatter")
    pebble = add_box(stage, "/World/Scatter/Prototypes/Pebble", 0.15, brass)
    scatter.CreatePrototypesRel().SetTargets([pebble.GetPath()])
    count = 8
    scatter.CreateProtoIndicesAttr([0] * count)
    scatter.CreatePositionsAttr([Gf.Vec3f(-2.0 + 0.55 * i, 0.2, 0.0) for i in range(count)])
    turns = [math.radians(11.0 * i) / 2 for i in range(count)]
    scatter.CreateOrientationsAttr(Vt.QuathArray([Gf.Quath(math.cos(a), 0.0, 0.0, math.sin(a)) for a in turns]))
    scatter.CreateScalesAttr([Gf.Vec3f(1.0, 1.0, 0.6 + 0.2 * i) for i in range(count)])

    rect = UsdLux.RectLight.Define(stage, "/World/Lights/Rect")
    rect.CreateWidthAttr(1.2)
    rect.CreateHeightAttr(0.6)
    rect.CreateIntensityAttr(12.0)
    rect.AddTranslateOp().Set(Gf.Vec3d(1.0, 1.5, 2.6))
    sphere = UsdLux.SphereLight.Define(stage, "/World/Lights/Sphere")
    sphere.CreateRadiusAttr(0.15)
    sphere.CreateIntensityAttr(40.0)
    sphere.CreateColorAttr(Gf.Vec3f(1.0, 0.6, 0.3))
    sphere.AddTranslateOp().Set(Gf.Vec3d(-2.0, -0.8, 1.2))
    distant = UsdLux.DistantLight.Define(stage, "/World/Lights/Distant")
    distant.CreateIntensityAttr(1.5)
    distant.CreateAngleAttr(2.0)
    distant.AddRotateXYZOp().Set(Gf.Vec3f(35.0, 20.0, 0.0))
    dome = UsdLux.DomeLight.Define(stage, "/World/Lights/Dome")
    dome.CreateTextureFileAttr("./sky.hdr")
    dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    dome.CreateIntensityAttr(0.8)

    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.CreateFocalLengthAttr(30.0)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(24.0)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 100.0))
    camera.AddTranslateOp().Set(Gf.Vec3d(1.2, -5.5, 2.4))
    camera.AddRotateXYZOp().Set(Gf.Vec3f(74.0, 0.0, 12.0))
    stage.Save()
    return path


if __name__ == "__main__":
    print(write_scene(Path(sys.argv[1])))
