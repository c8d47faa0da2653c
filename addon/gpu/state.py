# SPDX-License-Identifier: GPL-3.0-or-later
"""The GL state that Blender expects to find again, and the state that our work expects.

Blender keeps its own record of GL state and does not look again: what we leave behind it would draw with. Nor may our
pictures depend on what it left.
"""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from . import interface
from .loader import Loader

_UINT, _INT, _ENUM = ctypes.c_uint, ctypes.c_int, ctypes.c_uint

#: Switches, and how our work needs them (GL names from the registry, as everywhere below).
_ENABLES = {
    0x0BE2: False,  # BLEND
    0x0B71: True,  # DEPTH_TEST
    0x0B44: False,  # CULL_FACE
    0x0C11: False,  # SCISSOR_TEST
    0x0B90: False,  # STENCIL_TEST
    0x8F9D: False,  # PRIMITIVE_RESTART
    0x8D69: False,  # PRIMITIVE_RESTART_FIXED_INDEX
    0x8642: False,  # PROGRAM_POINT_SIZE
    0x8C89: False,  # RASTERIZER_DISCARD
    0x8DB9: False,  # FRAMEBUFFER_SRGB
    0x8037: False,  # POLYGON_OFFSET_FILL
    0x0BF2: False,  # COLOR_LOGIC_OP
    0x864F: False,  # DEPTH_CLAMP
    0x809E: False,  # SAMPLE_ALPHA_TO_COVERAGE
    0x8E51: False,  # SAMPLE_MASK
    **{0x3000 + k: False for k in range(8)},  # CLIP_DISTANCE0...
}
#: How pixels are packed in memory, and GL's defaults.
_PIXEL_STORE = {
    **dict.fromkeys((0x0CF0, 0x0CF1, 0x0CF2, 0x0CF3, 0x0CF4, 0x806D, 0x806E), 0),  # UNPACK_*
    **dict.fromkeys((0x0D00, 0x0D01, 0x0D02, 0x0D03, 0x0D04, 0x806B, 0x806C), 0),  # PACK_*
    0x0CF5: 4,  # UNPACK_ALIGNMENT
    0x0D05: 4,  # PACK_ALIGNMENT
}
#: Buffer bindings: name to ask for, target to bind.
_BUFFERS = {
    0x8894: 0x8892,  # ARRAY_BUFFER
    0x8A28: 0x8A11,  # UNIFORM_BUFFER
    0x90D3: 0x90D2,  # SHADER_STORAGE_BUFFER
    0x88ED: 0x88EB,  # PIXEL_PACK_BUFFER
    0x88EF: 0x88EC,  # PIXEL_UNPACK_BUFFER
    0x90EF: 0x90EE,  # DISPATCH_INDIRECT_BUFFER
}
_TEXTURES = {0x8069: 0x0DE1, 0x806A: 0x806F}  # 2D, 3D: name to ask for, target to bind
_UNITS = 32
_STORAGE_SLOTS, _IMAGE_UNITS = 8, interface.SOURCE_UNITS


class _State:
    """GL's getters and setters for the current context."""

    def __init__(self, loader: Loader) -> None:
        self._loader = loader
        self._functions: dict[str, Callable[..., Any]] = {}

    def call(self, name: str, *arguments: Any, types: tuple[Any, ...] = (), result: Any = None) -> Any:
        if name not in self._functions:
            self._functions[name] = self._loader.function(name, result, *(types or (_UINT,) * len(arguments)))
        return self._functions[name](*arguments)

    def integers(self, name: int, count: int = 1) -> list[int]:
        values = (_INT * max(count, 4))()
        self.call("glGetIntegerv", name, values, types=(_ENUM, ctypes.c_void_p))
        return list(values[:count])

    def indexed(self, name: int, index: int) -> int:
        values = (_INT * 4)()
        self.call("glGetIntegeri_v", name, index, values, types=(_ENUM, _UINT, ctypes.c_void_p))
        return values[0]

    def indexed_64(self, name: int, index: int) -> int:
        values = (ctypes.c_int64 * 4)()
        self.call("glGetInteger64i_v", name, index, values, types=(_ENUM, _UINT, ctypes.c_void_p))
        return values[0]

    def booleans(self, name: int, count: int) -> list[int]:
        values = (ctypes.c_ubyte * 16)()
        self.call("glGetBooleanv", name, values, types=(_ENUM, ctypes.c_void_p))
        return list(values[:count])

    def floats(self, name: int, count: int) -> list[float]:
        values = (ctypes.c_double * 16)()
        self.call("glGetDoublev", name, values, types=(_ENUM, ctypes.c_void_p))
        return list(values[:count])

    def exists(self, kind: str, name: int) -> bool:
        """Whether an object is still there: binding the name of a deleted one is an error."""
        return name == 0 or bool(self.call(f"glIs{kind}", name, result=ctypes.c_ubyte))

    def enable(self, name: int, value: bool) -> None:
        self.call("glEnable" if value else "glDisable", name)

    def pixel_store(self, name: int, value: int) -> None:
        self.call("glPixelStorei", name, value, types=(_ENUM, _INT))


def _save(gl: _State) -> list[Callable[[], Any]]:
    """Read all state that our work touches; each of what is returned puts a part of it back."""
    restore: list[Callable[[], Any]] = []

    def later(name: str, *arguments: Any, types: tuple[Any, ...] = ()) -> None:
        restore.append(lambda: gl.call(name, *arguments, types=types))

    def bind_later(kind: str, function: str, target: int, name: int) -> None:
        restore.append(lambda: gl.exists(kind, name) and gl.call(function, target, name))

    active = gl.integers(0x84E0)[0]
    for unit in range(_UNITS):
        gl.call("glActiveTexture", 0x84C0 + unit)
        later("glActiveTexture", 0x84C0 + unit)
        for binding, target in _TEXTURES.items():
            bind_later("Texture", "glBindTexture", target, gl.integers(binding)[0])
        bind_later("Sampler", "glBindSampler", unit, gl.integers(0x8919)[0])
    later("glActiveTexture", active)
    gl.call("glActiveTexture", active)

    for unit in range(min(_IMAGE_UNITS, gl.integers(0x8F38)[0])):  # MAX_IMAGE_UNITS
        name, level, layered, layer, access, form = (
            gl.indexed(query, unit) for query in (0x8F3A, 0x8F3B, 0x8F3C, 0x8F3D, 0x8F3E, 0x906E)
        )
        restore.append(partial(_bind_image, gl, (unit, name, level, layered, layer, access, form)))
    for slot in range(_STORAGE_SLOTS):
        name, start, size = gl.indexed(0x90D3, slot), gl.indexed_64(0x90D4, slot), gl.indexed_64(0x90D5, slot)
        restore.append(partial(_bind_storage, gl, slot, name, start, size))
    for query, target in _BUFFERS.items():
        bind_later("Buffer", "glBindBuffer", target, gl.integers(query)[0])

    bind_later("Framebuffer", "glBindFramebuffer", 0x8CA9, gl.integers(0x8CA6)[0])
    bind_later("Framebuffer", "glBindFramebuffer", 0x8CA8, gl.integers(0x8CAA)[0])
    bind_later("Renderbuffer", "glBindRenderbuffer", 0x8D41, gl.integers(0x8CA7)[0])
    program, array = gl.integers(0x8B8D)[0], gl.integers(0x85B5)[0]
    restore.append(lambda: gl.exists("Program", program) and gl.call("glUseProgram", program))
    restore.append(lambda: gl.exists("VertexArray", array) and gl.call("glBindVertexArray", array))

    for name in _PIXEL_STORE:
        later("glPixelStorei", name, gl.integers(name)[0], types=(_ENUM, _INT))
    later("glBlendFuncSeparate", *(gl.integers(name)[0] for name in (0x80C9, 0x80C8, 0x80CB, 0x80CA)))
    later("glBlendEquationSeparate", gl.integers(0x8009)[0], gl.integers(0x883D)[0])
    later("glDepthFunc", gl.integers(0x0B74)[0])
    later("glDepthRange", *gl.floats(0x0B70, 2), types=(ctypes.c_double, ctypes.c_double))
    later("glPolygonMode", 0x0408, gl.integers(0x0B40)[0])
    later("glCullFace", gl.integers(0x0B45)[0])
    later("glFrontFace", gl.integers(0x0B46)[0])
    later("glPrimitiveRestartIndex", gl.integers(0x8F9E)[0] & 0xFFFFFFFF)
    later("glViewport", *gl.integers(0x0BA2, 4), types=(_INT,) * 4)
    later("glScissor", *gl.integers(0x0C10, 4), types=(_INT,) * 4)
    later("glColorMask", *gl.booleans(0x0C23, 4), types=(ctypes.c_ubyte,) * 4)
    later("glDepthMask", *gl.booleans(0x0B72, 1), types=(ctypes.c_ubyte,))
    for name in _ENABLES:
        value = bool(gl.call("glIsEnabled", name, result=ctypes.c_ubyte))
        restore.append(partial(gl.enable, name, value))
    return restore


def _bind_image(gl: _State, arguments: tuple[int, ...]) -> None:
    if gl.exists("Texture", arguments[1]):
        types = (_UINT, _UINT, _INT, ctypes.c_ubyte, _INT, _ENUM, _ENUM)
        gl.call("glBindImageTexture", *arguments, types=types)


def _bind_storage(gl: _State, slot: int, name: int, start: int, size: int) -> None:
    if not gl.exists("Buffer", name):
        return
    if name and size:
        types = (_ENUM, _UINT, _UINT, ctypes.c_ssize_t, ctypes.c_ssize_t)
        gl.call("glBindBufferRange", 0x90D2, slot, name, start, size, types=types)
    else:
        gl.call("glBindBufferBase", 0x90D2, slot, name)


def _set_defaults(gl: _State) -> None:
    """What our work takes for granted."""
    for name, value in _ENABLES.items():
        gl.enable(name, value)
    for name, default in _PIXEL_STORE.items():
        gl.pixel_store(name, default)
    for target in (0x88EB, 0x88EC):  # pixel buffers would take the place of memory
        gl.call("glBindBuffer", target, 0)
    for unit in range(_UNITS):
        gl.call("glBindSampler", unit, 0)
    gl.call("glDepthFunc", 0x0201)  # LESS
    gl.call("glDepthRange", 0.0, 1.0, types=(ctypes.c_double, ctypes.c_double))
    gl.call("glPolygonMode", 0x0408, 0x1B02)  # FRONT_AND_BACK, FILL
    gl.call("glColorMask", 1, 1, 1, 1, types=(ctypes.c_ubyte,) * 4)
    gl.call("glDepthMask", 1, types=(ctypes.c_ubyte,))


@contextlib.contextmanager
def saved_state(loader: Loader) -> Iterator[None]:
    """Save the state of the current context that our work touches, set what it needs, and put all back at the end."""
    gl = _State(loader)
    restore = _save(gl)
    _set_defaults(gl)
    try:
        yield
    finally:
        for part in restore:
            part()
