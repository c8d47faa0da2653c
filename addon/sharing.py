# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether instances share the triangles of their mesh, or each has its own in grid space."""

from __future__ import annotations

import numpy as np

from .gpu.interface import TRIANGLE_BYTES
from .scene import SceneData

#: Bytes that sharing has to save. It has a price: whoever looks at a triangle transforms it, and rays take 1.2 to 1.6
#: times as long, as measured.
LEAST_SAVED = 1 << 20


def triangle_counts(scene: SceneData) -> np.ndarray:
    """(I,) int64, triangles of each instance."""
    counts = np.array([len(mesh.triangle_vertices) for mesh in scene.meshes], np.int64)
    return counts[np.array([instance.mesh for instance in scene.instances], np.int64)]


def shares_triangles(scene: SceneData) -> bool:
    """Whether each mesh's triangles are kept once, however many instances it has."""
    used = {instance.mesh for instance in scene.instances}
    once = sum(len(scene.meshes[index].triangle_vertices) for index in used)
    return (int(triangle_counts(scene).sum()) - once) * TRIANGLE_BYTES >= LEAST_SAVED
