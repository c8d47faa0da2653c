# SPDX-License-Identifier: GPL-3.0-or-later
"""Published cone-tracing kernels in place of Conelight's own gather, over the same voxels, to measure against.

They are no part of the engine: a process that calls :func:`install` has its gather's shader replaced.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from addon.gpu import context
from addon.gpu.program import Source

#: Names, as of peers, and what ``kernels/gather.comp.glsl`` calls them.
KERNELS = {"seed-6": "KERNEL_SEED_6", "six-60": "KERNEL_SIX_60", "sixteen": "KERNEL_SIXTEEN"}
SHADER = Path(__file__).parent / "kernels" / "gather.comp.glsl"
_REPLACED = "passes/gather.comp.glsl"


def install(name: str) -> None:
    """From now on the gather of this process is a kernel of :data:`KERNELS`; to be called once, before any render, in a
    process that only renders with setting ``gather_mode`` ``CONES``."""
    original = context.resolve
    text = SHADER.read_text(encoding="utf-8")
    numbers = {define: number for number, define in enumerate(KERNELS.values())}
    chosen = numbers | {"KERNEL": KERNELS[name]}

    def resolve(file: str, defines: Mapping[str, object], texts: Mapping[str, str] | None = None) -> Source:
        if file != _REPLACED:
            return original(file, defines, texts)
        if not defines["GATHER_CONES"]:
            raise ValueError(f"kernel '{name}' stands in for cones, but the gather was to trace rays")
        return original(file, {**defines, **chosen}, {**(texts or {}), file: text})

    context.resolve = resolve  # type: ignore[assignment]
