# SPDX-License-Identifier: GPL-3.0-or-later
"""How many texels this machine fetches in a second of CPU time, when a shader does nothing else: what tracing kernels
are held against. Measured in the context that has just rendered."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from addon.gpu import interface
from addon.gpu.context import GpuContext, Kernel
from addon.pipeline import Pipeline, Progress

SHADER = Path(__file__).parent / "kernels" / "fetch_rate.comp.glsl"
#: What is fetched: as the shader calls it, and of how many entries. Half a MiB of lists fits into caches near a core,
#: as voxels around a ray do; 16 MiB do not, as the triangles of a large scene.
KINDS = {
    "list": ("KIND_LIST", 1 << 15), "far list": ("KIND_LIST", 1 << 20), "byte": ("KIND_BYTE", 1 << 15),
    "trilinear": ("KIND_TRILINEAR", 1 << 15), "buffer": ("KIND_BUFFER", 1 << 15),
}  # fmt: skip
THREADS, FETCHES = 1 << 14, 256
#: Runs of each kind, of which the quickest counts: others work on the machine too.
RUNS = 3


def measure(gpu: GpuContext, *, threads: int = THREADS) -> dict[str, float]:
    """Fetches per second of CPU time of each kind; the context must be current."""
    numbers = {define: number for number, define in enumerate(dict.fromkeys(define for define, _ in KINDS.values()))}
    results = gpu.buffer("fetch results", size=4 * threads)
    rates = {}
    try:
        for name, (define, entries) in KINDS.items():
            texts = {"passes/fetch_rate.comp.glsl": SHADER.read_text(encoding="utf-8")}
            kernel = gpu.kernel("fetch_rate", {**numbers, "KIND": numbers[define], "FETCHES": FETCHES}, texts)
            source, bind = _source(gpu, define, entries)
            bind()
            results.bind_to_storage_buffer(interface.slot("BUF_RESULTS"))
            kernel.set(entries=entries)
            seconds = min(_seconds(gpu, kernel, threads) for _ in range(RUNS))
            rates[name] = threads * FETCHES / max(seconds, 1e-9)
            gpu.free(source)
    finally:
        gpu.free(results)
    return rates


def _source(gpu: GpuContext, kind: str, entries: int) -> tuple[Any, Callable[[], None]]:
    """What is fetched from, and what binds it."""
    rng = np.random.default_rng(0)
    if kind == "KIND_BUFFER":
        buffer = gpu.buffer("fetch source", rng.integers(0, 1 << 32, entries, np.uint32))
        return buffer, lambda: buffer.bind_to_storage_buffer(interface.slot("BUF_WORK"))
    texture: Any
    if kind == "KIND_LIST":
        texture = gpu.list_texture("fetch source", entries, 4, "u4", rng.integers(0, 99, (entries, 4), np.uint32))
        return texture, lambda: gpu.use_source(texture, "TEX_CELLS")
    size = (128, 128, entries >> 14)
    if kind == "KIND_BYTE":
        texture = gpu.texture_3d("fetch source", size, 1, "u1", rng.integers(0, 255, entries, np.uint8))
    else:
        texture = gpu.texture_3d("fetch source", size, 4, "f2", rng.random((entries, 4)).astype(np.float16))
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return texture, lambda: texture.use(interface.slot("TEX_CELLS"))


def _seconds(gpu: GpuContext, kernel: Kernel, threads: int) -> float:
    """Of CPU time of all threads."""
    with gpu.timed("fetch rate"):  # waits for what was before; the first run compiles, others count
        start = time.process_time()
        kernel.run_list(threads)
        gpu.mgl.finish()
        return time.process_time() - start


@contextmanager
def after_sample() -> Iterator[dict[str, float]]:
    """Whatever renders inside fills the rates, once, when its first sample is done."""
    rates: dict[str, float] = {}
    sample = Pipeline.sample

    def then_measure(self: Pipeline) -> Iterator[Progress]:
        yield from sample(self)
        if not rates:
            rates.update(measure(self.gpu))

    Pipeline.sample = then_measure  # type: ignore[method-assign]
    try:
        yield rates
    finally:
        Pipeline.sample = sample  # type: ignore[method-assign]
