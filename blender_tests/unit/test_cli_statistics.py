# SPDX-License-Identifier: GPL-3.0-or-later
"""The object of --stats."""

from __future__ import annotations

import json
from typing import Any

from conelight_cli import statistics

KEYS = {
    "blender", "renderer", "resolution", "samples", "voxels", "levels", "occupied", "bounces", "features", "passes",
    "memory", "peak_rss", "wall_ms", "first_frame_ms", "warnings",
}


def report(frames: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    values: dict[str, Any] = {
        "blender": "5.2.3", "renderer": "conelight", "resolution": (4, 3), "wall_ms": 9.0, "first_frame_ms": 5.0,
        "warnings": [], **more,
    }
    return statistics.report(frames, **values)


def frame(**more: Any) -> dict[str, Any]:
    return {
        "voxels": (8, 4, 2), "levels": (), "occupied": 5, "bounces": 2, "features": {"glossy", "emission"},
        "passes": [{"name": "gather", "calls": 2, "cpu_ms": 3.0, "gpu_ms": None}],
        "memory": {"radiance": 64}, "warnings": ["no image"], "samples": 2, "first_frame_ms": 4.0, **more,
    }


def test_every_key_is_there_whatever_the_engine_says() -> None:
    assert set(report([])) == set(report([frame()])) == KEYS


def test_one_frame_comes_through() -> None:
    made = report([frame(renderer="llvmpipe")])
    assert made["renderer"] == "llvmpipe"
    assert made["voxels"] == [8, 4, 2]
    assert made["features"] == ["emission", "glossy"]
    assert made["passes"] == [{"name": "gather", "calls": 2, "cpu_ms": 3.0, "gpu_ms": 0.0}]
    assert made["first_frame_ms"] == 4.0
    assert json.loads(json.dumps(made)) == made


def test_frames_are_added_up() -> None:
    made = report([frame(), frame(warnings=["no image", "late"], first_frame_ms=1.0, occupied=6)], warnings=["framed"])
    assert made["passes"] == [{"name": "gather", "calls": 4, "cpu_ms": 6.0, "gpu_ms": 0.0}]
    assert made["warnings"] == ["framed", "no image", "late"]
    assert made["first_frame_ms"] == 4.0
    assert made["occupied"] == 6


def test_peak_memory_is_in_bytes() -> None:
    assert 2**20 < statistics.peak_memory() < 2**40
