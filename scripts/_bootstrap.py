# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the Python environment of this checkout, once, and starts the calling script again inside it.

Standard library only, and written for old Pythons too (3.7), because whichever ``python3`` a machine has runs this
first, if only to say which Python is needed.

The environment is a folder ``.venv-3.11`` or ``.venv-3.13`` beside ``scripts/``: one for each Python that a Blender
module exists for. It counts as complete when its stamp file holds the hash of the lock file; the stamp is removed
first and written last, so an interrupted set-up starts over, from the installer's cache. A folder that is a link to
elsewhere is used when it is complete, but never written to.
"""

from __future__ import annotations

import contextlib
import ctypes
import glob
import hashlib
import json
import os
import shutil
import subprocess
import sys
from typing import Any, Callable, Iterator, NamedTuple, NoReturn, Sequence

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

#: Blender release of each Python that its module is built for; the one to prefer comes first.
BLENDER_OF_PYTHON = {"3.13": "Blender 5.2 LTS", "3.11": "Blender 4.5 LTS"}
NEEDED_PYTHON = "Python 3.11 (Blender 4.5 LTS) or Python 3.13 (Blender 5.2 LTS)"

STDERR = 2  # file descriptor
STAMP_NAME = "conelight-lock.sha256"


class Library(NamedTuple):
    """A system library, and the packages that bring it."""

    name: str
    debian: str
    fedora: str


SYSTEM_LIBRARIES = (
    Library("libEGL.so.1", "libegl1", "libglvnd-egl"),
    Library("libGL.so.1", "libgl1", "libglvnd-glx"),
    Library("libX11.so.6", "libx11-6", "libX11"),
    Library("libXext.so.6", "libxext6", "libXext"),
    Library("libXrender.so.1", "libxrender1", "libXrender"),
    Library("libXfixes.so.3", "libxfixes3", "libXfixes"),
    Library("libXi.so.6", "libxi6", "libXi"),
    Library("libXt.so.6", "libxt6", "libXt"),
    Library("libSM.so.6", "libsm6", "libSM"),
    Library("libICE.so.6", "libice6", "libICE"),
    Library("libxkbcommon.so.0", "libxkbcommon0", "libxkbcommon"),
    Library("libstdc++.so.6", "libstdc++6", "libstdc++"),
    Library("libz.so.1", "zlib1g", "zlib"),
)
EGL_DRIVER = Library("an EGL driver", "libegl-mesa0 libgl1-mesa-dri", "mesa-libEGL mesa-dri-drivers")


def say(text: str) -> None:
    """A message for the user."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


def fail(text: str) -> NoReturn:
    """Ends the script with a sentence and exit status 1."""
    say(os.path.basename(sys.argv[0] or "conelight") + ": " + text)
    sys.exit(1)


# System libraries


def can_load(name: str) -> bool:
    """Whether the dynamic linker finds a library."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def egl_driver_files() -> list[str] | None:
    """Files that describe the vendors' EGL drivers; None where libEGL does not choose among vendors (no libglvnd)."""
    listed = os.environ.get("__EGL_VENDOR_LIBRARY_FILENAMES")
    if listed:
        return [name for name in listed.split(":") if os.path.isfile(name)]
    usual = "/etc/glvnd/egl_vendor.d:/usr/share/glvnd/egl_vendor.d"
    folders = os.environ.get("__EGL_VENDOR_LIBRARY_DIRS", usual).split(":")
    if not any(os.path.isdir(folder) for folder in folders):
        return [] if can_load("libGLdispatch.so.0") else None
    return [name for folder in folders for name in sorted(glob.glob(os.path.join(folder, "*.json")))]


def has_egl_driver(load: Callable[[str], bool] = can_load) -> bool:
    """Whether libEGL finds at least one vendor's driver that loads."""
    files = egl_driver_files()
    if files is None:
        return True
    for name in files:
        try:
            with open(name, encoding="utf-8") as file:
                driver = json.load(file)["ICD"]["library_path"]
        except (OSError, ValueError, KeyError, TypeError):
            continue
        if load(driver):
            return True
    return False


def missing_libraries(load: Callable[[str], bool] = can_load) -> list[Library]:
    """System libraries that Blender and OpenGL need and this machine does not have."""
    missing = [library for library in SYSTEM_LIBRARIES if not load(library.name)]
    if not has_egl_driver(load):
        missing.append(EGL_DRIVER)
    return missing


def check_system_libraries(load: Callable[[str], bool] = can_load) -> None:
    """Ends the script when libraries are missing, naming each with its packages."""
    missing = missing_libraries(load)
    if not missing:
        return
    lines = ["these system libraries are missing:"]
    lines += [f"  {library.name}  (Debian: {library.debian}; Fedora: {library.fedora})" for library in missing]
    debian = " ".join(dict.fromkeys(library.debian for library in missing))
    fedora = " ".join(dict.fromkeys(library.fedora for library in missing))
    lines += [f"On Debian or Ubuntu: apt-get install {debian}", f"On Fedora: dnf install {fedora}"]
    fail("\n".join(lines))


# Python


def version_of(python: str) -> str | None:
    """``3.13`` for a Python that runs; None for a file that does not (such as a version manager's empty shim)."""
    try:
        result = subprocess.run(
            [python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, timeout=60, check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.decode("ascii", "replace").strip()


def interpreters(version: str) -> Iterator[str]:
    """Where a Python of a version may be: on the PATH, then in the folders of pyenv and uv."""
    found = shutil.which("python" + version)
    if found:
        yield found
    pyenv = os.environ.get("PYENV_ROOT") or os.path.expanduser("~/.pyenv")
    managed = os.environ.get("UV_PYTHON_INSTALL_DIR") or os.path.expanduser("~/.local/share/uv/python")
    for pattern in (
        os.path.join(pyenv, "versions", version + ".*", "bin", "python" + version),
        os.path.join(managed, "cpython-" + version + ".*", "bin", "python" + version),
    ):
        yield from sorted(glob.glob(pattern), reverse=True)


def running_version() -> str:
    return f"{sys.version_info[0]}.{sys.version_info[1]}"


def running_python() -> str:
    """The interpreter that runs this, or the one that its virtual environment was made from."""
    return getattr(sys, "_base_executable", None) or sys.executable


def find_python(version: str) -> str | None:
    """A Python of a version that runs, or None."""
    if running_version() == version:
        return running_python()
    return next((python for python in interpreters(version) if version_of(python) == version), None)


def choose_python() -> tuple[str, str]:
    """Path and version of the Python to use. Ends the script with a sentence when there is none."""
    forced = os.environ.get("CONELIGHT_PYTHON")
    if forced:
        version = version_of(forced)
        if version is None:
            fail(f"CONELIGHT_PYTHON is '{forced}', which does not run as a Python; set it to {NEEDED_PYTHON}.")
        if version not in BLENDER_OF_PYTHON:
            fail(f"CONELIGHT_PYTHON is Python {version}, which no Blender is built for; set it to {NEEDED_PYTHON}.")
        return shutil.which(forced) or forced, version
    running = running_version()
    if running in BLENDER_OF_PYTHON:
        return running_python(), running
    for version in BLENDER_OF_PYTHON:
        python = find_python(version)
        if python:
            return python, version
    fail(f"this is Python {running}; {NEEDED_PYTHON} is needed. Install one, or set CONELIGHT_PYTHON to its path.")


# The environment


def environment_folder(version: str) -> str:
    return os.path.join(ROOT, ".venv-" + version)


def environment_python(version: str) -> str:
    return os.path.join(environment_folder(version), "bin", "python")


def lock_file(version: str) -> str:
    return os.path.join(ROOT, "requirements", "py" + version.replace(".", "") + ".lock")


def lock_hash(version: str) -> str:
    with open(lock_file(version), "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def is_complete(version: str) -> bool:
    """Whether the environment holds what the lock file says."""
    try:
        with open(os.path.join(environment_folder(version), STAMP_NAME), encoding="ascii") as file:
            stamp = file.read().strip()
    except OSError:
        return False
    return stamp == lock_hash(version) and os.access(environment_python(version), os.X_OK)


@contextlib.contextmanager
def only_one(folder: str) -> Iterator[None]:
    """Holds the set-up of one folder against other processes; waits for one that is at it."""
    import fcntl

    with open(folder + ".lock", "w", encoding="ascii") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            say(f"Another process is setting up {os.path.basename(folder)}; waiting for it.")
            fcntl.flock(file, fcntl.LOCK_EX)
        held_locks.append(file.fileno())
        try:
            yield  # closing the file, or the end of the process and of its installer, gives the lock back
        finally:
            held_locks.remove(file.fileno())


#: Descriptors of locks that are held. Installers inherit them, as they go on where this process alone is killed.
held_locks: list[int] = []


def run(command: Sequence[str], **options: Any) -> int:
    """Exit status of a command whose messages go to stderr, so that a script's own stdout stays clean."""
    return subprocess.run(list(command), stdout=STDERR, check=False, pass_fds=held_locks, **options).returncode


def install_with_uv(uv: str, python: str, version: str) -> bool:
    """Makes and fills the environment with uv. False when that failed."""
    folder = environment_folder(version)
    environ = {**os.environ, "VIRTUAL_ENV": folder}
    made = run([uv, "venv", "--quiet", "--no-project", "--python", python, folder], env=environ) == 0
    return made and run(
        [uv, "pip", "install", "--compile-bytecode", "--python", environment_python(version), "--require-hashes", "-r",
         lock_file(version)],
        env=environ,
    ) == 0


def install_with_pip(python: str, version: str) -> None:
    """Makes and fills the environment with venv and pip. Ends the script when that fails."""
    if run([python, "-c", "import venv, ensurepip"], stderr=subprocess.DEVNULL) != 0:
        fail(
            f"Python {version} at {python} cannot make virtual environments: modules venv and ensurepip are missing. "
            f"On Debian or Ubuntu: apt-get install python{version}-venv"
        )
    if run([python, "-m", "venv", environment_folder(version)]) != 0:
        fail(f"the virtual environment {environment_folder(version)} could not be made; the lines above say why.")
    command = [environment_python(version), "-m", "pip", "--disable-pip-version-check", "install", "--require-hashes"]
    if run([*command, "-r", lock_file(version)]) != 0:
        fail("the packages could not be installed; the lines above say why. Run the same command again to go on.")


def check_is_own(folder: str) -> None:
    """Ends the script when what would be emptied and filled is not this checkout's own folder, but a link elsewhere."""
    if os.path.realpath(folder) != os.path.join(os.path.realpath(ROOT), os.path.basename(folder)):
        fail(
            f"{folder} leads to {os.path.realpath(folder)}, outside of this checkout, and is not set up for it; "
            "nothing was changed there. Remove the link and try again."
        )


def set_up(python: str, version: str) -> None:
    """Makes the environment, unless it is complete. Ends the script when that fails."""
    if is_complete(version):
        return
    folder = environment_folder(version)
    check_is_own(folder)
    with only_one(folder):
        if is_complete(version):  # by the process that was waited for
            return
        name = os.path.basename(folder)
        say(f"Setting up {name} once: {BLENDER_OF_PYTHON[version]} and more, about 400 MB to download, 1 GB on disk.")
        stamp = os.path.join(folder, STAMP_NAME)
        with contextlib.suppress(FileNotFoundError):
            os.remove(stamp)
        shutil.rmtree(folder, ignore_errors=True)  # what an interrupted set-up left, or an older lock file's packages
        uv = shutil.which("uv")
        if uv is None or not install_with_uv(uv, python, version):
            if uv is not None:
                say("uv could not do it; trying again with pip.")
                shutil.rmtree(folder, ignore_errors=True)
            install_with_pip(python, version)
        with open(stamp + ".new", "w", encoding="ascii") as file:
            file.write(lock_hash(version) + "\n")
        os.replace(stamp + ".new", stamp)
        say(f"{name} is ready.")


def clean_environ() -> dict[str, str]:
    """The environment variables for a process in the environment: nothing in them brings in others' packages."""
    unwanted = ("PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "__PYVENV_LAUNCHER__", "CONELIGHT_PYTHON")
    return {**{name: value for name, value in os.environ.items() if name not in unwanted}, "PYTHONNOUSERSITE": "1"}


def enter(script: str, arguments: Sequence[str]) -> None:
    """Returns at once inside a complete environment; otherwise sets one up and starts ``script`` again in it."""
    version = running_version()
    inside = os.path.realpath(sys.prefix) == os.path.realpath(environment_folder(version))
    if inside and version in BLENDER_OF_PYTHON and is_complete(version) and not os.environ.get("CONELIGHT_PYTHON"):
        return
    if os.environ.pop("CONELIGHT_ENTERED", None) == version:
        if inside:
            return
        fail(f"{environment_folder(version)} is not a working virtual environment; remove that folder and try again.")
    if os.name != "posix":
        fail("these scripts need Linux. On Windows, install the add-on in Blender (see README.md).")
    try:
        python, version = choose_python()
        check_system_libraries()
        set_up(python, version)
    except KeyboardInterrupt:
        say("\nSet-up was interrupted; the same command starts it again.")
        sys.exit(130)
    except OSError as error:
        fail(f"set-up failed: {error}")
    environ = {**clean_environ(), "CONELIGHT_ENTERED": version}
    command = [environment_python(version), os.path.abspath(script), *arguments]
    os.execve(command[0], command, environ)
