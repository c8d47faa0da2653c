# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user sees: messages and a progress bar on stderr, without the lines that Blender and importers print."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Iterator
from typing import Any, TextIO

from tqdm import tqdm

#: Set in the environment, it shows tracebacks and everything that Blender prints.
VERBOSE_VARIABLE = "CONELIGHT_TRACEBACK"

_stderr: TextIO = sys.stderr


def is_verbose() -> bool:
    return os.environ.get(VERBOSE_VARIABLE, "") not in ("", "0")


def say(text: str) -> None:
    """A message for the user; a progress bar moves aside for it."""
    tqdm.write(text, file=_stderr)
    _stderr.flush()


@contextlib.contextmanager
def only_our_messages() -> Iterator[None]:
    """Sends stdout and stderr of this process, C libraries included, to a file that is dropped; :func:`say` remains."""
    global _stderr
    if is_verbose():
        yield
        return
    sys.stdout.flush()
    sys.stderr.flush()
    kept = (os.dup(1), os.dup(2))
    before = _stderr
    _stderr = os.fdopen(os.dup(kept[1]), "w", encoding=sys.stderr.encoding, errors="replace")
    with tempfile.TemporaryFile() as dropped:
        os.dup2(dropped.fileno(), 1)
        os.dup2(dropped.fileno(), 2)
        try:
            yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os.dup2(kept[0], 1)
            os.dup2(kept[1], 2)
            _stderr.close()
            _stderr = before
            for descriptor in kept:
                os.close(descriptor)


class Progress:
    """A bar over all frames; it shows nothing where stderr is not a terminal."""

    def __init__(self, frames: int) -> None:
        self._done_frames = 0
        self._bar: Any = tqdm(
            total=float(frames), file=_stderr, disable=not _stderr.isatty(), leave=False,
            bar_format="{percentage:3.0f}% |{bar}| {elapsed}<{remaining} {postfix}",
        )

    def update(self, fraction: float, text: str) -> None:
        """Progress within a frame: ``fraction`` from 0 to 1, and what is being done."""
        self._bar.set_postfix_str(text, refresh=False)
        self._bar.n = self._done_frames + min(max(fraction, 0.0), 1.0)
        self._bar.refresh()

    def end_frame(self) -> None:
        self._done_frames += 1
        self.update(0.0, "")

    def close(self) -> None:
        self._bar.close()
