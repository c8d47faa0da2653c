# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender that can open a window, on a machine that has none and no display: a small Debian with Blender in a folder.

It is set up once, from the mirror that this system's own packages come from, and entered by chroot: that takes a
Debian, debootstrap, and root. A window is a matter of the machine, not of what is tested: where there is none, the
reason is one line, and tests in a window are left out.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from typing import IO

import _bootstrap

#: Holds the system, what starts its Blender, and a log.
FOLDER = os.path.join(_bootstrap.ROOT, ".window")
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
def environment() -> Iterator[dict[str, str]]:
    """Variables with which tests in a window run, and a display for as long. Raises NoWindow."""
    if os.environ.get("CONELIGHT_BLENDER_WINDOW"):
        yield {}
        return
    _set_up()
    blender = _write_script("blender", "blender")
    display = subprocess.Popen(
        [_write_script("display", "Xvfb"), "-displayfd", "1", "-screen", "0", "1280x800x24", "+extension", "GLX"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    try:
        assert display.stdout is not None
        number = display.stdout.readline().strip()
        if not number:
            raise NoWindow("no virtual display could be started")
        yield {"CONELIGHT_BLENDER_WINDOW": blender, "DISPLAY": f":{number}"}
    finally:
        display.terminate()
        display.wait()


def _set_up() -> None:
    """Once; raises NoWindow where that cannot be."""
    if _packages() == list(PACKAGES):
        return
    if not os.environ.get("CONELIGHT_WINDOW"):
        raise NoWindow("CONELIGHT_WINDOW=1 has a system with Blender set up (root, 1.5 GB, several minutes)")
    if not sys.platform.startswith("linux") or not hasattr(os, "geteuid") or os.geteuid() != 0:
        raise NoWindow("a system with Blender can be set up by root on Linux only")
    missing = [name for name in ("debootstrap", "apt-get", "unshare", "chroot", "mount") if not shutil.which(name)]
    if missing:
        raise NoWindow(f"there is no {missing[0]} to set up a system with Blender")
    if shutil.disk_usage(_bootstrap.ROOT).free < NEEDED_GIB << 30:
        raise NoWindow(f"there are not {NEEDED_GIB} GiB left on the disk for a system with Blender")
    with _bootstrap.only_one("window"):
        if _packages() != list(PACKAGES):
            _install()


def _packages() -> list[str]:
    """What the system that is there has of what is listed; empty: there is none."""
    with contextlib.suppress(OSError), open(READY, encoding="ascii") as file:
        return file.read().split()
    return []


def _install() -> None:
    """A new system, or what was listed since in the one that is there."""
    has_system = bool(_packages())
    print("Setting up a system with a Blender that opens windows, once: 1.5 GB on disk, several minutes.", flush=True)
    if not has_system:
        shutil.rmtree(SYSTEM, ignore_errors=True)
        os.makedirs(SYSTEM)
    with open(LOG, "w", encoding="utf-8") as log:
        try:
            if not has_system:
                _run([*PRIVATE_MOUNTS, "debootstrap", "--variant=minbase", SUITE, SYSTEM, _mirror()], log)
            for name in ("resolv.conf", "hosts"):
                with contextlib.suppress(OSError):
                    shutil.copy(os.path.join("/etc", name), os.path.join(SYSTEM, "etc", name))
            get = [_write_script("get", "apt-get"), "-q", "-o", "Acquire::Check-Valid-Until=false"]
            _run([*get, "update"], log)
            _run([*get, "install", "-y", "--no-install-recommends", *PACKAGES], log)
            started = [_write_script("blender", "blender"), "--background", "--factory-startup"]
            said = subprocess.run(started, capture_output=True, text=True, check=True, timeout=SET_UP_LIMIT)
            if "Traceback" in said.stdout + said.stderr:  # the distribution's own add-ons lack something
                log.write(said.stdout + said.stderr)
                raise NoWindow(f"its Blender does not start without errors: see {os.path.relpath(LOG)}")
            shutil.rmtree(os.path.join(SYSTEM, "var", "cache", "apt", "archives"), ignore_errors=True)
        except (OSError, subprocess.SubprocessError) as error:
            raise NoWindow(f"setting up a system with Blender failed ({error}): see {os.path.relpath(LOG)}") from None
    with open(READY, "w", encoding="ascii") as file:
        file.write("\n".join(PACKAGES))


def _run(command: Sequence[str], log: IO[str]) -> None:
    environ = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, env=environ, start_new_session=True
    )
    try:
        if process.wait(SET_UP_LIMIT) != 0:
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


def _write_script(name: str, command: str) -> str:
    """A script that runs a command in the system; its path."""
    path = os.path.join(FOLDER, name)
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
