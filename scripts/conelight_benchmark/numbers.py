# SPDX-License-Identifier: GPL-3.0-or-later
"""All numbers of a report, from results that are there: one object that can be written as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import measure
from .catalogue import BenchmarkScene
from .job import Job
from .peers import PEERS
from .plan import Plan
from .store import Result, Store

Row = dict[str, Any]

#: The peer whose error is what the time to quality is asked for.
TARGET_PEER = "cycles-64"
#: The peer that a moving camera is measured against.
MOVING_PEER = "cycles-4-oidn-fast"
#: Times as large as Conelight's error, at least, is that of a published kernel to be at equal time.
KERNEL_BAR = 4.0
#: What points on Conelight's curve of error against time are of.
OWN_GROUPS = ("Conelight", "samples")
#: Kernels whose fetches are told for each voxel face; those of others for each pixel and pass.
FACE_KERNELS = ("link", "inject", "bounce", "cones")
#: Kernels whose rate of fetches is told: the passes of these names do nothing else.
RATED_KERNELS = ("gather", "link", "inject")
#: What ``fetch_rate.py`` measures.
RAW_KINDS = ("list", "far list", "byte", "trilinear", "buffer")
#: Of which shares are told.
LIST_KINDS = ("list", "far list")


def reference_of(plan: Plan, store: Store) -> measure.Reference | None:
    """The path-traced answer for a scene's pictures, if it is complete."""
    results = {name: store.result(plan.scene, job) for name, job in plan.reference.items()}
    complete = {name: result for name, result in results.items() if result is not None}
    return measure.Reference.of(plan.scene, complete) if results and len(complete) == len(results) else None


def of_scene(plan: Plan, store: Store, reference: measure.Reference | None) -> Row:
    """Everything about one scene. ``stills`` and ``frames`` have one entry for each peer that has a result."""
    scene = plan.scene
    entry: Row = {"scene": scene.name, "measure": scene.measure, "stills": [], "frames": []}
    if reference is not None:
        job = plan.reference["a"]
        entry |= {"size": list(job.size), "reference_samples": 2 * (job.samples or 0)}
        entry["reference_noise"] = {"full": measure.reference_noise(reference.full)}
        if reference.indirect is not None:
            entry["reference_noise"]["indirect"] = measure.reference_noise(reference.indirect)
    for name, job in plan.stills.items():
        result = store.result(scene, job)
        if result is not None and (reference is not None or not scene.has_reference):
            entry["stills"].append(_cost(name, result) | _errors(scene, name, job, result, reference))
    compare_kernels(entry)
    counted = {name: store.result(scene, job) for name, job in plan.fetches.items()}
    entry["fetches"] = [
        _fetches(name, result.info, store.result(scene, plan.stills[name]))
        for name, result in counted.items() if result is not None
    ]  # fmt: skip
    entry["frames"] = list(_sequences(plan, store))
    return entry


def compare_kernels(entry: Row) -> None:
    """Adds to the rows of published kernels, as ``equal_time``, what Conelight reaches in their time. Where it has no
    point that is as quick, ``is_reached`` is false and its quickest one counts."""
    curve = _front(entry["stills"], OWN_GROUPS, "judged")
    for row in entry["stills"]:
        if row["group"] == "kernels" and curve:
            own = error_at(curve, row["cpu_ms"])
            ratio = row["judged"]["relative_mse"] / own
            row["equal_time"] = {
                "relative_mse": own, "ratio": ratio, "is_reached": curve[0][0] <= row["cpu_ms"],
                "bar": KERNEL_BAR, "holds": ratio >= KERNEL_BAR,
            }


def _fetches(name: str, info: dict[str, Any], timed: Result | None = None) -> Row:
    """Texel fetches by kernel: of the whole render, and for each voxel face or pixel and pass.

    ``timed``: the same peer's picture. It tells the machine's raw rates, and so what shares of those of lists are
    reached.
    """
    statistics = info["statistics"]
    pixels = math.prod(statistics["resolution"]) * statistics["mean_samples"]
    each = {name: max(statistics["faces"] if name in FACE_KERNELS else pixels, 1) for name in info["fetches"]}
    row = {
        "peer": name, "samples": statistics["samples"], "total": info["fetches"],
        "each": {kernel: count / each[kernel] for kernel, count in info["fetches"].items()},
    }
    if timed is not None and "fetch_rates" in timed.info:
        row["raw"] = timed.info["fetch_rates"]
        row["rates"] = _rates(row["each"], timed.info["statistics"])
        row["shares"] = {
            kernel: {kind: rate / row["raw"][kind] for kind in LIST_KINDS} for kernel, rate in row["rates"].items()
        }
    return row


def _rates(each: dict[str, float], statistics: dict[str, Any]) -> dict[str, float]:
    """Fetches per second of CPU time of kernels that are a pass of their own."""
    pixels = math.prod(statistics["resolution"]) * statistics["mean_samples"]
    seconds = {entry["name"]: entry["cpu_ms"] / 1e3 for entry in statistics["passes"]}
    return {
        kernel: each[kernel] * (statistics["faces"] if kernel in FACE_KERNELS else pixels) / seconds[kernel]
        for kernel in RATED_KERNELS if kernel in each and seconds.get(kernel, 0.0) > 0.0
    }  # fmt: skip


def _cost(name: str, result: Result) -> Row:
    info = result.info
    kept = ("cpu_ms", "wall_ms", "preparation_cpu_ms", "preparation_wall_ms", "peak_rss", "statistics")
    return {"peer": name, "group": PEERS[name].group} | {key: info[key] for key in kept if key in info}


def _errors(
    scene: BenchmarkScene, name: str, job: Job, result: Result, reference: measure.Reference | None
) -> Row:
    """Measures of one picture; ``judged`` is what bars are about."""
    picture = result.picture()
    row: Row = {"mean": float(picture.mean())}
    if reference is None:
        if scene.measure == "constant":
            row["judged"] = measure.constancy(picture, scene.expected)
        else:
            row["judged"] = {"bias": measure.leak(picture, scene.irradiance)}
    else:
        row["full"] = measure.compare(picture, reference.full)
        row["full"]["flip"] = measure.flip(picture, reference.full.mean)
        if reference.indirect is not None:
            own = measure.indirect_of(scene, job, result, reference)
            row["indirect"] = measure.compare(own, reference.indirect)
        row["judged"] = row[scene.measure]
    bar = scene.bars.get(PEERS[name].preset or "") if PEERS[name].group == "Conelight" else None
    if bar is not None:
        error = row["judged"].get("relative_mse", row["judged"].get("largest", 0.0))
        holds = abs(row["judged"]["bias"]) <= bar.bias and (not bar.error or error <= bar.error)
        row["bar"] = {"error": bar.error, "bias": bar.bias, "holds": holds}
    return row


def _sequences(plan: Plan, store: Store) -> Sequence[Row]:
    results = {name: store.result(plan.scene, job) for name, job in plan.sequence_reference.items()}
    complete = {name: result for name, result in results.items() if result is not None}
    if not plan.sequences or len(complete) < len(results):
        return []
    answers = [measure.Answer.of(complete, frame) for frame in range(complete["a"].info["frames"])]
    rows = []
    for name, job in plan.sequences.items():
        result = store.result(plan.scene, job)
        if result is None:
            continue
        pictures = [result.picture(frame=frame) for frame in range(job.frames)]
        errors = [measure.compare(picture, answer) for picture, answer in zip(pictures, answers, strict=True)]
        mean, rms = measure.flicker(pictures, answers)
        each = result.info["each"]
        rows.append({
            "peer": name, "frames": job.frames, "size": list(job.size), "cpu_ms": result.info["cpu_ms"],
            "wall_ms": result.info["wall_ms"], "peak_rss": result.info["peak_rss"],
            "relative_mse": sum(error["relative_mse"] for error in errors) / len(errors),
            "bias": sum(error["bias"] for error in errors) / len(errors), "flicker": mean, "flicker_rms": rms,
            "first_cpu_ms": each[0]["cpu_ms"], "first_wall_ms": each[0]["wall_ms"],
            "first_relative_mse": errors[0]["relative_mse"], "each_cpu_ms": [frame["cpu_ms"] for frame in each],
            "statistics": each[-1]["statistics"],
        })
    return rows


def find(entry: Row, peer: str, where: str = "stills") -> Row | None:
    """The row of a peer, if there is one."""
    return next((row for row in entry[where] if row["peer"] == peer), None)


def _front(rows: Sequence[Row], groups: Sequence[str], measure: str) -> list[tuple[float, float]]:
    """CPU time (ms) and relative mean squared error of what is both slower and better than all before it."""
    found: list[tuple[float, float]] = []
    for row in sorted(rows, key=lambda row: row["cpu_ms"]):
        if row["group"] in groups and "relative_mse" in row.get(measure, {}):
            error = max(row[measure]["relative_mse"], 1e-12)
            if not found or error < found[-1][1]:
                found.append((row["cpu_ms"], error))
    return found


def time_to(entry: Row, error: float) -> float | None:
    """CPU time (ms) in which Conelight reaches a full-image error: between the two measurements around it, by a
    straight line between logarithms; None: no measurement reaches it."""
    curve = _front(entry["stills"], OWN_GROUPS, "full")
    if not curve or curve[-1][1] > error:
        return None
    return _between([(math.log(1.0 / point), cpu) for cpu, point in curve], math.log(1.0 / error))


def error_at(curve: Sequence[tuple[float, float]], cpu_ms: float) -> float:
    """Error reached in a time, by a straight line between logarithms; outside the curve that of its end."""
    return _between([(math.log(cpu), error) for cpu, error in curve], math.log(cpu_ms))


def _between(points: Sequence[tuple[float, float]], x: float) -> float:
    """y at x, its logarithm linear between ``points`` (x ascending), constant outside."""
    return float(np.exp(np.interp(x, [point[0] for point in points], np.log([point[1] for point in points]))))
