# SPDX-License-Identifier: GPL-3.0-or-later
"""Structs mean the same to numpy and to the driver at hand."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

from addon.gpu import interface, loader
from addon.gpu.context import GpuContext
from blender_tests.passes.run import test_kernel

_COMPONENTS = {"float": "", "uint": "", "int": "", "vec2": "xy", "vec3": "xyz", "vec4": "xyzw"}


@pytest.mark.parametrize("struct", interface.STRUCTS, ids=lambda s: s.name)
def test_struct_layout(struct: interface.Struct, gpu: GpuContext) -> None:
    """A different number in every component of three records comes out of a shader in the order of the fields."""
    parts = [
        (name, kind, part) for name, kind, _ in struct.fields for part in [f".{x}" for x in _COMPONENTS[kind]] or [""]
    ]
    records = np.zeros(3, struct.dtype)
    number = 0
    expected = []
    for record in records:
        for name, kind, _ in struct.fields:
            size = max(1, len(_COMPONENTS[kind]))
            values = np.arange(number + 1, number + 1 + size)
            number += size
            record[name] = values if size > 1 else values[0]
            expected.append(
                values.astype(np.uint32) if kind in ("uint", "int") else values.astype(np.float32).view(np.uint32)
            )
    lines = [
        f"    copied[at + {index}u] = "
        + ("uint" if kind in ("uint", "int") else "floatBitsToUint")
        + f"(record.{name}{part});"
        for index, (name, kind, part) in enumerate(parts)
    ]
    kernel = test_kernel(
        gpu, "struct_copy", {"STRUCT": struct.name, "COMPONENTS": len(parts)}, {"fields": "\n".join(lines)}
    )
    given = gpu.buffer("test input", records)
    made = gpu.buffer("test output", size=4 * 3 * len(parts))
    given.bind_to_storage_buffer(interface.slot("BUF_WORK"))
    made.bind_to_storage_buffer(interface.slot("BUF_RESULTS"))
    kernel.set(count=3)
    kernel.run_list(3)
    gpu.barrier()  # read back
    copied = np.frombuffer(made.read(), np.uint32)[: 3 * len(parts)]
    gpu.free(given, made)
    np.testing.assert_array_equal(copied, np.concatenate(expected))


def test_long_lists_reach_every_item(gpu: GpuContext) -> None:
    """More groups than one dimension of a dispatch holds: two million and one items, each written once."""
    count = 32768 * interface.GROUP_SIZE + 1
    kernel = test_kernel(
        gpu, "struct_copy", {"STRUCT": "uint", "COMPONENTS": 1}, {"fields": "    copied[at] = record + index;\n"}
    )
    given = gpu.buffer("test input", np.ones(count, np.uint32))
    made = gpu.buffer("test output", size=4 * count)
    given.bind_to_storage_buffer(interface.slot("BUF_WORK"))
    made.bind_to_storage_buffer(interface.slot("BUF_RESULTS"))
    kernel.set(count=count)
    kernel.run_list(count)
    gpu.barrier()  # read back
    copied = np.frombuffer(made.read(), np.uint32)
    gpu.free(given, made)
    np.testing.assert_array_equal(copied, np.arange(count, dtype=np.uint32) + 1)


def test_driver_errors_are_noticed(gpu: GpuContext) -> None:
    """What the other tests rely on: a wrong call is logged, also behind many harmless messages."""
    gl = loader.current_context_loader()
    u = ctypes.c_uint
    insert = gl.function("glDebugMessageInsert", None, u, u, u, u, ctypes.c_int, ctypes.c_char_p)
    for _ in range(100):
        insert(0x824A, 0x8250, 1, 0x826B, -1, b"performance")  # application, performance, notification
    gl.function("glEnable", None, u)(0x1234567)
    messages = loader.debug_messages(gl)
    assert gpu.mgl.error == "GL_INVALID_ENUM"
    assert len(messages) == 1 and "glEnable" in messages[0]
    assert loader.debug_messages(gl) == []


def test_lists_hold_what_was_given(gpu: GpuContext) -> None:
    """Whole rows, a row begun, both, and nothing; buffers of a size are zero."""
    width = interface.LIST_WIDTH
    for count in (0, 1, width, 2 * width + 3):
        rows = np.arange(4 * count, dtype=np.uint32).reshape(-1, 4)
        made = gpu.list_texture("test list", count, 4, "u4", rows)
        found = np.frombuffer(made.read(), np.uint32).reshape(-1, 4)
        gpu.free(made)
        assert len(found) == width * max(1, -(-count // width))
        np.testing.assert_array_equal(found[:count], rows)
    every_other = np.arange(20, dtype=np.uint32)[::2]
    made = [gpu.buffer("test input", every_other), gpu.buffer("test output", size=20), gpu.buffer("test output", b"")]
    found = [np.frombuffer(buffer.read(), np.uint32) for buffer in made]
    gpu.free(*made)
    np.testing.assert_array_equal(found[0], every_other)
    assert len(found[1]) == 5 and not found[1].any() and not found[2].any()
