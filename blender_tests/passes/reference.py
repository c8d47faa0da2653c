# SPDX-License-Identifier: GPL-3.0-or-later
"""The same geometry in float64 and the plainest way: clipping, separating axes, rays against every triangle."""

from __future__ import annotations

import numpy as np


def clip(polygon: np.ndarray, axis: int, value: float, sign: float) -> np.ndarray:
    """The part of a polygon, (N, 3), where sign * (x_axis - value) >= 0."""
    return clip_by_distance(polygon, sign * (polygon[:, axis] - value))


def clip_by_distance(polygon: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """The part of a polygon, (N, 3), where the distances of its corners, (N,), are at least 0.

    Sutherland and Hodgman 1974.
    """
    result = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if distance[i] >= 0:
            result.append(polygon[i])
        if (distance[i] >= 0) != (distance[j] >= 0):
            t = distance[i] / (distance[i] - distance[j])
            result.append(polygon[i] + t * (polygon[j] - polygon[i]))
    return np.array(result).reshape(-1, 3)


def clip_to_cube(triangle: np.ndarray) -> np.ndarray:
    """The part of a triangle, (3, 3), inside the unit cube: a polygon, (N, 3)."""
    polygon = triangle.astype(np.float64)
    for axis in range(3):
        for value, sign in ((0.0, 1.0), (1.0, -1.0)):
            polygon = clip(polygon, axis, value, sign)
            if len(polygon) < 3:
                return np.zeros((0, 3))
    return polygon


def projected_moments(polygon: np.ndarray) -> np.ndarray:
    """(area, moment in x, moment in y) of a polygon seen along z; the area is positive clockwise (integral of y dx)."""
    if len(polygon) < 3:
        return np.zeros(3)
    x, y = polygon[:, 0], polygon[:, 1]
    xn, yn = np.roll(x, -1), np.roll(y, -1)
    cross = x * yn - xn * y
    return -np.array([cross.sum() / 2, ((x + xn) * cross).sum() / 6, ((y + yn) * cross).sum() / 6])


def overlaps(triangles: np.ndarray, cells: np.ndarray, tolerance: float) -> np.ndarray:
    """Whether each triangle, (N, 3, 3), touches its cell, (N, 3), grown by ``tolerance``. Akenine-Moeller 2001."""
    half = 0.5 + tolerance
    v = triangles.astype(np.float64) - (cells[:, None, :] + 0.5)
    edges = np.roll(v, -1, axis=1) - v
    inside = np.ones(len(v), bool)
    axes = [np.broadcast_to(axis, (len(v), 3)) for axis in np.eye(3)]
    axes.append(np.cross(edges[:, 0], edges[:, 1]))
    axes += [np.cross(edges[:, k], unit) for k in range(3) for unit in np.eye(3)]
    for axis in axes:
        p = np.einsum("nij,nj->ni", v, axis)
        radius = half * np.abs(axis).sum(axis=1)
        inside &= (p.min(axis=1) <= radius) & (p.max(axis=1) >= -radius)
    return inside


def trace(triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every ray against every triangle: distance (R, T; inf: none), and how near the ray passes to an edge (R, T).

    The second is the least barycentric coordinate: what is near 0 on either side is decided by rounding.
    Moeller and Trumbore 1997.
    """
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(directions[:, None, :], e2[None])
    determinant = np.einsum("rtk,tk->rt", p, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        f = 1.0 / determinant
        s = origins[:, None, :] - a[None]
        u = np.einsum("rtk,rtk->rt", s, p) * f
        q = np.cross(s, e1[None])
        v = np.einsum("rtk,rk->rt", q, directions) * f
        t = np.einsum("rtk,tk->rt", q, e2) * f
        margin = np.minimum(np.minimum(u, v), 1.0 - u - v)
    margin = np.where(np.isfinite(margin), margin, -1.0)
    return np.where((margin >= 0) & (t > 0), t, np.inf), margin


def sample_triangles(triangles: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(T, count, 3) points: even over each triangle, and as many along its edges and at its corners."""
    u = rng.random((len(triangles), count, 2))
    flip = u.sum(axis=2) > 1
    u[flip] = 1 - u[flip]
    third = count // 3
    u[:, :third, 1] *= 1e-6
    weights = np.concatenate([1 - u.sum(axis=2, keepdims=True), u], axis=2)
    for k in range(third):
        weights[:, k] = np.roll(weights[:, k], k, axis=1)
    return np.einsum("tck,tkx->tcx", weights, triangles.astype(np.float64))
