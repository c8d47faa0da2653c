# SPDX-License-Identifier: GPL-3.0-or-later
"""Layouts by the rules of std430, bindings within what GL 4.3 has."""

from __future__ import annotations

import re

import numpy as np
import pytest

from addon.gpu import interface
from addon.scene import LightKind, RayVisibility


def test_std430_by_hand() -> None:
    """A vec3 is aligned to 16 bytes and leaves its last four to a following float; the stride is a multiple of 16."""
    kinds = {"a": "float", "b": "vec2", "c": "vec3", "d": "float", "e": "vec3", "f": "vec4", "g": "uint"}
    struct = interface.Struct("S", tuple((name, kind, "") for name, kind in kinds.items()))
    dtype = struct.dtype
    offsets = {name: dtype.fields[name][1] for name in dtype.names}  # type: ignore[index, union-attr]
    assert offsets == {"a": 0, "b": 8, "c": 16, "d": 28, "e": 32, "f": 48, "g": 64}
    assert dtype.itemsize == 80


@pytest.mark.parametrize("struct", interface.STRUCTS, ids=lambda s: s.name)
def test_fields_do_not_overlap(struct: interface.Struct) -> None:
    dtype = struct.dtype
    used = np.zeros(dtype.itemsize, int)
    for name in dtype.names or ():
        kind, offset = dtype.fields[name][:2]  # type: ignore[index]
        used[offset : offset + kind.itemsize] += 1
    assert (used <= 1).all() and dtype.itemsize % 16 == 0


def test_bindings() -> None:
    assert len(interface.BUFFERS) <= 8 and len(interface.IMAGES) <= 8 and len(interface.TEXTURES) <= 16
    for table in (interface.BUFFERS, interface.IMAGES, interface.TEXTURES):
        assert len(set(table)) == len(table)
    for alias, name in interface.ALIASES.items():
        assert interface.slot(alias) == interface.slot(name)
    with pytest.raises(KeyError):
        interface.slot("TEX_NOTHING")


def test_prelude_says_what_python_says() -> None:
    text = interface.prelude()
    defines = dict(re.findall(r"^#define (\w+) (\S+)$", text, re.MULTILINE))
    assert int(defines["GROUP_SIZE"]) == interface.GROUP_SIZE and int(defines["BRICK"]) == interface.BRICK
    assert int(defines["NONE_INDEX"].rstrip("u"), 16) == interface.NONE_INDEX
    for table in (interface.BUFFERS, interface.IMAGES, interface.TEXTURES, interface.ALIASES):
        for name in table:
            assert int(defines[name]) == interface.slot(name)
    for kind in LightKind:
        assert defines[f"LIGHT_{kind.name}"] == f"{kind.value}u"
    for flag in RayVisibility:
        assert defines[f"RAY_{flag.name}"] == f"{flag.value}u"
    assert int(defines["LIGHT_CASTS_SHADOW"].rstrip("u")) == interface.LIGHT_CASTS_SHADOW
    assert int(defines["LIGHT_IS_ELLIPSE"].rstrip("u")) == interface.LIGHT_IS_ELLIPSE
    assert int(defines["LIGHT_IS_SPHERE"].rstrip("u")) == interface.LIGHT_IS_SPHERE
    flags = [int(flag) for flag in RayVisibility]
    flags += [interface.LIGHT_CASTS_SHADOW, interface.LIGHT_IS_ELLIPSE, interface.LIGHT_IS_SPHERE]
    assert sum(flags) == np.bitwise_or.reduce(flags)
    assert interface.TRIANGLE_HOLDOUT & int(RayVisibility.ALL) == 0 and interface.TRIANGLE_HOLDOUT < 256
