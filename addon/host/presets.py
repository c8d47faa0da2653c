# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of quality. They govern what costs time and memory, and leave amounts and switches as the user set them.

Which preset is chosen is not stored: it is read off the values, so it never disagrees with them. Needs no Blender.
"""

from __future__ import annotations

import math
from typing import Any

from ..settings import PRESETS, preset

#: Shown when the values are those of no preset.
CUSTOM = "custom"

#: The settings that presets govern, in the order of their first mention.
GOVERNED: tuple[str, ...] = tuple(dict.fromkeys(name for values in PRESETS.values() for name in values))

#: (identifier, label, help) of each choice.
ITEMS: tuple[tuple[str, str, str], ...] = (
    *((name, name.capitalize(), f"Settings of the preset {name}") for name in PRESETS),
    (CUSTOM, "Custom", "Settings of no preset. Choosing this changes nothing"),
)


def matching_preset(values: Any) -> str:
    """The preset whose values the attributes of ``values`` have, or :data:`CUSTOM`."""
    for name in PRESETS:
        wanted = preset(name)
        if all(_same(getattr(values, setting), getattr(wanted, setting)) for setting in GOVERNED):
            return name
    return CUSTOM


def _same(stored: Any, wanted: Any) -> bool:
    """Whether a value is the wanted one, as Blender stores it: in single precision."""
    return math.isclose(stored, wanted, rel_tol=1e-6) if isinstance(wanted, float) else stored == wanted


def apply_preset(values: Any, name: str) -> None:
    """Sets the governed attributes of ``values``. Raises KeyError for an unknown preset."""
    if name == CUSTOM:
        return
    wanted = preset(name)
    for setting in GOVERNED:
        setattr(values, setting, getattr(wanted, setting))
