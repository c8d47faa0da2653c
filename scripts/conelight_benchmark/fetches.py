# SPDX-License-Identifier: GPL-3.0-or-later
"""How often shaders fetch texels: their text is changed so that they count. Only for renders that are not timed.

Counted are texture fetches and image loads in compute shaders; reads of storage buffers are not.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import moderngl
import numpy as np

from addon.gpu import context, interface
from addon.gpu.context import GpuContext
from addon.gpu.program import Source
from addon.pipeline import Pipeline, Progress

#: Functions that are counted, and their parameters. A macro is not expanded again within itself.
COUNTED = {
    "texelFetch": "s, p, l", "texture": "s, p", "textureLod": "s, p, l", "textureGrad": "s, p, x, y",
    "imageLoad": "i, p",
}
#: Kernels that can be told apart.
MAX_KERNELS = 64
_MAIN = re.compile(r"^void main\(\)", re.MULTILINE)


def counting(text: str, index: int) -> str:
    """The text of a compute shader, which then adds its fetches to the sum ``index``: two words, low and high."""
    version, _, rest = text.partition("\n")
    head = [f"#define {name}({of}) (fetch_count++, {name}({of}))" for name, of in COUNTED.items()]
    head += [
        f"layout(std430, binding = {len(interface.BUFFERS)}) buffer FetchSums {{ uint fetch_sums[]; }};",
        "uint fetch_count = 0u;",
    ]
    body, mains = _MAIN.subn("void main_that_fetches()", rest)
    if not mains:  # several: conditions choose one
        raise ValueError("a shader has no function main()")
    tail = (
        "void main()\n{\n    main_that_fetches();\n"
        f"    uint before = atomicAdd(fetch_sums[{2 * index}], fetch_count);\n"
        f"    if (before + fetch_count < before) {{\n        atomicAdd(fetch_sums[{2 * index + 1}], 1u);\n    }}\n}}\n"
    )
    return "\n".join([version, *head, body]) + tail


class FetchCounter:
    """The sums of the context that rendered last, by kernel: those of all it rendered."""

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}
        self._kernels: list[str] = []
        self._gpu: GpuContext | None = None
        self._sums: moderngl.Buffer | None = None

    def instrument(self, file: str, source: Source) -> Source:
        """``source`` of a compute shader, so that it counts; others as they are."""
        name, _, kind = file.rpartition("/")[2].partition(".")
        if not kind.startswith("comp."):
            return source
        if name not in self._kernels:
            self._kernels.append(name)
            assert len(self._kernels) <= MAX_KERNELS
        return Source(counting(source.text, self._kernels.index(name)), source.files)

    def bind(self, gpu: GpuContext) -> None:
        """Bind the sums for the next dispatch; a context that was not seen before begins at zero."""
        if gpu is not self._gpu:
            self._gpu = gpu
            self._sums = gpu.mgl.buffer(np.zeros(2 * MAX_KERNELS, np.uint32))
        assert self._sums is not None
        self._sums.bind_to_storage_buffer(len(interface.BUFFERS))

    def read(self) -> None:
        """Bring ``counts`` up to date; the context must be current."""
        assert self._sums is not None
        low, high = np.frombuffer(self._sums.read(), np.uint32).reshape(-1, 2).T.astype(object)
        self.counts = {name: int(low[i] + (high[i] << 32)) for i, name in enumerate(self._kernels)}

    def release(self) -> None:
        """Free the sums; the context must be current."""
        if self._sums is not None:
            self._sums.release()
        self._gpu = self._sums = None


def install() -> FetchCounter:
    """From now on all renders of this process count; to be called once, before the first."""
    counter = FetchCounter()
    resolve, dispatch, dispatch_indirect = context.resolve, GpuContext.dispatch, GpuContext.dispatch_indirect
    sample = Pipeline.sample

    def resolve_counting(file: str, defines: Mapping[str, object], texts: Mapping[str, str] | None = None) -> Source:
        return counter.instrument(file, resolve(file, defines, texts))

    def dispatch_counting(self: GpuContext, *arguments: Any) -> None:
        counter.bind(self)
        dispatch(self, *arguments)

    def dispatch_indirect_counting(self: GpuContext, *arguments: Any) -> None:
        counter.bind(self)
        dispatch_indirect(self, *arguments)

    def sample_counting(self: Pipeline) -> Iterator[Progress]:
        yield from sample(self)
        counter.read()

    context.resolve = resolve_counting  # type: ignore[assignment]
    GpuContext.dispatch = dispatch_counting  # type: ignore[assignment, method-assign]
    GpuContext.dispatch_indirect = dispatch_indirect_counting  # type: ignore[assignment, method-assign]
    Pipeline.sample = sample_counting  # type: ignore[method-assign]
    return counter
