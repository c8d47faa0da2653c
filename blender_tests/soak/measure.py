# SPDX-License-Identifier: GPL-3.0-or-later
"""What a process holds: memory, and objects in the GL context that is current; and whether that grows."""

from __future__ import annotations

import ctypes
import gc
import os
from dataclasses import dataclass, field

from addon.gpu.loader import current_context_loader

#: Kinds of GL objects, each with the function that says whether a name is one.
KINDS = ("Buffer", "Texture", "Framebuffer", "Renderbuffer", "VertexArray", "Sampler", "Program", "Shader", "Query")
#: Names that are looked at: drivers give the lowest that is free.
MOST_NAMES = 4096
#: Of the measurements: what comes before is warming up (caches of drivers, allocators and Blender).
WARM_UP = 0.25
#: Growth that is no leak: allocators keep and round.
SLACK_BYTES = 4 << 20


def gl_objects() -> dict[str, int]:
    """How many objects of each kind there are in the current context."""
    loader = current_context_loader()
    found = {}
    for kind in KINDS:
        exists = loader.function(f"glIs{kind}", ctypes.c_ubyte, ctypes.c_uint)
        found[kind] = sum(1 for name in range(1, MOST_NAMES) if exists(name))
    return found


def resident_bytes() -> int:
    """Memory of this process, after everything that is garbage is gone."""
    gc.collect()
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@dataclass
class Record:
    """Measurements after each round."""

    memory: list[int] = field(default_factory=list)
    objects: list[dict[str, int]] = field(default_factory=list)
    programs: list[int] = field(default_factory=list)  # compiled so far, where they stay from round to round

    def span(self) -> slice:
        """The longest run of rounds after warming up in which no program was compiled: those are kept for later use."""
        first = int(len(self.memory) * WARM_UP)
        counts = self.programs or [0] * len(self.memory)
        starts = [at for at in range(first, len(counts)) if at == first or counts[at] != counts[at - 1]]
        ends = [*starts[1:], len(counts)]
        return max((slice(*ends) for ends in zip(starts, ends, strict=True)), key=lambda s: s.stop - s.start)

    def growth(self) -> float:
        """Bytes for each round, from the least of the first eighth of :meth:`span` to the least of its last.

        Allocators give back at times that are theirs: only what is never given back counts.
        """
        kept = self.memory[self.span()]
        count = max(len(kept) // 8, 1)
        windows = [min(kept[at : at + count]) for at in range(0, len(kept) - count + 1, count)]
        return (windows[-1] - windows[0]) / max((len(windows) - 1) * count, 1)

    def problems(self) -> list[str]:
        """What grows, in sentences."""
        found = []
        rounds = len(self.memory) * (1.0 - WARM_UP)  # what the span grows by goes on in all of them
        if self.growth() * rounds > SLACK_BYTES + 0.01 * self.memory[-1]:
            found.append(f"memory grows by {self.growth():.0f} bytes each time")
        settled = self.objects[int(len(self.objects) * WARM_UP):]
        for kind in settled[0] if settled else ():
            counts = [objects[kind] for objects in settled]
            if len(set(counts)) > 1:
                found.append(f"objects of kind {kind} were {counts[0]} and became {counts[-1]}, at most {max(counts)}")
        return found

    def summary(self) -> str:
        first, span = self.memory[int(len(self.memory) * WARM_UP)], self.span()
        objects = ", ".join(f"{count} {kind}" for kind, count in self.objects[-1].items() if count) or "no GL objects"
        return (
            f"{len(self.memory)} times: {first / 2**20:.1f} MiB after warming up, {self.memory[-1] / 2**20:.1f} MiB in "
            f"the end ({self.growth():+.0f} bytes each time in {span.stop - span.start} between which no "
            f"program was compiled); left: {objects}"
        )
