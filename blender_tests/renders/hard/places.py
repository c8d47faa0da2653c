# SPDX-License-Identifier: GPL-3.0-or-later
"""How large a scene is, and how far away."""

from __future__ import annotations

from . import stage
from .case import Case

SCALES = (1e-3, 0.1, 100.0, 1e4)
DISTANCES = (10.0, 1e3, 1e5, 1e6)

COURT = Case("court", "what others are made of: walls, a box and a ball under a lamp and a grey sky", stage.court)


def _scaled(scale: float) -> Case:
    return Case(
        f"scale_{scale:g}", f"the court, {4 * scale:g} m wide", stage.court, same_as="court",
        formula="as the court, whose lamp has less power by the square of its size", scale=scale,
    )  # fmt: skip


def _far(distance: float) -> Case:
    return Case(
        f"far_{distance:g}", f"the court, {distance:g} m from the origin along x, y and z", stage.court,
        same_as="court", formula="as the court", offset=(distance, -distance, distance),
    )  # fmt: skip


CASES = (COURT, *(_scaled(scale) for scale in SCALES), *(_far(distance) for distance in DISTANCES))
