# SPDX-License-Identifier: GPL-3.0-or-later
"""What the steps of a frame share: how far they are, how they fail, and which of them are still valid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .grid import VoxelGrid
from .levels import Plan


class PipelineError(RuntimeError):
    """Something could not be rendered. The text is a sentence for the user."""


@dataclass(frozen=True)
class Progress:
    """How far a generator is, 0..1, and what it is doing."""

    fraction: float
    text: str


class Memo:
    """Which steps are still valid: a step is redone when its inputs differ or a step before it was redone."""

    def __init__(self) -> None:
        self._keys: dict[str, tuple] = {}

    def has(self, step: str) -> bool:
        return step in self._keys

    def stale(self, step: str, *inputs: Any) -> bool:
        old = self._keys.get(step)
        is_stale = old is None or not same(old, inputs)
        if is_stale:
            self._keys.pop(step, None)  # it is about to be redone, and may be interrupted
        return is_stale

    def done(self, step: str, *inputs: Any) -> None:
        self._keys[step] = inputs

    def copy(self) -> Memo:
        """As it is now."""
        made = Memo()
        made._keys = dict(self._keys)
        return made

    def forget(self, *steps: str) -> None:
        for step in steps:
            self._keys.pop(step, None)


def same(a: Any, b: Any) -> bool:
    """Whether two inputs of a step are. Large things are compared by identity."""
    if a is b:
        return True
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return isinstance(a, (int, float, str, bool, VoxelGrid, Plan)) and type(a) is type(b) and a == b
