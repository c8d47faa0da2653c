# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture on the screen: what the film had, where it was asked for, into whatever framebuffer is bound."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.gpu.loader import current_context_loader
from addon.gpu.state import saved_state
from addon.passes.compose import Film
from addon.passes.present import PresentPass

SIZE = (6, 4)


@pytest.fixture
def film(gpu: GpuContext) -> Iterator[Film]:
    film = Film(gpu)
    film.start(SIZE, {"combined"}, adaptive=False)
    yield film
    film.release()


@pytest.fixture
def present(gpu: GpuContext) -> Iterator[PresentPass]:
    present = PresentPass(gpu)
    yield present
    present.release()


@pytest.fixture
def region(gpu: GpuContext) -> Iterator[moderngl.Framebuffer]:
    """As Blender's: half floats and depth, 12 x 8 pixels, cleared to 0 and to depth 0.25; bound."""
    texture, depth = gpu.mgl.texture((12, 8), 4, dtype="f2"), gpu.mgl.depth_texture((12, 8))
    framebuffer = gpu.mgl.framebuffer([texture], depth)
    framebuffer.clear(depth=0.25)
    neutral = gpu.mgl.detect_framebuffer(0)
    framebuffer.use()
    yield framebuffer
    neutral.use()
    for thing in (framebuffer, texture, depth):
        thing.release()


def fill(film: Film, values: np.ndarray) -> None:
    film._means["combined"].write(np.ascontiguousarray(values, np.float32).tobytes())


def seen(region: moderngl.Framebuffer) -> np.ndarray:
    """(H, W, 4), row 0 at the bottom."""
    return np.frombuffer(region.read(components=4, dtype="f4"), np.float32).reshape(8, 12, 4)


def noise() -> np.ndarray:
    return np.random.default_rng(1).uniform(0, 8, (*SIZE[::-1], 4)).astype(np.float16).astype(np.float32)


def test_pixel_for_pixel(film: Film, present: PresentPass, region: moderngl.Framebuffer) -> None:
    values = noise()
    fill(film, values)
    present.keep(film, "combined")
    present.draw((3, 2, *SIZE))
    expected = np.zeros((8, 12, 4), np.float32)
    expected[2:6, 3:9] = values
    np.testing.assert_array_equal(seen(region), expected)
    depth = np.frombuffer(region.depth_attachment.read(), np.float32)
    assert np.allclose(depth, 0.25), "Blender's own depth stays"


def test_what_is_kept_stays_while_the_film_begins_anew(
    film: Film, present: PresentPass, region: moderngl.Framebuffer
) -> None:
    values = noise()
    fill(film, values)
    present.keep(film, "combined")
    film.start((3, 2), {"combined"}, adaptive=False)
    present.draw((0, 0, *SIZE))
    np.testing.assert_array_equal(seen(region)[:4, :6], values)
    present.keep(film, "combined")  # of another size now
    present.draw((0, 0, 12, 8))
    assert not seen(region).any()


def test_a_smaller_picture_is_stretched_smoothly(
    film: Film, present: PresentPass, region: moderngl.Framebuffer
) -> None:
    values = np.zeros((*SIZE[::-1], 4), np.float32)
    values[...] = np.arange(6)[None, :, None]
    fill(film, values)
    present.keep(film, "combined")
    present.draw((0, 0, 12, 8))
    expected = np.clip((np.arange(12) + 0.5) / 2 - 0.5, 0, 5)
    assert np.allclose(seen(region)[..., 0], expected, atol=0.02)


def test_what_half_floats_cannot_hold_is_cut(
    film: Film, present: PresentPass, region: moderngl.Framebuffer
) -> None:
    values = np.zeros((*SIZE[::-1], 4), np.float32)
    values[0, 0], values[1, 1] = 1e6, np.nan
    fill(film, values)
    present.keep(film, "combined")
    present.draw((0, 0, *SIZE))
    found = seen(region)
    assert (found[0, 0] == 65504).all() and (found[1, 1] == 0).all()


def test_nothing_is_drawn_before_there_is_a_picture(present: PresentPass, region: moderngl.Framebuffer) -> None:
    present.draw((0, 0, 12, 8))
    assert not seen(region).any()


def test_the_framebuffer_and_the_viewport_are_found_again(
    film: Film, present: PresentPass, region: moderngl.Framebuffer
) -> None:
    def bound() -> list[int]:
        values = (ctypes.c_int * 16)()
        get = current_context_loader().function("glGetIntegerv", None, ctypes.c_uint, ctypes.c_void_p)
        found = []
        for name, count in ((0x8CA6, 1), (0x8CAA, 1), (0x0BA2, 4)):
            get(name, values)
            found += values[:count]
        return found

    before = bound()
    assert before[0] == region.glo
    fill(film, noise())
    with saved_state(current_context_loader()):
        present.keep(film, "combined")
        present.draw((1, 1, 2, 2))
    assert bound() == before
