# SPDX-License-Identifier: GPL-3.0-or-later
"""What a hard case is: a scene built from numbers, and the answer that it has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

#: Deviation from the answer that a case allows, as a share of it, when it says nothing else.
BOUND = 0.02
#: Of each of the six parts of a picture, in shares of the picture's mean.
PARTS_BOUND = 0.05

#: The same scene elsewhere must look the same: in another place, turned by 17 degrees, three times as large.
VARIANTS = ("translation", "rotation", "scale")
CHECKS = ("finite", "brightness", "parts", "repeat", *VARIANTS)


@dataclass(frozen=True)
class Case:
    """One scene and what its picture must be.

    ``exact``: the mean of the picture and of each of its parts, W/(m2 sr), by ``formula``; None: Cycles says it.
    ``same_as``: another case of which Cycles' picture is the answer, where Cycles itself cannot render this one.
    ``offset``, ``scale``: where the scene lies and how large it is; it is moved there last.
    ``samples``, ``cycles_samples``: passes of the picture, and of Cycles'.
    ``reason``: why a bound is not tighter, or why there are more samples.
    ``missed``: checks that do not hold yet, and why.
    ``skipped``: checks that mean nothing for this case, and why.
    """

    name: str
    what: str
    build: Callable[[], Any]
    exact: float | None = None
    formula: str = ""
    same_as: str = ""
    bound: float = BOUND
    parts_bound: float = PARTS_BOUND
    reason: str = ""
    size: tuple[int, int] = (48, 32)
    voxels: int = 32
    samples: int = 16
    cycles_samples: int = 1024
    settings: Mapping[str, Any] = field(default_factory=dict)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0
    missed: Mapping[str, str] = field(default_factory=dict)
    skipped: Mapping[str, str] = field(default_factory=dict)

    @property
    def checks(self) -> tuple[str, ...]:
        return tuple(check for check in CHECKS if check not in self.skipped)
