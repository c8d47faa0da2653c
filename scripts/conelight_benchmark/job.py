# SPDX-License-Identifier: GPL-3.0-or-later
"""One measurement: a scene rendered by one engine with one set of numbers, known by a hash of all it depends on."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass
from typing import Any

from .catalogue import Motion


@dataclass(frozen=True)
class Job:
    """``assignments``: settings of Conelight as on a command line. ``denoiser`` (Cycles): empty, ``default`` or
    ``fast``. ``lamps_only`` (Cycles): only light that comes straight from lamps, and what the camera sees glowing.
    ``frames``: 0 for a picture, else a sequence along ``motion``. ``timed``: a reference is not."""

    engine: str
    size: tuple[int, int]
    samples: int | None = None
    preset: str | None = None
    assignments: tuple[tuple[str, str], ...] = ()
    denoiser: str = ""
    seed: int = 0
    passes: bool = False
    lamps_only: bool = False
    frames: int = 0
    motion: Motion | None = None
    timed: bool = True

    def key(self, *surroundings: str) -> str:
        """A name for the results of this job, given what else they depend on."""
        return digest(json.dumps([self.as_dict(), *surroundings], sort_keys=True))

    def as_dict(self) -> dict[str, Any]:
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Job:
        """The inverse of :meth:`as_dict`, also after a way through JSON."""
        motion = values["motion"] and Motion(tuple(values["motion"]["travel"]), values["motion"]["turn"])
        assignments = tuple((name, value) for name, value in values["assignments"])
        return cls(**{**values, "size": tuple(values["size"]), "assignments": assignments, "motion": motion})


def digest(*texts: str | bytes) -> str:
    """A short name for a content."""
    result = hashlib.sha256()
    for text in texts:
        data = text.encode() if isinstance(text, str) else text
        result.update(len(data).to_bytes(8, "little") + data)
    return result.hexdigest()[:20]
