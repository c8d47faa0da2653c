# SPDX-License-Identifier: GPL-3.0-or-later
"""What a viewport leaves to the next one, and what that one takes: with stand-ins for the context and the pipeline."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from blender_tests.renders.test_abandoned import StandInContext  # noqa: E402


class StandInPipeline:
    """One that can be put away, unless ``error`` says why not."""

    error: Exception | None = None
    error_when_back: Exception | None = None
    fits = True

    def __init__(self, context: StandInContext, *, is_live: bool) -> None:
        self.context = context
        context.note("made")

    def put_away(self, most: int) -> bool:
        if self.error is not None:
            raise self.error
        self.context.note("put away")
        return self.fits

    def put_back(self) -> None:
        if self.error_when_back is not None:
            raise self.error_when_back
        self.context.note("put back")

    def release(self) -> None:
        self.context.note("released")


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch, empty_scene: Any) -> Iterator[StandInContext]:
    from addon import pipeline
    from addon.gpu.context import GpuContext
    from addon.host import abandoned, legacy, session
    from addon.settings import Settings

    made = StandInContext()
    monkeypatch.setattr(GpuContext, "standalone", lambda: made)
    monkeypatch.setattr(GpuContext, "attach", lambda: made)
    monkeypatch.setattr(pipeline, "Pipeline", StandInPipeline)
    monkeypatch.setattr(session, "backend_in_use", lambda: ("OPENGL", None))
    monkeypatch.setattr(session, "settings_from_scene", lambda *_, **__: Settings())
    monkeypatch.setattr(abandoned, "_waiting", [])
    legacy.forget()
    empty_scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    empty_scene.collection.objects.link(empty_scene.camera)
    yield made
    legacy.forget()


def session(*, own: bool = False, is_live: bool = True, draws: bool = True) -> Any:
    """One that has read the scene and, if it ``draws``, has a pipeline."""
    from addon.host.session import Session

    made = Session(is_live=is_live, own_context=own)
    bpy.context.view_layer.update()
    made.synchronize(bpy.context.evaluated_depsgraph_get(), (8, 8))
    if draws:
        made.thread.run(lambda: drawn(made))
    return made


def drawn(made: Any) -> bool:
    with made.pipeline():
        return True


@pytest.mark.parametrize("own", [False, True])
def test_the_next_viewport_goes_on(own: bool, context: StandInContext) -> None:
    first = session(own=own)
    scene = first.scene
    del first
    while context.log[-1] != "put away":
        threading.Event().wait(0.01)  # on a thread of its own
    second = session(own=own)
    assert context.log == ["made", "put away", "put back"]
    assert second.scene is scene, "which says the same"
    assert len(context.threads) == 1 + own
    del second


def test_others_go_on_from_nothing(context: StandInContext) -> None:
    """Renders neither leave nor take; two viewports do not take the same."""
    render = session(is_live=False)
    del render
    assert context.log == ["made", "released", "context"]
    viewport = session()
    del viewport
    render, second, third = session(is_live=False), session(), session()
    assert context.log[3:] == ["made", "put away", "made", "put back", "made"]
    del render, second, third


def test_a_large_scene_is_not_kept(context: StandInContext, monkeypatch: pytest.MonkeyPatch) -> None:
    from addon.host import legacy

    bpy.ops.mesh.primitive_cube_add()
    first = session()
    size = legacy.held_bytes(first.scene)
    assert sum(array.nbytes for array in vars(first.scene.meshes[0]).values() if hasattr(array, "nbytes")) <= size < 1e5
    assert legacy.held_bytes((first.scene, first.scene.meshes)) == size, "each counts once"
    monkeypatch.setattr(legacy, "MOST_BYTES", size - 1)
    del first
    assert context.log == ["made", "released", "context"] and legacy.inherit() is None


@pytest.mark.parametrize("why", ["too much", "an error"])
def test_what_cannot_be_kept_is_released(why: str, context: StandInContext, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StandInPipeline, "fits", why != "too much")
    monkeypatch.setattr(StandInPipeline, "error", RuntimeError("reset") if why == "an error" else None)
    first = session()
    del first
    assert context.log[-2:] == ["released", "context"]
    second = session()
    assert context.log[-1] == "made"
    del second


def test_what_does_not_come_back_is_made_anew(context: StandInContext, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StandInPipeline, "error_when_back", MemoryError())
    first = session()
    del first
    second = session()
    assert context.log == ["made", "put away", "context", "made"]
    del second


def test_what_comes_too_late_is_released(context: StandInContext) -> None:
    """Blender's context was not current when the viewport went, and another one is there by now."""
    from addon.host.abandoned import free_abandoned

    first = session()
    context.is_current = False
    del first
    second = session(draws=False)
    assert second._inherit() is False
    context.is_current = True
    free_abandoned()
    assert context.log == ["made", "released", "context"]
    del second


@pytest.mark.parametrize("when", ["put away", "waiting"])
def test_another_file_forgets_it(when: str, context: StandInContext) -> None:
    from addon.host import engine
    from addon.host.abandoned import free_abandoned

    first = session()
    context.is_current = when != "waiting"
    del first
    engine._on_load()
    context.is_current = True
    free_abandoned()
    second = session()
    assert context.log == ["made", *(["put away"] if when == "put away" else ["released", "context"]), "made"]
    del second


def test_a_scene_that_could_not_be_read_leaves_nothing(context: StandInContext) -> None:
    first = session()
    first.forget()
    del first
    second = session()
    assert context.log == ["made", "released", "context", "made"]
    del second


def test_a_change_that_nobody_reports_is_seen(empty_scene: Any) -> None:
    """While no viewport is there nobody hears what depsgraphs report: everything is read, and compared."""
    from addon.host.extract.scene import SceneReader
    from addon.scene import CameraData

    camera = SimpleNamespace(spec=CameraData)  # any: it is passed on
    things = []
    for name in ("changed", "same"):
        bpy.ops.mesh.primitive_cube_add()
        thing = bpy.context.object
        thing.name = thing.data.name = name
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5,):
            material.use_nodes = True
        thing.data.materials.append(material)
        things.append(thing)
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
    empty_scene.collection.objects.link(lamp)
    reader = SceneReader()

    def read() -> Any:
        return reader.read(bpy.context.evaluated_depsgraph_get(), (8, 8), camera=camera)  # type: ignore[arg-type]

    first = read()
    reader.read_all_again()
    assert read() is first
    things[0].data.vertices[0].co.z += 0.5
    things[0].data.update()
    things[1].active_material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.125
    lamp.data.energy *= 2
    bpy.context.view_layer.update()  # what it reports is gone when this returns
    bpy.context.view_layer.update()
    reader.read_all_again()
    found = read()
    kept = [a is b for a, b in zip(found.meshes, first.meshes, strict=True)]
    assert sorted(kept) == [False, True]
    assert [a is b for a, b in zip(found.materials, first.materials, strict=True)] == [True, False]
    assert found.lights[0] is not first.lights[0] and found.world is first.world
