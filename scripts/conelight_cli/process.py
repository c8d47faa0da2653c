# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that Blender runs in: apart from the user's own Blender, and left cleanly."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Callable
from typing import NoReturn

_at_end: list[Callable[[], None]] = []


def at_end(action: Callable[[], None]) -> None:
    """Calls ``action`` when the process is left by :func:`leave`; Python's own exit handlers do not run then."""
    _at_end.append(action)


def leave(status: int) -> NoReturn:
    """Ends the process at once: Blender 4.5 hangs in the ordinary way out after it used the GPU."""
    for action in reversed(_at_end):
        with contextlib.suppress(Exception):
            action()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def isolate_blender() -> None:
    """Gives Blender an empty folder for everything of the user's, and for its temporary files.

    Must come before ``import bpy``. :func:`leave` removes the folder, as Blender does not get to tidy up then.
    """
    for name in [name for name in os.environ if name.startswith(("BLENDER_USER_", "BLENDER_SYSTEM_"))]:
        del os.environ[name]
    folder = tempfile.mkdtemp(prefix="conelight-")
    os.environ["BLENDER_USER_RESOURCES"] = folder
    for name in ("TMPDIR", "TEMP", "TMP"):  # the order in which Blender looks differs between releases
        os.environ[name] = folder
    at_end(lambda: shutil.rmtree(folder, ignore_errors=True))


def end_on_signals() -> None:
    """Ctrl-C and a request to stop end the process within a moment, also inside Blender's own code.

    Python would run a signal handler only after the operator returns. A thread waits for the signals instead: Blender
    lets other Python threads run during operators. Call it before other threads start, as they inherit the mask.
    """
    ending = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
    signal.pthread_sigmask(signal.SIG_BLOCK, ending)

    def wait() -> None:
        number = signal.sigwait(ending)
        leave(128 + number)

    threading.Thread(target=wait, daemon=True, name="signals").start()
