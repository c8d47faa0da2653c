# SPDX-License-Identifier: GPL-3.0-or-later
"""Prefiltered radiance and opacity for cones: coarser and coarser levels of the six faces."""

from __future__ import annotations

from typing import Any

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from .voxelize import Voxels

#: Cells along the longest side of the finest level: cones are wide, what is finer they cannot see.
MAX_SIZE = 128


class ConeVolume:
    """Six facings side by side along z in one texture with levels; alpha is area opacity, colour premultiplied."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.levels: list[moderngl.Texture3D] = []
        self.first_level = 0
        self.sizes: list[tuple[int, int, int]] = []

    def bind(self, kernel: Kernel) -> None:
        """Bind what lib/cone.glsl reads."""
        raise NotImplementedError
