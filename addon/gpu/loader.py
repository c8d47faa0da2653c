# SPDX-License-Identifier: GPL-3.0-or-later
"""GL functions of the current context, and what its driver has to say.

Users have ``libGL.so.1`` and ``libEGL.so.1``, not the development names that moderngl looks for.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import re
import sys
from collections.abc import Callable

#: Names of OpenGL drivers that draw on the CPU.
_SOFTWARE = re.compile("llvmpipe|softpipe|lavapipe|swrast|swiftshader|software", re.IGNORECASE)


def is_software(renderer: str) -> bool:
    """Whether a driver of this name draws on the CPU."""
    return bool(_SOFTWARE.search(renderer))


class Loader:
    """What moderngl asks of a loader: an address for each function name."""

    def __init__(self, lookup: Callable[[str], int]) -> None:
        self._lookup = lookup

    def load_opengl_function(self, name: str) -> int:
        return self._lookup(name)

    load = load_opengl_function

    def function(self, name: str, result: type | None, *arguments: type) -> Callable:
        """GL function ``name`` as a Python callable. Raises RuntimeError when the context lacks it."""
        address = self._lookup(name)
        if not address:
            raise RuntimeError(f"the graphics driver has no {name}")
        prototype = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)  # WINFUNCTYPE exists on Windows alone
        return prototype(result, *arguments)(address)

    def release(self) -> None:
        """Nothing is held."""


def _library(*names: str) -> ctypes.CDLL | None:
    for name in names:
        with contextlib.suppress(OSError):
            return ctypes.CDLL(name)
    return None


def _address(library: ctypes.CDLL, name: str) -> int:
    function = getattr(library, name, None)
    return ctypes.cast(function, ctypes.c_void_p).value or 0 if function is not None else 0


@functools.cache
def _linux_loaders() -> list[tuple[Callable[[], int | None], Loader]]:
    """For EGL and GLX: how to ask whether a context is current, and the loader to use when it is."""
    found: list[tuple[Callable[[], int | None], Loader]] = []
    for names, current, procedure in (
        (("libEGL.so.1", "libEGL.so"), "eglGetCurrentContext", "eglGetProcAddress"),
        (("libGL.so.1", "libGL.so"), "glXGetCurrentContext", "glXGetProcAddressARB"),
    ):
        library = _library(*names)
        if library is None:
            continue
        get_current = getattr(library, current, None)
        get_address = getattr(library, procedure, None)
        if get_current is None or get_address is None:
            continue
        get_current.restype = ctypes.c_void_p
        get_address.restype = ctypes.c_void_p
        get_address.argtypes = [ctypes.c_char_p]
        core = _library("libOpenGL.so.0", "libGL.so.1", "libGL.so")

        def lookup(name: str, get_address: Callable = get_address, core: ctypes.CDLL | None = core) -> int:
            return get_address(name.encode()) or (_address(core, name) if core else 0)

        found.append((get_current, Loader(lookup)))
    return found


def _current() -> tuple[int, Loader] | None:
    """The native handle of the GL context that is current on this thread, and the loader for it."""
    if sys.platform.startswith("linux"):
        for get_current, loader in _linux_loaders():
            handle = get_current()
            if handle:
                return handle, loader
        return None
    if sys.platform.startswith("win"):
        library = ctypes.WinDLL("opengl32.dll")  # type: ignore[attr-defined]
        library.wglGetCurrentContext.restype = ctypes.c_void_p
        library.wglGetProcAddress.restype = ctypes.c_void_p
        library.wglGetProcAddress.argtypes = [ctypes.c_char_p]
        handle = library.wglGetCurrentContext()
        if not handle:
            return None
        return handle, Loader(lambda name: library.wglGetProcAddress(name.encode()) or _address(library, name))
    raise RuntimeError("this system has no OpenGL 4.3")


def current_context() -> int:
    """The native handle of the GL context that is current on this thread; 0: there is none."""
    current = _current()
    return current[0] if current is not None else 0


def leave_thread() -> None:
    """To be called at the end of a thread that had a context of its own: what EGL keeps for a thread outlives it."""
    library = _library("libEGL.so.1", "libEGL.so") if sys.platform.startswith("linux") else None
    if library is not None:
        library.eglReleaseThread()


def current_context_loader() -> Loader:
    """The loader for the GL context that is current on this thread. Raises RuntimeError when there is none."""
    current = _current()
    if current is None:
        raise RuntimeError("no OpenGL context is current")
    return current[1]


def debug_messages(loader: Loader) -> list[str]:
    """Messages of type error or undefined behaviour that the driver has logged since the last call.

    ``enable_debug_messages`` must have been called. GL_KHR_debug keeps a log, so no callback is needed.
    """
    u = ctypes.c_uint
    get_integer = loader.function("glGetIntegerv", None, u, ctypes.c_void_p)
    get_log = loader.function(
        "glGetDebugMessageLog", u, u, ctypes.c_int, *([ctypes.c_void_p] * 5), ctypes.c_char_p
    )
    found: list[str] = []
    while True:
        waiting = (ctypes.c_int * 4)()
        get_integer(0x9145, waiting)  # GL_DEBUG_LOGGED_MESSAGES
        if waiting[0] == 0:
            return found
        source, kind, number, severity, length = u(), u(), u(), u(), ctypes.c_int()
        text = ctypes.create_string_buffer(4096)
        get_log(1, 4096, *(ctypes.addressof(x) for x in (source, kind, number, severity, length)), text)
        if kind.value in (0x824C, 0x824E):  # GL_DEBUG_TYPE_ERROR, GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR
            found.append(text.value.decode(errors="replace"))


def enable_debug_messages(loader: Loader) -> None:
    """Let the driver log its messages (GL_DEBUG_OUTPUT, synchronous), and only errors and undefined behaviour.

    The log is short (Mesa: 10 messages) and drops what comes when it is full: nothing else may fill it.
    """
    u = ctypes.c_uint
    control = loader.function("glDebugMessageControl", None, u, u, u, ctypes.c_int, ctypes.c_void_p, ctypes.c_ubyte)
    any_source = any_severity = 0x1100  # GL_DONT_CARE
    control(any_source, 0x1100, any_severity, 0, None, 0)
    for kind in (0x824C, 0x824E):  # GL_DEBUG_TYPE_ERROR, GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR
        control(any_source, kind, any_severity, 0, None, 1)
    enable = loader.function("glEnable", None, ctypes.c_uint)
    enable(0x92E0)
    enable(0x8242)
