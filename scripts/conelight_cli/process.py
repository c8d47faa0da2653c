# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that Blender runs in: a child of its own, apart from the user's own Blender, and left cleanly."""

from __future__ import annotations

import contextlib
import ctypes
import mmap
import os
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Callable
from typing import NoReturn

_at_end: list[Callable[[], None]] = []

_ENDING = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
_PR_SET_PDEATHSIG = 1  # of linux/prctl.h

#: What the child does, and "" once it has said all there is to say: written by the child and read by its parent.
_shared: mmap.mmap | None = None


def at_end(action: Callable[[], None]) -> None:
    """Calls ``action`` when the process is left by :func:`leave`; Python's own exit handlers do not run then."""
    _at_end.append(action)


def leave(status: int) -> NoReturn:
    """Ends the process at once: Blender 4.5 hangs in the ordinary way out after it used the GPU."""
    now_does("")
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
    tempfile.tempdir = folder
    at_end(lambda: shutil.rmtree(folder, ignore_errors=True))


def end_on_signals() -> None:
    """Ctrl-C and a request to stop end the process within a moment, also inside Blender's own code.

    Python would run a signal handler only after the operator returns. A thread waits for the signals instead: Blender
    lets other Python threads run during operators. Call it before other threads start, as they inherit the mask.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)

    def wait() -> None:
        number = signal.sigwait(_ENDING)
        leave(128 + number)

    threading.Thread(target=wait, daemon=True, name="signals").start()


def go_on_in_child(died: Callable[[int, int, str], None]) -> None:
    """Returns in a child process. This process waits for it, and ends as it does; what kills the child spares this one.

    ``died(child, signal, doing)`` is called here when the child ended without :func:`leave`: with 0 for the signal
    where it ended by itself, and with what it said last by :func:`now_does`. The exit status is 1 then. The child ends
    when this process is killed. To be called before there are threads, and before ``import bpy``.
    """
    global _shared
    _shared = mmap.mmap(-1, 256)
    parent = os.getpid()
    now_does("starting Blender")
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        with contextlib.suppress(OSError, AttributeError):  # there is no prctl beside Linux
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:
            leave(128 + signal.SIGTERM)
        return
    for number in _ENDING:
        signal.signal(number, lambda number, _: _send(child, number))
    _, status = os.waitpid(child, 0)
    doing = _shared[:].rstrip(b"\0").decode("utf-8", "replace")
    code = os.waitstatus_to_exitcode(status)
    if doing and -code not in _ENDING:
        died(child, max(-code, 0), doing)
        leave(1)
    leave(code if code >= 0 else 128 - code)


def _send(child: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, number)


def now_does(what: str) -> None:
    """Says to the parent, if there is one, what this process does from now on, such as "reading the file"."""
    if _shared is not None:
        _shared[:] = what.encode()[: len(_shared)].ljust(len(_shared), b"\0")
