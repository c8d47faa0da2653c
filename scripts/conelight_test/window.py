# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender that can open a window, on a machine that has none and no display: a small Debian with Blender in a folder.

It is set up once for all checkouts of a user, from the mirror that this system's own packages come from, and entered
by chroot: that takes a Debian, debootstrap, and root. A window is a matter of the machine, not of what is tested: where
there is none, the reason is one line, and tests in a window are left out.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import IO

import _bootstrap

#: Holds the system and a log.
FOLDER = os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "conelight-window")
SYSTEM = os.path.join(FOLDER, "system")
READY = os.path.join(FOLDER, "ready")
LOG = os.path.join(FOLDER, "set_up.log")

SUITE = "sid"  # the only one with a Blender that is as new as those that are tested in background
PACKAGES = (
    "blender", "xvfb", "libgl1-mesa-dri", "libegl1", "libegl-mesa0", "libgl1", "libglx-mesa0", "mesa-vulkan-drivers",
    "imagemagick", "x11-utils", "xdotool", "python3-numpy", "python3-moderngl", "python3-openimageio", "python3-cattr",
    "python3-requests", "python3-zstandard",
)  # fmt: skip
NEEDED_GIB = 3
SET_UP_LIMIT = 900.0  # seconds

#: Mounts of a command are seen by it alone, and end with it.
PRIVATE_MOUNTS = ("unshare", "--mount", "--propagation", "private")

#: Variables that tests hand on to Blender.
HANDED_ON = (
    "DISPLAY", "BLENDER_USER_RESOURCES", "CONELIGHT_RANDOM_SECONDS", "CONELIGHT_TRACEBACK", "MESA_GL_VERSION_OVERRIDE",
)  # fmt: skip

#: Runs a command of the system. Mounts are seen by this process alone and end with it. The checkout and the folder for
#: temporary files lie under the same paths as outside.
_ENTER = """#!/bin/sh
# Written by scripts/test.
exec unshare --mount --propagation private sh -c '
    system=$1; shift
    for folder in /proc /dev /sys "$1" "$2"; do
        mkdir -p "$system$folder" && mount --rbind "$folder" "$system$folder" || exit 125
    done
    shift 2
    exec chroot "$system" env -i PATH=/usr/bin:/bin HOME=/root LANG=C.UTF-8 LIBGL_ALWAYS_SOFTWARE=1 {handed_on} "$@"
' sh {system} {checkout} {temporary} {command} "$@"
"""


class NoWindow(Exception):
    """Why there can be no window, in a few words."""


@contextlib.contextmanager
def being_set_up() -> Iterator[Future[None]]:
    """The system is set up while the block runs, if need be; leaving the block ends that. Raises nothing: the future
    holds NoWindow."""
    stopped = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        try:
            yield pool.submit(_set_up, stopped)
        finally:
            stopped.set()


@contextlib.contextmanager
def environment(system: Future[None]) -> Iterator[dict[str, str]]:
    """Variables with which tests in a window run, and a display for as long. Raises NoWindow."""
    system.result()
    if os.environ.get("CONELIGHT_BLENDER_WINDOW"):
        yield {}
        return
    with tempfile.TemporaryDirectory(prefix="conelight-window-") as folder:
        display = subprocess.Popen(
            [_write_script(folder, "Xvfb"), "-displayfd", "1", "-screen", "0", "1280x800x24", "+extension", "GLX"],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        try:
            assert display.stdout is not None
            number = display.stdout.readline().strip()
            if not number:
                raise NoWindow("no virtual display could be started")
            yield {"CONELIGHT_BLENDER_WINDOW": _write_script(folder, "blender"), "DISPLAY": f":{number}"}
        finally:
            display.terminate()
            display.wait()


def _set_up(stopped: threading.Event) -> None:
    """Once; raises NoWindow where that cannot be."""
    if os.environ.get("CONELIGHT_BLENDER_WINDOW") or _packages() == list(PACKAGES):
        return
    if not os.environ.get("CONELIGHT_WINDOW"):
        raise NoWindow("CONELIGHT_WINDOW=1 has a system with Blender set up (root, 1.5 GB, several minutes)")
    if not sys.platform.startswith("linux") or not hasattr(os, "geteuid") or os.geteuid() != 0:
        raise NoWindow("a system with Blender can be set up by root on Linux only")
    missing = [name for name in ("debootstrap", "apt-get", "unshare", "chroot", "mount") if not shutil.which(name)]
    if missing:
        raise NoWindow(f"there is no {missing[0]} to set up a system with Blender")
    try:
        os.makedirs(FOLDER, exist_ok=True)
        if shutil.disk_usage(FOLDER).free < NEEDED_GIB << 30:
            raise NoWindow(f"there are not {NEEDED_GIB} GiB left on the disk for a system with Blender")
        with _bootstrap.only_one(FOLDER):
            if _packages() != list(PACKAGES):
                _install(stopped)
    except OSError as error:
        raise NoWindow(f"a system with Blender could not be set up ({error})") from None


def _packages() -> list[str]:
    """What the system that is there has of what is listed; empty: there is none."""
    with contextlib.suppress(OSError), open(READY, encoding="ascii") as file:
        return file.read().split()
    return []


def _install(stopped: threading.Event) -> None:
    """A new system, or what was listed since in the one that is there."""
    has_system = bool(_packages())
    print(f"Setting up a Blender that opens windows in {FOLDER}, once: 1.5 GB, several minutes.", flush=True)
    if not has_system:
        shutil.rmtree(SYSTEM, ignore_errors=True)
        os.makedirs(SYSTEM)
    with open(LOG, "w", encoding="utf-8") as log, tempfile.TemporaryDirectory(prefix="conelight-window-") as folder:
        try:
            if not has_system:
                _run([*PRIVATE_MOUNTS, "debootstrap", "--variant=minbase", SUITE, SYSTEM, _mirror()], log, stopped)
            for name in ("resolv.conf", "hosts"):
                with contextlib.suppress(OSError):
                    shutil.copy(os.path.join("/etc", name), os.path.join(SYSTEM, "etc", name))
            get = [_write_script(folder, "apt-get"), "-q", "-o", "Acquire::Check-Valid-Until=false"]
            _run([*get, "update"], log, stopped)
            _run([*get, "install", "-y", "--no-install-recommends", *PACKAGES], log, stopped)
            started = [_write_script(folder, "blender"), "--background", "--factory-startup"]
            said = subprocess.run(started, capture_output=True, text=True, check=True, timeout=SET_UP_LIMIT)
            if "Traceback" in said.stdout + said.stderr:  # the distribution's own add-ons lack something
                log.write(said.stdout + said.stderr)
                raise NoWindow(f"its Blender does not start without errors: see {LOG}")
            shutil.rmtree(os.path.join(SYSTEM, "var", "cache", "apt", "archives"), ignore_errors=True)
        except (OSError, subprocess.SubprocessError) as error:
            raise NoWindow(f"setting up a system with Blender failed ({error}): see {LOG}") from None
    with open(READY, "w", encoding="ascii") as file:
        file.write("\n".join(PACKAGES))


def _run(command: Sequence[str], log: IO[str], stopped: threading.Event) -> None:
    """Raises SubprocessError when it fails, takes too long, or is ``stopped``."""
    environ = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, env=environ, start_new_session=True,
        pass_fds=_bootstrap.held_locks,
    )  # fmt: skip
    try:
        end = time.monotonic() + SET_UP_LIMIT
        while process.poll() is None:
            if time.monotonic() > end or stopped.wait(0.2):
                raise subprocess.TimeoutExpired(command[0], SET_UP_LIMIT)
        if process.returncode != 0:
            raise subprocess.CalledProcessError(process.returncode, command[0])
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # what it started, too: else folders it has mounted stay in use
        process.wait()


def _mirror() -> str:
    """Where this system's own packages come from. Raises NoWindow."""
    command = ["apt-get", "indextargets", "--format", "$(COMPONENT) $(CODENAME) $(REPO_URI)", "Created-By: Packages"]
    found = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    for line in found.splitlines():
        component, codename, address = [*line.split(" ", 2), "", ""][:3]
        if component == "main" and address and "-" not in codename:  # not of updates
            return address.strip()
    raise NoWindow("this system does not say where its packages come from")


def _write_script(folder: str, command: str) -> str:
    """A script in ``folder`` that runs a command in the system; its path."""
    path = os.path.join(folder, command)
    text = _ENTER.format(
        system=_quoted(SYSTEM), checkout=_quoted(_bootstrap.ROOT), temporary=_quoted(tempfile.gettempdir()),
        command=command, handed_on=" ".join(f'${{{name}:+{name}="${name}"}}' for name in HANDED_ON),
    )  # fmt: skip
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    os.chmod(path, 0o755)
    return path


def _quoted(path: str) -> str:
    return "'" + path.replace("'", "'\\''") + "'"
