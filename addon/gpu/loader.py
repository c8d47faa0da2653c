# SPDX-License-Identifier: GPL-3.0-or-later
"""GL functions of the current context, and the state that Blender expects to find again.

Users have ``libGL.so.1`` and ``libEGL.so.1``, not the development names that moderngl looks for.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import sys
from collections.abc import Callable, Iterator


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


def current_context_loader() -> Loader:
    """The loader for the GL context that is current on this thread. Raises RuntimeError when there is none."""
    if sys.platform.startswith("linux"):
        for current, loader in _linux_loaders():
            if current():
                return loader
        raise RuntimeError("no OpenGL context is current")
    if sys.platform.startswith("win"):
        library = ctypes.WinDLL("opengl32.dll")  # type: ignore[attr-defined]
        library.wglGetCurrentContext.restype = ctypes.c_void_p
        library.wglGetProcAddress.restype = ctypes.c_void_p
        library.wglGetProcAddress.argtypes = [ctypes.c_char_p]
        if not library.wglGetCurrentContext():
            raise RuntimeError("no OpenGL context is current")
        return Loader(lambda name: library.wglGetProcAddress(name.encode()) or _address(library, name))
    raise RuntimeError("this system has no OpenGL 4.3")


# Names of GL that the guard needs.
_DRAW_FRAMEBUFFER, _READ_FRAMEBUFFER = 0x8CA9, 0x8CA8
_INTEGERS = {
    "draw_framebuffer": 0x8CA6,
    "read_framebuffer": 0x8CAA,
    "program": 0x8B8D,
    "vertex_array": 0x85B5,
    "active_texture": 0x84E0,
    "array_buffer": 0x8894,
    "uniform_buffer": 0x8A28,
    "storage_buffer": 0x90D3,
    "pack_buffer": 0x88ED,
    "unpack_buffer": 0x88EF,
    "pack_alignment": 0x0D05,
    "unpack_alignment": 0x0CF5,
    "pack_row_length": 0x0D02,
    "unpack_row_length": 0x0CF2,
    "blend_source_rgb": 0x80C9,
    "blend_target_rgb": 0x80C8,
    "blend_source_alpha": 0x80CB,
    "blend_target_alpha": 0x80CA,
    "depth_function": 0x0B74,
    "cull_face": 0x0B45,
    "front_face": 0x0B46,
}
_ENABLES = {
    "blend": 0x0BE2,
    "depth_test": 0x0B71,
    "cull": 0x0B44,
    "scissor": 0x0C11,
    "stencil": 0x0B90,
    "primitive_restart": 0x8F9D,
    "primitive_restart_fixed": 0x8D69,
    "program_point_size": 0x8642,
    "rasterizer_discard": 0x8C89,
    "framebuffer_srgb": 0x8DB9,
}
_TEXTURE_TARGETS = {0x0DE1: 0x8069, 0x806F: 0x806A}  # 2D and 3D: target and the name of its binding
_SAVED_UNITS = 16


@contextlib.contextmanager
def saved_state(loader: Loader) -> Iterator[None]:
    """Save the state of the current context that our work touches, and put it back at the end, error or not.

    Blender keeps its own record of GL state and does not look again: what we leave behind it would draw with.
    """
    u = ctypes.c_uint
    get_integer = loader.function("glGetIntegerv", None, u, ctypes.c_void_p)
    get_boolean = loader.function("glGetBooleanv", None, u, ctypes.c_void_p)
    is_enabled = loader.function("glIsEnabled", ctypes.c_ubyte, u)
    enable = loader.function("glEnable", None, u)
    disable = loader.function("glDisable", None, u)
    active_texture = loader.function("glActiveTexture", None, u)
    bind_texture = loader.function("glBindTexture", None, u, u)
    bind_sampler = loader.function("glBindSampler", None, u, u)

    def integer(name: int, count: int = 1) -> list[int]:
        values = (ctypes.c_int * max(count, 4))()
        get_integer(name, values)
        return list(values[:count])

    integers = {key: integer(name)[0] for key, name in _INTEGERS.items()}
    enables = {name: bool(is_enabled(name)) for name in _ENABLES.values()}
    viewport, scissor = integer(0x0BA2, 4), integer(0x0C10, 4)
    masks = (ctypes.c_ubyte * 4)()
    get_boolean(0x0C23, masks)
    depth_mask = (ctypes.c_ubyte * 4)()
    get_boolean(0x0B72, depth_mask)
    units = []
    for unit in range(_SAVED_UNITS):
        active_texture(0x84C0 + unit)
        units.append(({target: integer(name)[0] for target, name in _TEXTURE_TARGETS.items()}, integer(0x8919)[0]))
    try:
        yield
    finally:
        for unit, (bindings, sampler) in enumerate(units):
            active_texture(0x84C0 + unit)
            for target, texture in bindings.items():
                bind_texture(target, texture)
            bind_sampler(unit, sampler)
        active_texture(integers["active_texture"])
        bind_framebuffer = loader.function("glBindFramebuffer", None, u, u)
        bind_framebuffer(_DRAW_FRAMEBUFFER, integers["draw_framebuffer"])
        bind_framebuffer(_READ_FRAMEBUFFER, integers["read_framebuffer"])
        loader.function("glUseProgram", None, u)(integers["program"])
        loader.function("glBindVertexArray", None, u)(integers["vertex_array"])
        bind_buffer = loader.function("glBindBuffer", None, u, u)
        for target, key in (
            (0x8892, "array_buffer"),
            (0x8A11, "uniform_buffer"),
            (0x90D2, "storage_buffer"),
            (0x88EB, "pack_buffer"),
            (0x88EC, "unpack_buffer"),
        ):
            bind_buffer(target, integers[key])
        pixel_store = loader.function("glPixelStorei", None, u, ctypes.c_int)
        for name, key in (
            (0x0D05, "pack_alignment"),
            (0x0CF5, "unpack_alignment"),
            (0x0D02, "pack_row_length"),
            (0x0CF2, "unpack_row_length"),
        ):
            pixel_store(name, integers[key])
        loader.function("glBlendFuncSeparate", None, u, u, u, u)(
            integers["blend_source_rgb"],
            integers["blend_target_rgb"],
            integers["blend_source_alpha"],
            integers["blend_target_alpha"],
        )
        loader.function("glDepthFunc", None, u)(integers["depth_function"])
        loader.function("glCullFace", None, u)(integers["cull_face"])
        loader.function("glFrontFace", None, u)(integers["front_face"])
        i = ctypes.c_int
        loader.function("glViewport", None, i, i, i, i)(*viewport)
        loader.function("glScissor", None, i, i, i, i)(*scissor)
        loader.function("glColorMask", None, *([ctypes.c_ubyte] * 4))(*masks)
        loader.function("glDepthMask", None, ctypes.c_ubyte)(depth_mask[0])
        for name, value in enables.items():
            (enable if value else disable)(name)


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
