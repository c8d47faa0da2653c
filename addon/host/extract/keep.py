# SPDX-License-Identifier: GPL-3.0-or-later
"""Data that was read again and says the same stays the same object: what is made of it need not be made again."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


def kept(new: T, old: T | None) -> T:
    """``old`` where it says the same as ``new``; a tuple keeps those of its items that do."""
    if isinstance(new, tuple) and isinstance(old, tuple):
        items: Any = tuple(kept(a, b) for a, b in zip(new, old, strict=False)) + new[len(old) :]
        return old if len(items) == len(old) and all(a is b for a, b in zip(items, old, strict=True)) else items
    return old if old is not None and says_the_same(new, old) else new


def says_the_same(a: Any, b: Any) -> bool:
    """Whether two pieces of scene data are equal to the last number."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    if dataclasses.is_dataclass(a):
        return all(says_the_same(getattr(a, name), getattr(b, name)) for name in a.__dataclass_fields__)
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(says_the_same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(says_the_same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b)
