# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of voxel faces as the shaders store it."""

from __future__ import annotations

import numpy as np

#: Bytes of the light of one face.
LIGHT_BYTES = 8


def unpack_light(stored: np.ndarray) -> np.ndarray:
    """Light of faces as lib/packed_light.glsl stores it, (N, 2) uint32 -> (N, 3) float32."""
    low, high = stored[:, 0], stored[:, 1]
    whole = np.stack([low & 0x3FFFF, low >> 18 | (high & 15) << 14, high >> 4 & 0x3FFFF], axis=1)
    return np.ldexp(whole.astype(np.float32), (high >> 22).astype(np.int32)[:, None] - 144)
