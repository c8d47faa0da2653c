# SPDX-License-Identifier: GPL-3.0-or-later
"""A device without memory, shaders that do not compile, a context that is lost, an artist who presses Esc: a sentence,
everything let go of, and the next picture the same as if nothing had been.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import moderngl
import numpy as np
import pytest

from addon.gpu.context import GpuContext, GpuUnavailable
from addon.gpu.program import ShaderError
from addon.pipeline import Pipeline
from addon.scene import SceneData
from addon.settings import Settings
from blender_tests.passes import scenes
from blender_tests.passes.run import prepare, sample
from blender_tests.passes.test_film import PASSES, glossy_room
from blender_tests.passes.test_pipeline import with_sun

pytestmark = pytest.mark.once

SIZE = (12, 9)
#: With all that allocates: outputs that split light, light of earlier passes, links, guides; and cones.
KINDS = {
    "rays": scenes.settings(16, bounces=2, gather_interval=2, samples=3),
    "cones": scenes.settings(16, bounces=1, gather_mode="CONES", shadow_mode="CONE", samples=1),
}
MAKERS = ("buffer", "texture", "texture3d", "depth_renderbuffer", "framebuffer", "vertex_array", "sampler")


class Faulty:
    """A moderngl.Context that fails to make one thing: the ``failing``th, counted from 0; None: none.

    ``raises``: as moderngl does where GL gives no name; else as drivers do: an object without storage, and an error
    that is told when somebody asks.
    """

    def __init__(self, mgl: moderngl.Context, failing: int | None, *, raises: bool) -> None:
        self._mgl, self._failing, self._raises = mgl, failing, raises
        self._is_failed = False
        self.made = 0

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._mgl, name)
        return self._counted(found) if name in MAKERS else found

    def _counted(self, make: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any, **named: Any) -> Any:
            number, self.made = self.made, self.made + 1
            if number == self._failing:
                if self._raises:
                    raise moderngl.Error("cannot create it")
                self._is_failed = True
            return make(*arguments, **named)

        return counted

    @property
    def error(self) -> str:
        found, self._is_failed = self._is_failed, False
        return "GL_OUT_OF_MEMORY" if found else self._mgl.error


def scene() -> SceneData:
    return with_sun(glossy_room(), 1.0)


def pictures(ready: Pipeline) -> dict[str, np.ndarray]:
    return {name: ready.film.read(name).copy() for name in ready.film.names}


def render(ready: Pipeline, settings: Settings) -> dict[str, np.ndarray]:
    ready.want(PASSES)
    prepare(ready, scene(), settings, SIZE)
    sample(ready, settings.samples)
    return pictures(ready)


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)


@pytest.fixture(scope="module")
def expected() -> dict[str, dict[str, np.ndarray]]:
    """Pictures of each kind without any fault, made once."""
    return {}


def without_fault(gpu: GpuContext, kind: str, expected: dict[str, Any]) -> dict[str, np.ndarray]:
    if kind not in expected:
        ready = Pipeline(gpu)
        expected[kind] = render(ready, KINDS[kind])
        ready.release()
    return expected[kind]


# Memory ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "raises"), [("rays", False), ("cones", False), ("rays", True)])
def test_each_allocation_that_fails(
    kind: str, raises: bool, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch, expected: dict[str, Any]
) -> None:
    """Of a render, one after the other: an error that names what found no memory, or coarser voxels and a warning.
    Then the same pipeline renders the right picture (tried after some), and in the end nothing is left."""
    right, mgl, before, settings = without_fault(gpu, kind, expected), gpu.mgl, gpu.object_count, KINDS[kind]
    number, is_over, outcomes = 0, False, set()
    while not is_over:
        ready, faulty = Pipeline(gpu), Faulty(mgl, number, raises=raises)
        with monkeypatch.context() as patch:
            patch.setattr(gpu, "mgl", faulty)
            try:
                found = render(ready, settings)
                is_over = faulty.made <= number
                if not is_over:
                    assert any("There is no memory" in text for text in ready.warnings), number
                    outcomes.add("coarser")
                else:
                    assert same(found, right)
            except MemoryError as error:
                assert str(error).startswith("There is no memory for ") and str(error).endswith("."), str(error)
                outcomes.add(str(error))
        if not is_over and number % 8 == 0:
            assert same(render(ready, settings), right), f"after allocation {number} had failed"
        ready.release()
        assert gpu.object_count == before, f"left by allocation {number}"
        number += 1
    assert number > 20 and len(outcomes) > 8


# Shaders --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_each_shader_that_does_not_compile(
    kind: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch, expected: dict[str, Any]
) -> None:
    """An error that names the file and the driver, and the next picture is right."""
    right, settings, before = without_fault(gpu, kind, expected), KINDS[kind], gpu.object_count
    compiled: dict[str, dict[tuple, Any]] = {"_kernels": gpu._kernels, "_programs": gpu._programs}
    used = Used(compiled, monkeypatch, gpu)
    ready = Pipeline(gpu)
    assert same(render(ready, settings), right)
    assert len(used.keys) > 15
    for where, key in sorted(used.keys, key=str):
        others = {other: made for other, made in compiled[where].items() if other != key}
        with monkeypatch.context() as patch:
            patch.setattr(gpu, where, others)
            patch.setattr(gpu, "mgl", Uncompiling(gpu.mgl))
            ready.release()  # all shaders are asked for again
            with pytest.raises(ShaderError) as error:
                render(ready, settings)
        text = str(error.value)
        assert text.startswith(f"Shader passes/{key[0]}.") and gpu.renderer in text.splitlines()[0]
        assert "0:1: a mistake" in text
        assert gpu.object_count == before
    assert same(render(ready, settings), right)
    ready.release()


class Used:
    """Which compiled shaders are asked for."""

    def __init__(self, compiled: dict[str, dict[tuple, Any]], monkeypatch: pytest.MonkeyPatch, gpu: GpuContext) -> None:
        self.keys: set[tuple[str, tuple]] = set()
        for method, where in (("kernel", "_kernels"), ("program", "_programs")):
            # Set back by name it would stay with the instance, and hide what others do to the class.
            monkeypatch.setitem(vars(gpu), method, self._noting(getattr(gpu, method), where))

    def _noting(self, original: Callable[..., Any], where: str) -> Callable[..., Any]:
        def noting(name: str, defines: Any = None, texts: Any = None) -> Any:
            key = name, tuple(sorted((defines or {}).items())), tuple(sorted((texts or {}).items()))
            self.keys.add((where, key))
            return original(name, defines, texts)

        return noting


class Uncompiling:
    """A moderngl.Context that compiles nothing."""

    def __init__(self, mgl: moderngl.Context) -> None:
        self._mgl = mgl

    def __getattr__(self, name: str) -> Any:
        return getattr(self._mgl, name)

    def compute_shader(self, *arguments: Any, **named: Any) -> Any:
        raise moderngl.Error("0:1: a mistake")

    program = compute_shader


# The context ----------------------------------------------------------------------------------------------------


def test_a_driver_that_was_reset(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whenever it is noticed: a sentence, and nothing is kept of what lived in that context."""
    before, settings = gpu.object_count, KINDS["cones"]
    for number in range(settings.samples + 1):  # the preparation, and each sample
        states = iter([0] * number)
        monkeypatch.setattr(gpu, "_reset_status", lambda states=states: next(states, 0x8254))  # an innocent context
        ready = Pipeline(gpu)
        with pytest.raises(GpuUnavailable, match=r"was reset .* render again"):
            render(ready, settings)
        assert gpu.object_count == before
        ready.release()


def test_a_reset_is_not_taken_for_want_of_memory(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "_reset_status", lambda: 0x8254)
    monkeypatch.setattr(gpu, "mgl", Faulty(gpu.mgl, 0, raises=True))
    with pytest.raises(GpuUnavailable, match="was reset"):
        gpu.buffer("anything", size=64)
    monkeypatch.setattr(gpu, "mgl", Uncompiling(gpu.mgl))
    with pytest.raises(GpuUnavailable, match="was reset"):
        gpu.kernel("clear", {"never": "compiled"})


# Interruptions --------------------------------------------------------------------------------------------------


def steps(ready: Pipeline, settings: Settings) -> Iterator[Any]:
    ready.want(PASSES)
    yield from ready.prepare(scene(), settings, SIZE)
    for _ in range(settings.samples):
        yield from ready.sample()


@pytest.mark.parametrize("kind", KINDS)
def test_an_interruption_at_each_step(kind: str, gpu: GpuContext, expected: dict[str, Any]) -> None:
    """The same pipeline renders the right picture afterwards; one that is let go of leaves nothing."""
    right, before, settings = without_fault(gpu, kind, expected), gpu.object_count, KINDS[kind]
    again = Pipeline(gpu)
    count = sum(1 for _ in steps(again, settings))
    assert count > 20
    for number in range(1, count):
        for ready in (again, Pipeline(gpu)):
            taken = steps(ready, settings)
            for _ in range(number):
                next(taken, None)
            taken.close()  # type: ignore[attr-defined]
        ready.release()
        if number % 8 == 0:  # those between are of a pipeline that was just interrupted
            assert same(render(again, settings), right), f"after {number} steps"
    again.release()
    assert gpu.object_count == before
