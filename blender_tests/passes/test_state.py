# SPDX-License-Identifier: GPL-3.0-or-later
"""The state guard: what another program left changes no picture, and it finds its state again."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.gpu.loader import current_context_loader
from addon.gpu.state import saved_state
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline

ENUM, INT = ctypes.c_uint, ctypes.c_int


def gl(name: str, *arguments: Any, types: tuple[Any, ...] | None = None, result: Any = None) -> Any:
    return current_context_loader().function(name, result, *(types or (ENUM,) * len(arguments)))(*arguments)


def integer(name: int) -> tuple[int, ...]:
    values = (INT * 16)()
    gl("glGetIntegerv", name, values, types=(ENUM, ctypes.c_void_p))
    return tuple(values[:4])


# What a hostile program may leave, how to undo it, and what to ask for.
HOSTILE: dict[str, tuple[Callable[[], Any], Callable[[], Any], int]] = {
    "depth function": (lambda: gl("glDepthFunc", 0x0204), lambda: gl("glDepthFunc", 0x0201), 0x0B74),
    "blend": (lambda: gl("glEnable", 0x0BE2), lambda: gl("glDisable", 0x0BE2), 0x0BE2),
    "cull": (lambda: gl("glEnable", 0x0B44), lambda: gl("glDisable", 0x0B44), 0x0B44),
    "discard": (lambda: gl("glEnable", 0x8C89), lambda: gl("glDisable", 0x8C89), 0x8C89),
    "scissor": (lambda: gl("glEnable", 0x0C11), lambda: gl("glDisable", 0x0C11), 0x0C11),
    "restart": (lambda: gl("glEnable", 0x8F9D), lambda: gl("glDisable", 0x8F9D), 0x8F9D),
    "logic": (lambda: gl("glEnable", 0x0BF2), lambda: gl("glDisable", 0x0BF2), 0x0BF2),
    "row length": (
        lambda: gl("glPixelStorei", 0x0CF2, 7, types=(ENUM, INT)),
        lambda: gl("glPixelStorei", 0x0CF2, 0, types=(ENUM, INT)),
        0x0CF2,
    ),
    "lines": (lambda: gl("glPolygonMode", 0x0408, 0x1B01), lambda: gl("glPolygonMode", 0x0408, 0x1B02), 0x0B40),
    "depth mask": (
        lambda: gl("glDepthMask", 0, types=(ctypes.c_ubyte,)),
        lambda: gl("glDepthMask", 1, types=(ctypes.c_ubyte,)),
        0x0B72,
    ),
    "restart index": (
        lambda: gl("glPrimitiveRestartIndex", 5), lambda: gl("glPrimitiveRestartIndex", 0xFFFFFFFF), 0x8F9E,
    ),
    "active unit": (lambda: gl("glActiveTexture", 0x84C5), lambda: gl("glActiveTexture", 0x84C0), 0x84E0),
}  # fmt: skip


def picture(gpu: GpuContext) -> np.ndarray:
    with pipeline(gpu, scenes.cornell(), scenes.settings(16, bounces=2), (24, 24), samples=1) as ready:
        return ready.film.read("combined")


@pytest.mark.parametrize("name", HOSTILE)
def test_what_was_left_is_no_harm_and_is_found_again(name: str, gpu: GpuContext) -> None:
    disturb, undo, query = HOSTILE[name]
    expected = picture(gpu)
    disturb()
    try:
        before = integer(query)
        with saved_state(current_context_loader()):
            found = picture(gpu)
        assert integer(query) == before
    finally:
        undo()
    np.testing.assert_array_equal(found, expected)


def test_samplers_and_bindings(gpu: GpuContext) -> None:
    """A sampler object of another program filters none of our textures; its buffers and textures stay bound."""
    expected = picture(gpu)
    nearest = gpu.mgl.sampler(filter=(gpu.mgl.LINEAR, gpu.mgl.LINEAR), repeat_x=False, repeat_y=False)
    texture, buffer = gpu.mgl.texture((2, 2), 4), gpu.mgl.buffer(bytes(64))
    for unit in range(20):
        nearest.use(unit)
    texture.use(3)
    buffer.bind_to_storage_buffer(2)
    gl("glActiveTexture", 0x84C3)
    bound = integer(0x8069), integer(0x8919)
    with saved_state(current_context_loader()):
        found = picture(gpu)
    gl("glActiveTexture", 0x84C3)
    assert (integer(0x8069), integer(0x8919)) == bound and bound[0][0] == texture.glo
    values = (INT * 4)()
    gl("glGetIntegeri_v", 0x90D3, 2, values, types=(ENUM, ENUM, ctypes.c_void_p))
    assert values[0] == buffer.glo
    np.testing.assert_array_equal(found, expected)
    for unit in range(20):
        nearest.clear(unit)
    for thing in (nearest, texture, buffer):
        thing.release()


def test_deleted_objects_are_not_bound_again(gpu: GpuContext) -> None:
    """What was bound before and is gone by the end is left unbound: no GL error (the fixture looks for one)."""
    buffer = gpu.mgl.buffer(bytes(64))
    gl("glBindBuffer", 0x8892, buffer.glo)
    with saved_state(current_context_loader()):
        buffer.release()
    assert integer(0x8894)[0] == 0
