# SPDX-License-Identifier: GPL-3.0-or-later
"""What cameras and lights need of an object's matrix."""

from __future__ import annotations

import numpy as np

from ...scene import DoubleArray


def rigid(matrix: DoubleArray) -> DoubleArray:
    """(4, 4) a matrix of finite numbers, without its scale and shear.

    The direction of z is kept, then as much of y as is perpendicular to it; a mirrored matrix stays mirrored. Axes of
    length 0 are replaced.
    """
    z = _unit(matrix[:3, 2], np.array([0.0, 0.0, 1.0]))
    y = matrix[:3, 1] - z * (matrix[:3, 1] @ z)
    y = _unit(y, _unit(np.cross(z, [1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])))
    x = np.cross(y, z)
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        x = -x
    result = np.eye(4)
    result[:3] = np.column_stack((x, y, z, matrix[:3, 3]))
    return result


def _unit(vector: DoubleArray, fallback: DoubleArray) -> DoubleArray:
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-20 else fallback
