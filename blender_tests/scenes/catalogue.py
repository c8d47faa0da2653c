# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that have reference pictures, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from . import alpha_cards, balls, cornell, sky_sphere, textured


@dataclass(frozen=True)
class ReferenceScene:
    """``settings``: of Conelight, besides the defaults."""

    build: Callable[[], Any]
    size: tuple[int, int]  # pixels
    settings: dict[str, Any] = field(default_factory=dict)


#: Small pictures with few passes: references are compared pixel by pixel, noise included.
SCENES: dict[str, ReferenceScene] = {
    "cornell_area": ReferenceScene(partial(cornell.scene, "area"), (96, 96), {"voxels": 64}),
    "cornell_point": ReferenceScene(partial(cornell.scene, "point"), (96, 96), {"voxels": 64}),
    "cornell_emitter": ReferenceScene(partial(cornell.scene, "emitter"), (96, 96), {"voxels": 64}),
    "sky_sphere": ReferenceScene(sky_sphere.scene, (96, 64), {"voxels": 48}),
    "textured": ReferenceScene(textured.scene, (96, 64), {"voxels": 48}),
    "balls": ReferenceScene(balls.scene, (128, 64), {"voxels": 64}),
    "alpha_cards": ReferenceScene(alpha_cards.scene, (96, 64), {"voxels": 48}),
}
