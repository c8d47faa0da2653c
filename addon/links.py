# SPDX-License-Identifier: GPL-3.0-or-later
"""How many links voxel faces have: rays that find which others they see."""

from __future__ import annotations

#: Where faces are few, the light that a small bright patch sends, or that comes through a door, rests on few links, and
#: their noise is that of the whole picture's brightness. There are at least so many links in all for one ray of each
#: face, and more by the square of that, so that twice the rays halve this noise, ...
LEAST_IN_ALL = 1 << 14
#: ... but no more than so many of a face on account of that.
MOST_FOR_FEW = 64


def link_count(bounce_rays: int, faces: float) -> int:
    """Links of each of ``faces`` faces: ``bounce_rays``, or more where faces are few; four to a texel."""
    least = LEAST_IN_ALL * bounce_rays**2
    wanted = max(bounce_rays, min(int(least / max(faces, 1.0)), MOST_FOR_FEW))
    return -(-wanted // 4) * 4
