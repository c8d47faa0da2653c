# SPDX-License-Identifier: GPL-3.0-or-later
"""All hard cases by name."""

from __future__ import annotations

from . import lamps, looks, places, shapes, views
from .case import Case

CASES: dict[str, Case] = {
    case.name: case for module in (places, shapes, lamps, looks, views) for case in module.CASES
}
