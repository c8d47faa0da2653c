# SPDX-License-Identifier: GPL-3.0-or-later
"""What a viewport that is left leaves to the next one: the scene as it was read, voxels and their light.

On the GPU nothing stays. Only the last of all viewports is remembered. What the next one takes from it is what a scene
that is read from scratch turns out to say, too: whatever was changed meanwhile, in whatever way, is made again.
"""

from __future__ import annotations

import dataclasses
import logging
import threading
from typing import Any

import numpy as np

from ..scene import SceneData

#: Bytes of voxels and light that are kept in memory, and of the scene. Where there are more all is made again.
MOST_BYTES = 1 << 28
#: Seconds to wait for a thread that is about to put something away.
_PATIENCE = 10.0

_log = logging.getLogger(__name__)


class Legacy:
    """Of one viewport."""

    def __init__(self, reader: Any) -> None:
        """``reader``: the ``SceneReader`` of the scene that the pipeline was prepared for. It reads all again."""
        reader.read_all_again()
        self.reader = reader
        self._made: tuple[Any, Any] | None = None  # context and pipeline
        self._is_wanted = True
        self._lock = threading.Lock()

    def take_over(self, context: Any, pipeline: Any) -> bool:
        """Keeps what the pipeline has made; returns whether everything on the GPU was freed then.

        Called where the context is current, under its guard.
        """
        with self._lock:
            if not self._is_wanted:
                return False
            try:
                if not pipeline.put_away(MOST_BYTES):
                    return False
            except Exception:  # such as of a device that was reset
                _log.exception("Conelight: voxels are not kept")
                return False
            self._made = context, pipeline
            return True

    def claim(self) -> tuple[Any, Any] | None:
        """The context and the pipeline, to be put back; None: there are none, and none will come."""
        is_ours = self._lock.acquire(timeout=_PATIENCE)
        self._is_wanted = False
        made, self._made = self._made, None
        if is_ours:
            self._lock.release()
        return made


_last: Legacy | None = None


def leave(reader: Any, scene: SceneData) -> Legacy | None:
    """A viewport goes: what it leaves takes the place of what others left. None: the ``scene`` is too large."""
    global _last
    forget()
    if held_bytes(scene) > MOST_BYTES:
        return None
    _last = Legacy(reader)
    return _last


def held_bytes(data: Any) -> int:
    """Of all arrays in a piece of scene data, each counted once."""
    sizes: dict[int, int] = {}

    def visit(part: Any) -> None:
        if id(part) in sizes:
            return
        if isinstance(part, np.ndarray):
            sizes[id(part)] = part.nbytes
        elif dataclasses.is_dataclass(part):
            for name in part.__dataclass_fields__:
                visit(getattr(part, name))
        elif isinstance(part, dict):
            for value in part.values():
                visit(value)
        elif isinstance(part, list | tuple):
            for value in part:
                visit(value)

    visit(data)
    return sum(sizes.values())


def inherit() -> Legacy | None:
    """What the last viewport left; to be had once."""
    global _last
    found, _last = _last, None
    return found


def forget() -> None:
    """Lets go of what was left."""
    found = inherit()
    if found is not None:
        found.claim()
