# SPDX-License-Identifier: GPL-3.0-or-later
"""Which graphics Blender has, and why it will not do: asked without drawing anything."""

from __future__ import annotations

import contextlib
import ctypes
import re
import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

import bpy
import gpu

from ..gpu.loader import leave_thread

Result = TypeVar("Result")

#: From the EGL 1.5 specification and EGL_MESA_platform_surfaceless.
_EGL_OPENGL_API = 0x30A2
_EGL_RENDERABLE_TYPE, _EGL_OPENGL_BIT, _EGL_SURFACE_TYPE, _EGL_NONE = 0x3040, 0x0008, 0x3033, 0x3038
_EGL_MAJOR_VERSION, _EGL_MINOR_VERSION = 0x3098, 0x30FB
_EGL_PROFILE_MASK, _EGL_CORE_PROFILE_BIT = 0x30FD, 0x0001
_EGL_PLATFORM_SURFACELESS_MESA = 0x31DD

NEEDED_VERSION = (4, 3)  # of OpenGL
OLDER_VERSION = (3, 2)  # the first with core contexts


def backend_problem(backend: str, version: str) -> str | None:
    """Why Conelight cannot render on Blender's graphics ``backend`` (OPENGL, VULKAN, METAL, ...); None: it can.

    ``version``: as OpenGL states it, such as "4.5 (Core Profile) Mesa 22.3".
    """
    if backend == "METAL":
        return "Conelight needs OpenGL 4.3, and Blender has only Metal on this system: macOS is not supported."
    if backend == "VULKAN":
        return None  # we make an OpenGL context of our own
    if backend not in ("OPENGL", "UNKNOWN"):
        return f"Conelight needs OpenGL 4.3, and Blender runs without it (graphics backend: {backend})."
    number = re.match(r"\s*(\d+)\.(\d+)", version)
    if number and (int(number[1]), int(number[2])) < (4, 3):
        return (
            f"Conelight needs OpenGL 4.3, and this graphics driver has {number[0].strip()}: "
            "update the driver or use another graphics device."
        )
    return None


def backend_in_use() -> tuple[str, str | None]:
    """Blender's graphics backend, and why it cannot be used (None: it can, or there is no telling yet)."""
    if bpy.app.background and not background_has_gl():
        if _egl_makes_contexts(OLDER_VERSION):
            return "OPENGL", (
                "Conelight needs OpenGL 4.3, and this graphics driver has an older one: update the driver or use "
                "another graphics device."
            )
        return "NONE", (
            "Conelight needs OpenGL 4.3, and this system cannot draw without a window: install or update the graphics "
            "driver (for software rendering on Debian: libegl1 and libgl1-mesa-dri; on Fedora: mesa-libEGL and "
            "mesa-dri-drivers)."
        )
    try:
        backend = gpu.platform.backend_type_get()
        version = gpu.platform.version_get()
    except SystemError:  # in background Blender has no graphics until something renders
        return "UNKNOWN", None
    return backend, backend_problem(backend, version)


def has_own_context() -> bool:
    """Whether renders make a GL context of their own, because Blender has none or needs it itself."""
    return not bpy.app.background or backend_in_use()[0] == "VULKAN"


def viewport_has_own_context() -> bool:
    """Whether viewports make a GL context of their own, because Blender draws them with something else."""
    return backend_in_use()[0] != "OPENGL"


def way_of_drawing(backend: str) -> str:
    """For the user: with what Blender draws, and how pictures get there."""
    if backend == "OPENGL":
        return "OpenGL; viewports share Blender's context"
    return f"{backend.capitalize()}; pictures are made with OpenGL and copied"


class ContextThread:
    """Where a GL context can be made and used, again and again until :meth:`end`.

    A context of our own needs a thread of its own: made on one of Blender's it would take the place of Blender's.
    """

    def __init__(self, *, own: bool) -> None:
        """``own``: the context is ours, else Blender's, which is current where it is asked for."""
        self.own = own
        self._pool: ThreadPoolExecutor | None = None

    def run(self, work: Callable[[], bool]) -> bool:
        """Calls ``work`` there and waits for it; raises what it raises."""
        return self.start(work).result()

    def start(self, work: Callable[[], Result]) -> Future[Result]:
        """Calls ``work`` there; where that is this thread, it is done when this returns."""
        if not self.own:
            return _done(work)
        if self._pool is None:
            self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="conelight")
        return self._pool.submit(work)

    def end(self, work: Callable[[], None] | None = None) -> None:
        """Lets a thread of our own do some last ``work`` and end, without waiting for it."""
        pool, self._pool = self._pool, None
        if pool is None:
            return
        with contextlib.suppress(RuntimeError):  # Python itself is ending, and the context with it
            if work is not None:
                pool.submit(work)
            pool.submit(leave_thread)
        pool.shutdown(wait=False)


def _done(work: Callable[[], Result]) -> Future[Result]:
    """What ``work`` gave or raised."""
    future: Future[Result] = Future()
    try:
        future.set_result(work())
    except BaseException as error:
        future.set_exception(error)
    try:
        return future
    finally:
        del future, work  # the error's traceback has this frame, and would keep itself alive and all that was at work


_background_has_gl: bool | None = None


def background_has_gl() -> bool:
    """Whether Blender in background can make the GL context that an engine may ask for.

    Where it cannot and an engine asks, Blender 4.5 and 5.2 crash. That is known of Linux, where Blender uses EGL; the
    answer elsewhere is yes.
    """
    global _background_has_gl
    if _background_has_gl is None:
        _background_has_gl = not sys.platform.startswith("linux") or _egl_makes_contexts(NEEDED_VERSION)
    return _background_has_gl


def _egl_makes_contexts(version: tuple[int, int]) -> bool:
    """Makes an OpenGL core context of at least ``version`` and throws it away, without making it current.

    Tries the displays that Blender tries: the default one, then Mesa's without a surface. They stay initialized, as
    others may use them.
    """
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        egl.eglGetDisplay.restype = egl.eglGetPlatformDisplay.restype = egl.eglCreateContext.restype = ctypes.c_void_p
        egl.eglBindAPI(_EGL_OPENGL_API)
        displays = egl.eglGetDisplay(None), egl.eglGetPlatformDisplay(_EGL_PLATFORM_SURFACELESS_MESA, None, None)
    except (OSError, AttributeError):  # no EGL, or one before 1.5
        return False
    return any(display and _makes_context(egl, ctypes.c_void_p(display), version) for display in displays)


def _makes_context(egl: ctypes.CDLL, display: ctypes.c_void_p, version: tuple[int, int]) -> bool:
    if not egl.eglInitialize(display, None, None):
        return False
    wanted = _attributes(_EGL_RENDERABLE_TYPE, _EGL_OPENGL_BIT, _EGL_SURFACE_TYPE, 0)
    config, count = ctypes.c_void_p(), ctypes.c_int()
    if not egl.eglChooseConfig(display, wanted, ctypes.byref(config), 1, ctypes.byref(count)) or count.value < 1:
        return False
    major, minor = version
    asked = _attributes(_EGL_MAJOR_VERSION, major, _EGL_MINOR_VERSION, minor, _EGL_PROFILE_MASK, _EGL_CORE_PROFILE_BIT)
    context = egl.eglCreateContext(display, config, None, asked)
    if not context:
        return False
    egl.eglDestroyContext(display, ctypes.c_void_p(context))
    return True


def _attributes(*values: int) -> Any:
    return (ctypes.c_int * (len(values) + 1))(*values, _EGL_NONE)
