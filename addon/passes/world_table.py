# SPDX-License-Identifier: GPL-3.0-or-later
"""How directions of the world are drawn: by the light that its picture sends from them.

Pictures are equirectangular, (R, C, ...), row 0 lowest, as in shaders/lib/world.glsl.
"""

from __future__ import annotations

import numpy as np

from ..gpu import interface
from .emitters import LUMINANCE, distribution

#: Directions are drawn where the mean of the squared radiance is above this times the square of its mean. For receivers
#: that face anywhere, a ray brings the light of an unhindered world with a relative variance of that ratio - 1, about;
#: a direction drawn by radiance leaves that of the cosine, which is (1/6) / (1/4)^2 - 1 over the sphere.
CONCENTRATED = 8.0 / 3.0


def solid_angles(rows: int, columns: int) -> np.ndarray:
    """(R, 1) sr: of each texel of a row."""
    cosines = np.cos(np.linspace(np.pi, 0.0, rows + 1))
    return (2.0 * np.pi / columns) * np.diff(cosines)[:, None]


def luminances(pixels: np.ndarray) -> np.ndarray:
    """(R, C) float64: mean of each texel of the (R, C, 3) picture as the sampler reads it, which is bilinear."""
    value = pixels.astype(np.float64) @ LUMINANCE
    value = 0.75 * value + 0.125 * (np.roll(value, 1, axis=1) + np.roll(value, -1, axis=1))
    padded = np.pad(value, ((1, 1), (0, 0)), mode="edge")
    return 0.75 * value + 0.125 * (padded[:-2] + padded[2:])


def concentration(luminance: np.ndarray) -> float:
    """Mean over the sphere of the square of (R, C) values, over the square of their mean; 0 for a black world."""
    weight = solid_angles(*luminance.shape) / (4.0 * np.pi)
    mean = float((weight * luminance).sum())
    return float((weight * np.square(luminance)).sum()) / mean**2 if mean > 0.0 else 0.0


def surplus(luminance: np.ndarray) -> np.ndarray:
    """(R, C): what is above the mean over the sphere. Rays find the rest better.

    Karlik, Sik, Vevoda, Skrivan and Krivanek 2019, "MIS Compensation: Optimizing Sampling Techniques in Multiple
    Importance Sampling".
    """
    mean = float((solid_angles(*luminance.shape) * luminance).sum()) / (4.0 * np.pi)
    return np.maximum(luminance - mean, 0.0)


def direction_table(luminance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Chances of texels by (R, C) light, not all 0.

    Returns (R, C + 1) float32: running sums of chances along each row, and in the last column those of whole rows, both
    as whole numbers that end at EMITTER_UNITS; and (R, C) float32: directions for each steradian.
    """
    rows, columns = luminance.shape
    angles = solid_angles(rows, columns)
    table = np.zeros((rows, columns + 1))
    of_rows = (luminance * angles).sum(axis=1)
    table[:, columns] = distribution(of_rows)
    density = np.zeros((rows, columns), np.float32)
    chances = np.diff(table[:, columns], prepend=0.0) / interface.EMITTER_UNITS
    for row in np.flatnonzero(of_rows):
        table[row, :columns] = distribution(luminance[row])
        units = np.diff(table[row, :columns], prepend=0.0)
        density[row] = units * (chances[row] / (interface.EMITTER_UNITS * angles[row]))
    return table.astype(np.float32), density
