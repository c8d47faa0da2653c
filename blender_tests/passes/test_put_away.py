# SPDX-License-Identifier: GPL-3.0-or-later
"""Voxels and light that were put away: nothing stays on the GPU, and what comes back has the same bits."""

from __future__ import annotations

import ctypes
import dataclasses
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from addon.gpu import loader
from addon.gpu.context import GpuContext
from addon.pipeline import Pipeline
from addon.scene import LightKind, SceneData
from addon.settings import Settings
from blender_tests.passes import scenes
from blender_tests.passes.run import prepare, sample
from blender_tests.passes.test_edits import (
    EDITS,
    SETTINGS,
    SIZE,
    assert_same,
    bits,
    fresh,
    placed,
    repainted,
    room,
    textured,
)

#: More than is there.
MUCH = 1 << 40

#: Passes that make voxels and light.
VOXEL_PASSES = {"materials", "geometry", "emitters", "voxelize", "world", "link", "inject", "bounce", "guide"}


@pytest.fixture
def shared(gpu: GpuContext) -> Iterator[GpuContext]:
    """As where Blender's context is current."""
    made = GpuContext.attach()
    yield made
    made.release()


def ready(gpu: GpuContext, made: SceneData, settings: Settings = SETTINGS) -> Pipeline:
    found = Pipeline(gpu, is_live=True)
    prepare(found, made, settings, SIZE)
    sample(found, 1)
    return found


def in_use() -> dict[str, int]:
    """How many of the first names of objects are taken, as GL says. Programs that are gone live on while bound."""
    source, found = loader.current_context_loader(), {}
    for kind in ("Buffer", "Texture", "VertexArray", "Sampler", "Framebuffer", "Renderbuffer"):
        asked = source.function(f"glIs{kind}", ctypes.c_ubyte, ctypes.c_uint)
        found[kind] = sum(bool(asked(name)) for name in range(1, 1 << 16))
    return found


def open_room(**more: Any) -> SceneData:
    """With a picture, a sky with a sun in it, a lamp, and all that is glossy or smooth."""
    lamp = scenes.light(LightKind.POINT, 3.0, (0.9, -1.2, 0.7), radius=0.1)
    return room(sheet=textured(), world=scenes.world((0.4, 0.5, 0.7)), lights=(lamp,), **more)


VARIANTS: dict[str, Callable[[], SceneData]] = {
    "picture and sky": open_room,
    "transparent": lambda: room(ball=scenes.principled(0.8, Alpha=0.4)),
    "emitter": lambda: room(sheet=scenes.emission(3.0), lights=()),
}


@pytest.mark.parametrize("gather", ["RAYS", "CONES"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_same_bits_without_doing_them_again(variant: str, gather: str, shared: GpuContext) -> None:
    made, settings = VARIANTS[variant](), SETTINGS.with_values(gather_mode=gather)
    before = in_use()
    pipeline = ready(shared, made, settings)
    wanted, memory = bits(pipeline), dict(shared.memory)
    pipeline.picture.release()
    assert pipeline.put_away(MUCH)
    assert (shared.object_count, shared.program_count, shared.memory) == (0, 0, {})
    before["Buffer"] -= 1  # that of the context
    assert in_use() == before
    pipeline.put_back()
    prepare(pipeline, made, settings, SIZE)
    assert not VOXEL_PASSES & set(shared.times)
    sample(pipeline, 1)
    assert_same(bits(pipeline), wanted)
    assert shared.memory == memory
    pipeline.release()


@pytest.mark.parametrize("edit", ["moved", "an instance"])
def test_edits_meanwhile_leave_the_bits_of_a_fresh_start(edit: str, gpu: GpuContext, shared: GpuContext) -> None:
    made = open_room()
    moved = placed(made, EDITS[edit])
    pipeline = ready(shared, made)
    assert pipeline.put_away(MUCH)
    pipeline.put_back()
    prepare(pipeline, moved, SETTINGS, SIZE)
    assert pipeline.redone["cells"] > 0
    sample(pipeline, 1)
    assert_same(bits(pipeline), fresh(gpu, moved))
    pipeline.release()


def test_everything_may_change_meanwhile(gpu: GpuContext, shared: GpuContext) -> None:
    made = open_room()
    lights = (dataclasses.replace(made.lights[0], position=(0.2, 0.3, 0.8)),)
    changed = dataclasses.replace(repainted(made, {0: scenes.diffuse((0.1, 0.2, 0.8))}), lights=lights, world=None)
    pipeline = ready(shared, made)
    for settings in (SETTINGS, SETTINGS.with_values(bounces=1, voxel_resolution=24)):
        assert pipeline.put_away(MUCH)
        pipeline.put_back()
        prepare(pipeline, changed, settings, SIZE)
        sample(pipeline, 1)
        assert_same(bits(pipeline), fresh(gpu, changed, settings))
    pipeline.release()


def test_what_is_half_done_is_done_again(gpu: GpuContext, shared: GpuContext) -> None:
    made = open_room()
    wanted = fresh(gpu, made)
    for count in (2, 4, 8, 12, 16):
        pipeline = Pipeline(shared, is_live=True)
        steps = pipeline.prepare(made, SETTINGS, SIZE)
        for _ in range(count):
            next(steps)
        steps.close()
        if pipeline.put_away(MUCH):
            pipeline.put_back()
        else:
            pipeline.release()
        prepare(pipeline, made, SETTINGS, SIZE)
        sample(pipeline, 1)
        assert_same(bits(pipeline), wanted)
        pipeline.release()


def test_what_is_too_much_is_not_kept(shared: GpuContext) -> None:
    pipeline = ready(shared, room())
    pipeline.picture.release()
    pipeline.voxel_light.put_away()
    size = sum(shared.memory.values())
    assert not pipeline.put_away(size - 1)
    assert shared.object_count > 0, "the caller releases it"
    assert pipeline.put_away(size)
    assert not Pipeline(shared, is_live=True).put_away(MUCH), "there is nothing"


def test_from_one_thread_to_another() -> None:
    """A context of our own ends, and another begins elsewhere."""
    made, found = room(), []

    def first() -> Pipeline:
        pipeline = ready(GpuContext.standalone(), made)
        found.append(bits(pipeline))
        assert pipeline.put_away(MUCH)
        loader.leave_thread()
        return pipeline

    def second(pipeline: Pipeline) -> None:
        pipeline.put_back()
        prepare(pipeline, made, SETTINGS, SIZE)
        assert not VOXEL_PASSES & set(pipeline.gpu.times)
        sample(pipeline, 1)
        found.append(bits(pipeline))
        pipeline.release()
        pipeline.gpu.release()
        loader.leave_thread()

    pipelines: list[Pipeline] = []
    for work in (lambda: pipelines.append(first()), lambda: second(pipelines[0])):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join(60.0)
    assert len(found) == 2
    assert_same(*found)


def test_no_memory_when_it_comes_back(shared: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    pipeline = ready(shared, room())
    assert pipeline.put_away(MUCH)
    make, left = GpuContext.make, iter(range(5))

    def failing(self: GpuContext, name: str, size: int, work: Any) -> Any:
        if next(left, None) is None:
            raise MemoryError(name)
        return make(self, name, size, work)

    monkeypatch.setattr(GpuContext, "make", failing)
    with pytest.raises(MemoryError):
        pipeline.put_back()
    monkeypatch.undo()
    shared.free_since(frozenset())
    assert np.isfinite(ready(shared, room()).film.read("combined")).all()
