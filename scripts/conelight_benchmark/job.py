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
    ``frames``: 0 for a picture, else a sequence along ``motion``. ``timed``: a reference is not. ``kernel``: what
    stands in for Conelight's gather, by its name in ``kernels.py``. ``counts_fetches``: numbers of ``fetches.py`` are
    all that comes of it. ``bounces`` (Cycles): 0: as many as on the command line."""

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
    kernel: str = ""
    counts_fetches: bool = False
    bounces: int = 0

    def key(self, *surroundings: str) -> str:
        """A name for the results of this job, given what else they depend on."""
        return digest(json.dumps([self.as_dict(), *surroundings], sort_keys=True))

    def as_dict(self) -> dict[str, Any]:
        """All fields; of those that few jobs have only what they have."""
        values = dataclasses.asdict(self)
        rare = ("kernel", "counts_fetches", "bounces")
        return {name: value for name, value in values.items() if value or name not in rare}

    @property
    def process(self) -> tuple[str, str, bool]:
        """Jobs for which this is the same can be rendered by one process."""
        return self.engine, self.kernel, self.counts_fetches

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
