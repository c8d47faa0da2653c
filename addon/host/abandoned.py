# SPDX-License-Identifier: GPL-3.0-or-later
"""GL objects in a context of Blender's whose owner is gone: they can only be freed while that context is current.

Blender lets go of a viewport's engine at any time. It is freed at once or in the next drawing of a 3D view.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable
from typing import Any

import bpy

from .legacy import Legacy

#: Arguments of :func:`free`.
_waiting: list[tuple[Any, Any, Callable[[], None] | None, Legacy | None]] = []
_handler: Any = None  # of Blender, while there is something to free


def abandon(
    context: Any, pipeline: Any, before: Callable[[], None] | None = None, legacy: Legacy | None = None
) -> None:
    """Frees as :func:`free`: now where the context is current, else when it is again. To be called anywhere."""
    global _handler
    if sys.is_finalizing():
        return  # the context ends as well
    if context.is_current:
        free(context, pipeline, before, legacy)
        return
    _waiting.append((context, pipeline, before, legacy))
    if _handler is None and not bpy.app.background:
        with contextlib.suppress(Exception):  # Blender is ending
            _handler = bpy.types.SpaceView3D.draw_handler_add(_on_draw, (), "WINDOW", "POST_PIXEL")


def free_abandoned() -> None:
    """Frees what lives in the context that is current."""
    for entry in list(_waiting):
        if entry[0].is_current:
            _waiting.remove(entry)
            free(*entry)


def free(
    context: Any, pipeline: Any, before: Callable[[], None] | None = None, legacy: Legacy | None = None
) -> None:
    """Frees ``pipeline`` and ``context``, either of which may be None. The context must be current.

    ``before``: what is to be called first, to end what was left half done in the pipeline. ``legacy`` takes over what
    it has made, without anything on the GPU.
    """
    if context is None:
        return
    with context.guard():
        if before is not None:
            before()
        if legacy is not None and pipeline is not None and legacy.take_over(context, pipeline):
            return
        if pipeline is not None:
            pipeline.release()
        context.release()


def _on_draw() -> None:
    free_abandoned()
    if not _waiting:
        bpy.app.timers.register(_remove_handler, first_interval=0.0)  # not while Blender goes through its handlers


def _remove_handler() -> None:
    global _handler
    if _handler is not None and not _waiting:
        bpy.types.SpaceView3D.draw_handler_remove(_handler, "WINDOW")
        _handler = None
