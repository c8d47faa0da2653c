# SPDX-License-Identifier: GPL-3.0-or-later
"""The GL context: Blender's or our own, what it can do, its state guard, and the objects that live in it."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from . import interface, loader
from .program import ShaderError, Source, resolve
from .put_away import PutAway
from .state import saved_state

_DISPATCH_INDIRECT_BUFFER = 0x90EE

#: moderngl has one context for all threads that it hands out, and each that is made takes its place.
_coming = threading.Lock()


#: Compute programs that are kept however old they are, and times that what they come from may change before others,
#: which nothing has used since, are released. An edited node graph leaves a program behind, half a megabyte each.
MOST_PROGRAMS, PROGRAM_AGE = 128, 32

#: What glGetGraphicsResetStatus gives while all is well.
_NO_ERROR = 0


#: What moderngl has made of contexts that are not ours, by their handles: it keeps 50 KB of each for ever.
_attached: dict[int, moderngl.Context] = {}


class GpuUnavailable(RuntimeError):
    """There is no usable GL. The text is a sentence for the user."""


@dataclass
class PassTime:
    """What one pass has cost since ``GpuContext.times`` was cleared."""

    calls: int = 0
    cpu_ms: float = 0.0
    gpu_ms: float = 0.0


@dataclass
class Kernel:
    """A compiled compute shader: bound and run by name."""

    shader: moderngl.ComputeShader
    source: Source
    gpu: GpuContext
    is_cold: bool = True  # drivers finish compiling when a program first runs
    last_use: int = 0  # in changes of what programs are made from

    def set(self, **values: Any) -> Kernel:
        """Set uniforms. One that the compiler dropped is ignored; one that the source never had raises KeyError."""
        for name, value in values.items():
            member: Any = self.shader.get(name, None)
            if member is not None:
                if isinstance(value, list) and isinstance(value[0], tuple):
                    # An array of vectors; compilers drop the end of one that is never read.
                    value = value[: member.array_length] if member.array_length > 1 else value[0]
                member.value = value
            elif name not in self.source.text:
                raise KeyError(f"shader '{self.source.files[1]}' has no uniform '{name}'")
        return self

    def run_list(self, count: int) -> None:
        """Run one thread for each of ``count`` items (``invocation_index()`` in the shader)."""
        groups = -(-count // interface.GROUP_SIZE)
        if groups:
            columns = min(groups, 32768)
            self.run_groups(columns, -(-groups // columns), 1)

    def run_tiles(self, width: int, height: int) -> None:
        """Run one thread for each pixel of a picture or of a part of it."""
        tile = interface.TILE_SIZE
        self.run_groups(-(-width // tile), -(-height // tile), 1)

    def run_groups(self, x: int, y: int, z: int) -> None:
        """Run this many work groups."""
        self._warm_up()
        self.gpu.dispatch(self.shader, x, y, z)

    def run_indirect(self, arguments: moderngl.Buffer, offset: int) -> None:
        """Run as many work groups as three numbers at ``offset`` of a buffer say."""
        self._warm_up()
        self.gpu.dispatch_indirect(self.shader, arguments, offset)

    def _warm_up(self) -> None:
        """An empty dispatch with everything bound, so that compiling is not counted as the pass's own time."""
        if self.is_cold:
            self.is_cold = False
            with self.gpu.timed("compile"):
                self.gpu.dispatch_indirect(self.shader, self.gpu.no_groups, 0)


_MAX_IMAGE_UNITS, _MAX_COMPUTE_IMAGE_UNIFORMS = 0x8F38, 0x91BD


class GpuContext:
    """One GL context with the programs, textures and buffers that we made in it.

    Everything is made through this class, so that sizes are known (``memory``) and all of it can be released.
    """

    def __init__(self, mgl: moderngl.Context, *, owned: bool) -> None:
        self.owned = owned
        self.memory: dict[str, int] = {}
        self.times: dict[str, PassTime] = {}
        self._inner_times: list[list[float]] = []
        self._kernels: dict[tuple, Kernel] = {}  # in the order of their last use
        self._changes = 0
        self._programs: dict[tuple, moderngl.Program] = {}
        self._objects: dict[int, tuple[str, Any, int]] = {}
        self._put_away: list[tuple[str, PutAway, int]] = []  # name, content, size
        self._connect(mgl)

    def _connect(self, mgl: moderngl.Context) -> None:
        """From now on this is ``mgl``, which is current. Raises GpuUnavailable."""
        self.mgl = mgl
        self.renderer = str(mgl.info.get("GL_RENDERER", "unknown"))
        self.reads_images = False  # sources (lib/source.glsl)
        if mgl.version_code < 430:
            raise GpuUnavailable(
                f"Conelight needs OpenGL 4.3, but this graphics driver ({self.renderer}) offers "
                f"{mgl.version_code // 100}.{mgl.version_code // 10 % 10}: update the driver or use another device"
            )
        mgl.error  # noqa: B018 - reading clears an error that was there before us
        self.no_groups = mgl.buffer(bytes(12))  # arguments of an indirect dispatch of nothing
        # By ctypes, so that other threads of Python run meanwhile, Blender's interface among them; moderngl stops them.
        # On the CPU a dispatch comes back only when it is done.
        function = loader.current_context_loader().function
        unsigned, signed = ctypes.c_uint, ctypes.c_ssize_t
        self._finish = function("glFinish", None)
        self._use_program = function("glUseProgram", None, unsigned)
        self._bind_buffer = function("glBindBuffer", None, unsigned, unsigned)
        self._dispatch = function("glDispatchCompute", None, unsigned, unsigned, unsigned)
        self._dispatch_indirect = function("glDispatchComputeIndirect", None, signed)
        self._set_viewport = function("glViewport", None, *[ctypes.c_int] * 4)
        image = ctypes.c_uint, ctypes.c_uint, *[ctypes.c_int] * 4
        self._copy_image = function("glCopyImageSubData", None, *image, *image, *[ctypes.c_int] * 3)
        try:
            self._reset_status = function("glGetGraphicsResetStatus", ctypes.c_uint)
        except RuntimeError:  # before OpenGL 4.5, without KHR_robustness
            self._reset_status = lambda: _NO_ERROR
        limit, get_integer = ctypes.c_int(), function("glGetIntegerv", None, unsigned, ctypes.c_void_p)
        limits = []
        for name in (_MAX_IMAGE_UNITS, _MAX_COMPUTE_IMAGE_UNIFORMS):
            get_integer(name, ctypes.byref(limit))
            limits.append(limit.value)
        has_units = limits[0] >= interface.SOURCE_UNITS and limits[1] >= interface.MOST_IMAGES
        self.reads_images = loader.is_software(self.renderer) and has_units
        self._native = loader.current_context()

    # Contexts ---------------------------------------------------------------------------------------------------

    @classmethod
    def attach(cls) -> GpuContext:
        """Wrap the GL context that is current on this thread. Raises GpuUnavailable."""
        with _unavailable_where_it_fails(owned=False), saved_state(loader.current_context_loader()):
            return cls(_current(), owned=False)

    @classmethod
    def standalone(cls) -> GpuContext:
        """Make a context of our own without a window. Use it on the thread that made it. Raises GpuUnavailable."""
        with _unavailable_where_it_fails(owned=True):
            return cls(_new(), owned=True)

    def put_away(self) -> None:
        """Read all textures and buffers back, and release them and all else, a context of our own too.

        Nothing but textures without mipmaps, and buffers, may be there then. :meth:`put_back` undoes it.
        """
        kept = [(name, PutAway.of(thing), size) for name, thing, size in self._objects.values()]
        self.release()
        self._put_away = kept

    def put_back(self) -> None:
        """All that was put away is there again: in the context that is current, or in a new one if it was our own.

        Raises GpuUnavailable, and MemoryError: :meth:`release` lets go then of what is there.
        """
        kept, self._put_away = self._put_away, []
        with _unavailable_where_it_fails(owned=self.owned):
            self._connect(_new() if self.owned else _current())
        for name, content, size in kept:
            self.make(name, size, functools.partial(content.put_back, self.mgl))

    @contextlib.contextmanager
    def guard(self) -> Iterator[None]:
        """Save the GL state that Blender relies on and put it back afterwards."""
        if self.owned:
            yield
            return
        with saved_state(loader.current_context_loader()):
            yield

    @property
    def is_current(self) -> bool:
        """Whether this context is the one that GL calls of this thread go to."""
        return loader.current_context() == self._native

    # Programs ---------------------------------------------------------------------------------------------------

    def kernel(
        self, name: str, defines: Mapping[str, object] | None = None, texts: Mapping[str, str] | None = None
    ) -> Kernel:
        """The compute shader ``passes/<name>.comp.glsl``, compiled once for each set of defines. Raises ShaderError."""
        defines, texts = defines or {}, texts or {}
        key = (name, tuple(sorted(defines.items())), tuple(sorted(texts.items())))
        if key not in self._kernels:
            source = resolve(f"passes/{name}.comp.glsl", {**defines, "READS_IMAGES": self.reads_images}, texts)
            try:
                with self.timed("compile"):
                    shader = self.mgl.compute_shader(source.text)
            except Exception as error:
                self.check()
                raise ShaderError(self._shader_message(source, defines, error)) from error
            kernel = Kernel(shader, source, self)
        else:
            kernel = self._kernels.pop(key)
        kernel.last_use = self._changes
        self._kernels[key] = kernel
        return kernel

    def age_programs(self) -> None:
        """Materials or the world changed: release compute programs that have not been used for long.

        Scenes with many materials need many: what is in use is kept however many that are.
        """
        self._changes += 1
        for key in list(self._kernels)[: max(len(self._kernels) - MOST_PROGRAMS, 0)]:
            if self._kernels[key].last_use >= self._changes - PROGRAM_AGE:
                return
            self._kernels.pop(key).shader.release()

    def program(
        self, name: str, defines: Mapping[str, object] | None = None, texts: Mapping[str, str] | None = None
    ) -> moderngl.Program:
        """The program of ``passes/<name>.vert.glsl`` and ``.frag.glsl``. Raises ShaderError."""
        defines, texts = defines or {}, texts or {}
        key = (name, tuple(sorted(defines.items())), tuple(sorted(texts.items())))
        if key not in self._programs:
            vertex = resolve(f"passes/{name}.vert.glsl", defines, texts)
            fragment = resolve(f"passes/{name}.frag.glsl", defines, texts)
            try:
                self._programs[key] = self.mgl.program(vertex_shader=vertex.text, fragment_shader=fragment.text)
            except Exception as error:
                self.check()
                raise ShaderError(self._shader_message(fragment, defines, error)) from error
        return self._programs[key]

    def _shader_message(self, source: Source, defines: Mapping[str, object], error: Exception) -> str:
        given = ", ".join(f"{key}={value}" for key, value in sorted(defines.items())) or "none"
        return (
            f"Shader {source.files[1]} does not compile on this graphics driver ({self.renderer}): update the driver, "
            f"or report this (defines: {given})\n{source.explain(str(error))}"
        )

    def dispatch(self, shader: moderngl.ComputeShader, x: int, y: int, z: int) -> None:
        """Run this many work groups."""
        self._use_program(shader.glo)
        self._dispatch(x, y, z)

    def dispatch_indirect(self, shader: moderngl.ComputeShader, arguments: moderngl.Buffer, offset: int) -> None:
        """Run as many work groups as three numbers at ``offset`` of a buffer say."""
        self._use_program(shader.glo)
        self._bind_buffer(_DISPATCH_INDIRECT_BUFFER, arguments.glo)
        self._dispatch_indirect(offset)

    def draw_over(self, box: tuple[int, int, int, int], vertices: moderngl.VertexArray, count: int) -> None:
        """Draw triangles into ``box`` (left, bottom, width, height in pixels) of the framebuffer that is bound."""
        self.mgl.enable_only(moderngl.NOTHING)  # without depth test depth is not written either
        self._set_viewport(*box)
        vertices.render(moderngl.TRIANGLES, vertices=count)

    # Storage ----------------------------------------------------------------------------------------------------

    def copy(self, source: moderngl.Texture, target: moderngl.Texture) -> None:
        """Copy one 2D texture to another of the same size and format."""
        self._copy_image(source.glo, 0x0DE1, 0, 0, 0, 0, target.glo, 0x0DE1, 0, 0, 0, 0, *source.size, 1)

    def copy_list(
        self, source: moderngl.Texture, target: moderngl.Texture, first: int, count: int, target_first: int
    ) -> None:
        """Copy entries of one list texture to another of the same format."""
        for a, b, width, height in list_rectangles(first, count, target_first):
            self._copy_image(source.glo, 0x0DE1, 0, *a, 0, target.glo, 0x0DE1, 0, *b, 0, width, height, 1)

    def buffer(self, name: str, data: np.ndarray | bytes | None = None, *, size: int = 0) -> moderngl.Buffer:
        """A buffer with ``data`` in it, or of ``size`` bytes of zero."""
        raw = None if data is None else _bytes_of(data)
        size = max(size if raw is None else raw.nbytes, 16)
        limit = int(self.mgl.info.get("GL_MAX_SHADER_STORAGE_BLOCK_SIZE", 1 << 27))
        if size > limit:
            raise MemoryError(
                f"{name} needs {size / 2**20:.0f} MiB in one buffer and this driver allows {limit / 2**20:.0f}: "
                "lower the voxel resolution or simplify the scene"
            )
        buffer: moderngl.Buffer = self.make(name, size, lambda: self.mgl.buffer(reserve=size))
        if raw is None or not raw.nbytes:
            buffer.clear()
        else:
            buffer.write(raw)
        return buffer

    def texture(
        self,
        name: str,
        size: tuple[int, int],
        components: int,
        dtype: str,
        data: np.ndarray | None = None,
        *,
        linear: bool = False,
    ) -> moderngl.Texture:
        """A 2D texture; ``data`` (rows, columns, components) or undefined content."""
        raw = None if data is None else _bytes_of(data)
        texture: moderngl.Texture = self.make(
            name, size[0] * size[1] * components * _BYTES[dtype],
            lambda: self.mgl.texture(size, components, raw, dtype=dtype, alignment=1),
        )  # fmt: skip
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR) if linear else (moderngl.NEAREST, moderngl.NEAREST)
        texture.repeat_x = texture.repeat_y = False
        return texture

    def texture_3d(
        self, name: str, size: tuple[int, int, int], components: int, dtype: str, data: np.ndarray | None = None
    ) -> moderngl.Texture3D:
        """A 3D texture; ``data`` (z, y, x, components) or zeros."""
        count = size[0] * size[1] * size[2] * components
        raw = bytes(count * _BYTES[dtype]) if data is None else _bytes_of(data)
        texture: moderngl.Texture3D = self.make(
            name, count * _BYTES[dtype], lambda: self.mgl.texture3d(size, components, raw, dtype=dtype, alignment=1)
        )
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.repeat_x = texture.repeat_y = texture.repeat_z = False
        return texture

    def list_texture(
        self, name: str, count: int, components: int, dtype: str, data: np.ndarray | None = None
    ) -> moderngl.Texture:
        """A 2D texture that holds a list of ``count`` texels (``list_texel()`` in the shaders)."""
        width = interface.LIST_WIDTH
        rows = max(1, -(-count // width))
        if rows > 16384:
            raise MemoryError(f"{name} has {count} entries, more than a texture can hold: lower the voxel resolution")
        texture = self.texture(name, (width, rows), components, dtype)
        if data is not None and len(data):
            self.write_list(texture, data)
        return texture

    def write_list(self, texture: moderngl.Texture, data: np.ndarray) -> None:
        """Write entries of a list texture, from the first on; ``data``: one row for each."""
        width = interface.LIST_WIDTH
        whole = len(data) // width
        if whole:
            texture.write(_bytes_of(data[: whole * width]), viewport=(0, 0, width, whole), alignment=1)
        if len(data) > whole * width:
            rest = len(data) - whole * width
            texture.write(_bytes_of(data[whole * width :]), viewport=(0, whole, rest, 1), alignment=1)

    def make(self, name: str, size: int, make: Callable[[], Any]) -> Any:
        """The object that ``make`` makes, of ``size`` bytes, counted. Raises MemoryError where there is no memory."""
        try:
            thing = make()
        except moderngl.Error as error:
            self.check()
            raise MemoryError(_no_memory(name, size, f" ({error})")) from error
        if self.mgl.error == "GL_OUT_OF_MEMORY":  # moderngl does not look
            thing.release()
            raise MemoryError(_no_memory(name, size))
        return self._track(name, thing, size)

    def _track(self, name: str, thing: Any, size: int) -> Any:
        self._objects[id(thing)] = (name, thing, size)
        if size:
            self.memory[name] = self.memory.get(name, 0) + size
        return thing

    def free(self, *things: Any) -> None:
        """Release objects made here; None and objects already freed are ignored."""
        for thing in things:
            entry = self._objects.pop(id(thing), None) if thing is not None else None
            if entry is None:
                continue
            name, _, size = entry
            self.memory[name] = self.memory.get(name, 0) - size  # things without size leave no entry
            if self.memory[name] <= 0:
                del self.memory[name]
            thing.release()

    def alive(self) -> frozenset[int]:
        """What is there now, for :meth:`free_since`."""
        return frozenset(self._objects)

    def free_since(self, before: frozenset[int]) -> None:
        """Free everything made since, also what nobody knows of because its maker failed in the middle."""
        self.free(*(thing for key, (_, thing, _) in list(self._objects.items()) if key not in before))

    def check(self) -> None:
        """Raises GpuUnavailable where the device was reset, MemoryError where work since the last call found none."""
        if self._reset_status() != _NO_ERROR:
            raise GpuUnavailable(
                "The graphics driver was reset and what was being rendered is lost: render again; if that happens "
                "often, lower the resolution or update the driver."
            )
        if self.mgl.error == "GL_OUT_OF_MEMORY":
            raise MemoryError(_no_memory("this render", 0))

    @property
    def object_count(self) -> int:
        """Textures, buffers and other objects alive (programs apart)."""
        return len(self._objects)

    @property
    def program_count(self) -> int:
        """Compiled programs that are kept."""
        return len(self._kernels) + len(self._programs)

    def release(self) -> None:
        """Release everything that was made here, and the context when it is ours."""
        for _, thing, _ in list(self._objects.values()):
            thing.release()
        self._objects.clear()
        self.memory.clear()
        for kernel in self._kernels.values():
            kernel.shader.release()
        for program in self._programs.values():
            program.release()
        self._kernels.clear()
        self._programs.clear()
        self.no_groups.release()
        if self.owned:
            self.mgl.release()

    # Running ----------------------------------------------------------------------------------------------------

    def use_source(self, texture: moderngl.Texture | moderngl.Texture3D, name: str, index: int = 0) -> None:
        """Bind what shaders read by lib/source.glsl, if it is of those. ``name``: its texture unit, or ``index`` on."""
        texture.use(interface.slot(name) + index)
        if self.reads_images and name in interface.SOURCES:
            texture.bind_to_image(interface.SOURCES[name] + index, read=True, write=False)

    def barrier(self) -> None:
        """What was written by shaders so far is visible to every later read, of any kind.

        One kind of barrier for all: drivers make no cheaper one in practice, and a bit forgotten is a race.
        """
        self.mgl.memory_barrier()

    @contextlib.contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Count time under ``name``. Process CPU time, as software GL works on other threads; waits for the GPU.

        Time that an inner ``timed`` counts is not counted again outside it.
        """
        self._finish()
        self._inner_times.append([0.0, 0.0])
        cpu, wall = time.process_time(), time.perf_counter()
        try:
            yield
        finally:
            self._finish()
            cpu, wall = (time.process_time() - cpu) * 1e3, (time.perf_counter() - wall) * 1e3
            inner = self._inner_times.pop()
            entry = self.times.setdefault(name, PassTime())
            entry.calls += 1
            entry.cpu_ms += cpu - inner[0]
            entry.gpu_ms += wall - inner[1]
            if self._inner_times:
                self._inner_times[-1][0] += cpu
                self._inner_times[-1][1] += wall


@contextlib.contextmanager
def _unavailable_where_it_fails(*, owned: bool) -> Iterator[None]:
    """Raises GpuUnavailable where a context cannot be had."""
    try:
        yield
    except GpuUnavailable:
        raise
    except Exception as error:
        raise GpuUnavailable(
            f"Conelight could not make an OpenGL 4.3 context: install or update the graphics driver ({error})"
            if owned
            else "Conelight found no OpenGL context to draw with: in Preferences > System set the backend to OpenGL "
            f"and start Blender again ({error})"
        ) from error


def _current() -> moderngl.Context:
    """What moderngl makes of the GL context that is current on this thread; it changes its state."""
    with _coming:
        native = loader.current_context()
        if native not in _attached:
            moderngl.init_context(loader.current_context_loader())
            _attached[native] = moderngl.get_context()
        return _attached[native]


def _new() -> moderngl.Context:
    """A context of our own without a window, for the thread that makes it."""
    settings: dict[str, Any] = {}
    if sys.platform.startswith("linux"):
        settings = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
    with _coming:
        return moderngl.create_context(require=430, standalone=True, **settings)


def list_rectangles(
    first: int, count: int, target_first: int
) -> list[tuple[tuple[int, int], tuple[int, int], int, int]]:
    """Rectangles (corner in the source, corner in the target, width, height) of list textures that hold ``count``
    entries from ``first`` on, which go to ``target_first`` on."""
    width = interface.LIST_WIDTH
    found = []

    def add(columns: int, rows: int) -> None:
        found.append((divmod(first, width)[::-1], divmod(target_first, width)[::-1], columns, rows))

    while count and (target_first % width or count < width):
        part = min(count, width - first % width, width - target_first % width)
        add(part, 1)
        first, target_first, count = first + part, target_first + part, count - part
    rows, before = divmod(count, width)[0], width - first % width
    if rows:  # whole rows of the target: left and right of where rows of the source end
        add(before, rows)
        if before < width:
            first, target_first = first + before, target_first + before
            add(width - before, rows)
            first, target_first = first - before, target_first - before
        done = rows * width
        found += list_rectangles(first + done, count - done, target_first + done)
    return found


_BYTES = {"f1": 1, "f2": 2, "f4": 4, "u1": 1, "u2": 2, "u4": 4, "i4": 4, "nu2": 2}


def _bytes_of(data: np.ndarray | bytes) -> memoryview:
    """The bytes of ``data``, not copied when they lie one after another."""
    if isinstance(data, bytes):
        return memoryview(data)
    return np.ascontiguousarray(data).reshape(-1).view(np.uint8).data


def _no_memory(name: str, size: int, why: str = "") -> str:
    amount = f" of {size / 2**20:.1f} MiB" if size else ""
    return (
        f"There is no memory for {name}{amount} on the graphics device{why}: lower the voxel resolution, "
        "the resolution or the sizes of images."
    )
