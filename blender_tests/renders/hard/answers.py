# SPDX-License-Identifier: GPL-3.0-or-later
"""What pictures of the hard cases must be: by formula, or as Cycles rendered them once (answers.json, page.py)."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np

from .case import Case

FILE = Path(__file__).with_name("answers.json")
COMMAND = "the scene has changed since its answer was stored: python -m blender_tests.renders.hard.page"


@functools.cache
def read() -> dict[str, dict[str, Any]]:
    """By case: ``scene``, its fingerprint, ``cycles`` and ``eevee``, means of their pictures and of the parts."""
    return json.loads(FILE.read_text(encoding="ascii")) if FILE.exists() else {}


def of(case: Case, like: np.ndarray) -> np.ndarray:
    """Means of the picture and of its parts, as many as in ``like``. Raises KeyError when Cycles was not asked."""
    if case.exact is not None:
        return np.full(len(like), case.exact)
    return np.array(read()[case.same_as or case.name]["cycles"])
