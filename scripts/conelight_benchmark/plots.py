# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots of error against time, samples and voxels, and pictures beside their reference."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from blender_tests.pictures import Picture, write

from .numbers import Row
from .peers import PEERS

matplotlib.use("Agg")

MIDDLE_GREY = 0.18  # what the mean of a reference is shown as


def of_scene(folder: Path, entry: Row) -> list[str]:
    """Writes the plots of a scene that has a reference; returns their file names."""
    rows = [row for row in entry["stills"] if "relative_mse" in row["judged"]]
    if not rows:
        return []
    names = [_error_and_time(folder, entry, [row for row in rows if row["group"] != "voxels"])]
    for group in ("samples", "voxels"):
        curve = [row for row in rows if row["group"] == group]
        if len(curve) > 1:
            names.append(_curve(folder, entry, group, curve))
    return names


def _error_and_time(folder: Path, entry: Row, rows: list[Row]) -> str:
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for curve in dict.fromkeys(PEERS[row["peer"]].curve for row in rows):
        points = [(row["cpu_ms"] / 1e3, _positive(row)) for row in rows if PEERS[row["peer"]].curve == curve]
        axes.loglog(*zip(*sorted(points), strict=True), "o-", label=curve)
    axes.set_xlabel("CPU time of the render, s")
    return _finish(folder, figure, entry, "time")


def _curve(folder: Path, entry: Row, group: str, rows: list[Row]) -> str:
    figure = Figure(figsize=(5, 3.5), layout="constrained")
    axes = figure.add_subplot()
    values = [PEERS[row["peer"]].samples if group == "samples" else PEERS[row["peer"]].voxels for row in rows]
    axes.loglog(values, [_positive(row) for row in rows], "o-", label="relative mean squared error", base=2)
    axes.loglog(values, [max(abs(row["judged"]["bias"]), 1e-6) for row in rows], "s--", label="|bias|", base=2)
    axes.set_yscale("log", base=10)
    axes.set_xlabel({"samples": "samples", "voxels": "voxels along the longest side"}[group])
    return _finish(folder, figure, entry, group)


def _positive(row: Row) -> float:
    return max(float(row["judged"]["relative_mse"]), 1e-6)


def _finish(folder: Path, figure: Figure, entry: Row, what: str) -> str:
    axes = figure.axes[0]
    part = "indirect light" if entry["measure"] == "indirect" else "whole picture"
    axes.set_title(f"{entry['scene']}, {part}")
    axes.set_ylabel("relative mean squared error")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend(fontsize="small")
    name = f"{entry['scene']}_{what}.png"
    figure.savefig(folder / name, dpi=110)
    return name


def pictures(folder: Path, scene: str, picture: Picture, reference: Picture) -> str:
    """Writes picture, reference and their signed difference side by side; returns the file name.

    Exposure brings the reference's mean to middle grey. The difference is relative to the reference, and to its mean
    where it is dark: grey where they agree, white where the picture is brighter by its own size, black where darker.
    """
    mean = max(float(reference.mean()), 1e-12)
    difference = (picture - reference) / (np.abs(reference) + 0.2 * mean)
    exposure = np.float32(MIDDLE_GREY / mean)
    parts = [encoded(picture * exposure), encoded(reference * exposure)]
    name = f"{scene}_pictures.png"
    write(folder / name, np.concatenate([*parts, np.clip(0.5 + 0.5 * difference, 0.0, 1.0)], axis=1))
    return name


def encoded(linear: Picture) -> npt.NDArray[np.float32]:
    """sRGB, 0..1."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055).astype(np.float32)
