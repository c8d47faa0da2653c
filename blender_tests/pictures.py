# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as numbers: files through OpenImageIO, and how far one picture is from another."""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

#: (H, W, C) linear, row 0 at the top.
Picture = npt.NDArray[np.float32]


def read(path: str | os.PathLike[str]) -> Picture:
    """The first part of an image file. Raises OSError naming the file when it cannot be read."""
    buffer = oiio.ImageBuf(str(path))
    if not buffer.read(force=True, convert=oiio.FLOAT):
        raise OSError(f"picture '{path}' cannot be read: {buffer.geterror()}")
    return np.asarray(buffer.get_pixels(oiio.FLOAT), np.float32)


def write(path: str | os.PathLike[str], picture: Picture, *, half: bool = True) -> None:
    """Writes an image file; half floats are enough for a reference. Raises OSError naming the file."""
    buffer = oiio.ImageBuf(np.ascontiguousarray(picture, np.float32))
    if str(path).endswith(".exr"):
        buffer.set_write_format("half" if half else "float")
        buffer.specmod().attribute("compression", "zip")
    else:
        buffer.set_write_format("uint8")
    if not buffer.write(str(path)):
        raise OSError(f"picture '{path}' cannot be written: {buffer.geterror()}")


def relative_mse(
    picture: Picture, reference: Picture, second: Picture | None = None, smooth: Picture | None = None
) -> float:
    """Mean of (x - r)^2 / (r^2 + 0.01 mean(r)^2) over pixels and colour channels, the mean taken for each channel.

    With a ``second`` reference, rendered independently, (x - a)(x - b) takes the place of the square: then noise of the
    references cancels, and the result can be a little below 0. ``smooth`` is like the references but without noise,
    for the r below the line: where noise makes both dark, their errors would have the same sign, and weigh most.
    """
    x, a = picture[..., :3].astype(np.float64), reference[..., :3].astype(np.float64)
    b = a if second is None else second[..., :3].astype(np.float64)
    r = 0.5 * (a + b) if smooth is None else smooth[..., :3].astype(np.float64)
    return float(((x - a) * (x - b) / (r**2 + 0.01 * r.mean(axis=(0, 1)) ** 2)).mean())


def bias(picture: Picture, reference: Picture) -> float:
    """mean(x) / mean(r) - 1 of the colours."""
    return float(picture[..., :3].mean(dtype=np.float64) / reference[..., :3].mean(dtype=np.float64) - 1.0)
