# SPDX-License-Identifier: GPL-3.0-or-later
"""GL objects in a context of Blender's whose owner is gone: they can only be freed while that context is current.

Blender lets go of a viewport's engine at any time. It is freed in the next drawing of a 3D view.
"""

from __future__ import annotations

import contextlib
from typing import Any

import bpy

_waiting: list[tuple[Any, Any]] = []  # pipeline, and the context it lives in
_handler: Any = None  # of Blender, while there is something to free


def abandon(pipeline: Any, context: Any) -> None:
    """Frees ``pipeline`` and ``context`` when the context is current again. To be called anywhere."""
    global _handler
    _waiting.append((pipeline, context))
    if _handler is None and not bpy.app.background:
        with contextlib.suppress(Exception):  # Blender is ending
            _handler = bpy.types.SpaceView3D.draw_handler_add(_on_draw, (), "WINDOW", "POST_PIXEL")


def free_abandoned() -> None:
    """Frees what lives in the context that is current."""
    for entry in list(_waiting):
        pipeline, context = entry
        if context.is_current:
            _waiting.remove(entry)
            free(pipeline, context)


def free(pipeline: Any, context: Any) -> None:
    """Frees both, either of which may be None, in the context that is current."""
    if context is None:
        return
    with context.guard():
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
