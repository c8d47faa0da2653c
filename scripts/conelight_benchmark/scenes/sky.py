# SPDX-License-Identifier: GPL-3.0-or-later
"""Under the open sky: bare planes at an angle to the voxels, and a sphere under a sky that is a picture."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import UsdGeom

from . import stage as parts

PLANE_ALBEDO = 0.8


def tilted_plane(path: Path, *, tilt: float) -> None:
    """A plane under a sky of radiance 1, tilted by degrees: wherever one looks it is as bright as its albedo."""
    stage = parts.new_stage(path)
    a = PLANE_ALBEDO
    plane = parts.add_quad(stage, "Plane", [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)],
                           parts.matte(stage, "Paper", (a, a, a)))
    UsdGeom.Xformable(plane).AddRotateXYZOp().Set((0.7 * tilt, tilt, 0.0))
    parts.add_sky(stage)
    normal = np.array([math.sin(math.radians(tilt)), 0.0, math.cos(math.radians(tilt))])
    parts.add_camera(stage, tuple(3.0 * normal + [0.0, -0.5, 0.0]), (0.0, 0.0, 0.0), lens=60.0)
    stage.Save()


def write_sky(path: Path, width: int = 256) -> None:
    """A sky in latitude and longitude: blue above, a bright glow of some degrees, brown ground; W/(m2 sr)."""
    height = width // 2
    up = np.cos(np.pi * (np.arange(height) + 0.5) / height)[:, None]
    around = 2 * np.pi * (np.arange(width) + 0.5)[None, :] / width
    flat = np.sqrt(1 - up**2)
    direction = np.stack(np.broadcast_arrays(flat * np.cos(around), flat * np.sin(around), up), axis=-1)
    sky = np.array([0.25, 0.4, 0.8]) + np.array([0.5, 0.4, 0.1]) * (1 - np.clip(up, 0, 1)[..., None]) ** 4
    picture = np.where(up[..., None] > 0, sky, np.array([0.12, 0.09, 0.06])) * np.ones((height, width, 1))
    middle = np.array([0.55, 0.45, 0.70])
    middle /= np.linalg.norm(middle)
    picture += np.array([1.0, 0.85, 0.6]) * (25.0 * np.exp((direction @ middle - 1.0) / 0.01))[..., None]
    buffer = oiio.ImageBuf(np.ascontiguousarray(picture, np.float32))
    buffer.set_write_format("float")
    if not buffer.write(str(path)):
        raise OSError(f"picture '{path}' cannot be written: {buffer.geterror()}")


def sphere_under_picture(path: Path) -> None:
    """The sphere on a plane of ``blender_tests/scenes/sky_sphere.py``, under a picture."""
    write_sky(path.parent / "sky.exr")
    stage = parts.new_stage(path)
    h = 3.0
    parts.add_quad(stage, "Ground", [(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)],
                   parts.matte(stage, "Earth", (0.6, 0.5, 0.4)))
    parts.add_sphere(stage, "Sphere", (0.0, 0.0, 1.0), 1.0, parts.matte(stage, "Pale", (0.8, 0.8, 0.8)))
    parts.add_sky(stage, texture="./sky.exr")
    parts.add_camera(stage, (0.0, -7.0, 2.5), (0.0, 0.0, 0.8), lens=50.0)
    stage.Save()
