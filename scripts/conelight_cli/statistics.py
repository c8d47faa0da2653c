# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that ``--stats`` writes: times in milliseconds, sizes in bytes."""

from __future__ import annotations

import resource
import sys
from collections.abc import Sequence
from typing import Any


def peak_memory() -> int:
    """Most memory that this process ever held, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def merged(frames: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Statistics of several frames as one: passes are added up, warnings collected, the rest is of the last frame."""
    result = dict(frames[-1]) if frames else {}
    passes: dict[str, dict[str, Any]] = {}
    warnings: dict[str, None] = {}
    for frame in frames:
        for entry in frame.get("passes", ()):
            total = passes.setdefault(entry["name"], {"name": entry["name"], "calls": 0, "cpu_ms": 0.0, "gpu_ms": 0.0})
            for key in ("calls", "cpu_ms", "gpu_ms"):
                total[key] += entry.get(key) or 0
        warnings.update(dict.fromkeys(frame.get("warnings", ())))
    return {**result, "passes": list(passes.values()), "warnings": list(warnings)}


def report(
    frames: Sequence[dict[str, Any]], *, blender: str, renderer: str, resolution: tuple[int, int], wall_ms: float,
    first_frame_ms: float, warnings: Sequence[str],
) -> dict[str, Any]:
    """The whole object. ``frames`` are what the engine says of each; ``first_frame_ms`` is used if it says none."""
    total = merged(frames)
    first = frames[0].get("first_frame_ms") if frames else None
    return {
        "blender": blender,
        "renderer": total.get("renderer") or renderer,
        "resolution": list(resolution),
        "samples": total.get("samples", 0),
        "voxels": list(total.get("voxels", (0, 0, 0))),
        "levels": list(total.get("levels", ())),
        "occupied": total.get("occupied", 0),
        "bounces": total.get("bounces", 0),
        "features": sorted(total.get("features", ())),
        "passes": total["passes"],
        "memory": dict(total.get("memory", {})),
        "peak_rss": peak_memory(),
        "wall_ms": wall_ms,
        "first_frame_ms": first if first is not None else first_frame_ms,
        "warnings": [*warnings, *(text for text in total["warnings"] if text not in warnings)],
    }
