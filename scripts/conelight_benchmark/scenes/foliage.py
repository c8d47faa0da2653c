# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves on cards: many small quads whose picture cuts leaves out, over a ground, under sun and sky."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

from blender_tests.scenes.make_usd import add_mesh

from . import stage as parts

CARDS = 160


def leaf_pixels(size: int = 64) -> npt.NDArray[np.float32]:
    """(size, size, 4) sRGB: three leaves with a midrib, clear between them."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size - 0.5
    pixels = np.zeros((size, size, 4), np.float32)
    for turn in (-0.9, 0.0, 0.9):
        along = x * math.sin(turn) - y * math.cos(turn) + 0.45 * math.cos(turn) - 0.1
        across = x * math.cos(turn) + y * math.sin(turn) - 0.45 * math.sin(turn)
        inside = ((along - 0.3) / 0.32) ** 2 + (across / 0.11) ** 2 < 1
        pixels[inside] = (0.25, 0.5 + 0.2 * (turn == 0.0), 0.15, 1.0)
        pixels[inside & (np.abs(across) < 0.012)] = (0.6, 0.65, 0.3, 1.0)
    return pixels


def cards(path: Path) -> None:
    """A bush of cards within a sphere."""
    buffer = oiio.ImageBuf(leaf_pixels())
    buffer.set_write_format("uint8")
    picture = path.parent / "leaves.png"
    if not buffer.write(str(picture)):
        raise OSError(f"picture '{picture}' cannot be written: {buffer.geterror()}")
    stage = parts.new_stage(path)
    h = 2.0
    parts.add_quad(stage, "Ground", [(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)],
                   parts.matte(stage, "Earth", (0.5, 0.45, 0.4)))
    random = np.random.default_rng(7)
    points, faces, uv = [], [], []
    for i in range(CARDS):
        direction = random.normal(size=3)
        middle = direction / np.linalg.norm(direction) * 0.85 * random.random() ** (1 / 3) + [0.0, 0.0, 1.0]
        u, v = np.linalg.qr(random.normal(size=(3, 2)))[0].T * 0.17
        points += [tuple(middle + a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        faces.append(tuple(range(4 * i, 4 * i + 4)))
        uv += [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    add_mesh(stage, "/World/Bush", points, faces, parts.cut_out(stage, "Leaves", "./leaves.png"), uv)
    parts.add_sun(stage, (0.5, 0.4, -0.9), 4.0)
    parts.add_sky(stage, (0.4, 0.5, 0.65))
    parts.add_camera(stage, (0.0, -4.6, 2.0), (0.0, 0.0, 0.9), lens=42.0)
    stage.Save()
