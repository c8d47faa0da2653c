# SPDX-License-Identifier: GPL-3.0-or-later
"""A viewport without a window: what it works on and what it says, with stand-ins for the renderer and for Blender."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import logging
import threading
import time
import weakref
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from addon.scene import CameraData, SceneData
from addon.settings import Settings

bpy = pytest.importorskip("bpy")

pytestmark = pytest.mark.usefixtures("empty_scene")


class StandInPipeline:
    """Each step takes ``seconds``; a picture is all of one number, that of the preparation."""

    grid = None
    warnings = ()

    def __init__(self) -> None:
        self.gpu = SimpleNamespace(renderer="llvmpipe", memory={"film": 2**20})
        self.film = SimpleNamespace(samples=0, is_converged=False)
        self.prepared: list[SceneData] = []
        self.seconds = 0.0
        self.gate = threading.Event()  # work stops before it
        self.gate.set()
        self.error: Exception | None = None

    def want(self, names: set[str]) -> None:
        self.wanted = names

    def prepare(
        self, scene: SceneData, settings: Settings, size: tuple[int, int], *, follows: bool, is_draft: bool
    ) -> Iterator[Any]:
        self.prepared.append(scene)
        self.film.samples = 0
        if self.error is not None:
            raise self.error
        yield SimpleNamespace(text="Voxelizing")

    def sample(self) -> Iterator[Any]:
        time.sleep(self.seconds)
        self.gate.wait(10.0)
        self.film.samples += 1
        yield SimpleNamespace(text="Surfaces")


class StandInSession:
    """What there is to see is set by the tests."""

    def __init__(self, *, is_live: bool, own_context: bool) -> None:
        from addon.host.backend import ContextThread

        self.thread = ContextThread(own=own_context)
        self.settings = Settings(viewport_samples=3)
        self.scene: SceneData | None = None
        self.stand_in = StandInPipeline()
        self.next_scene = SceneData((), (), (), (), None, CameraData(np.eye(4), np.eye(4)))
        self.error: Exception | None = None
        self.knows_scene = self.is_whole_reading = False
        self.before_release: Any = None

    def synchronize(self, depsgraph: Any, resolution: tuple[int, int], **_: Any) -> None:
        self.scene = None
        if self.error is not None:
            raise self.error
        self.scene = self.next_scene
        self.is_whole_reading, self.knows_scene = not self.knows_scene, True

    def forget(self) -> None:
        self.scene, self.knows_scene = None, False

    @contextlib.contextmanager
    def pipeline(self) -> Iterator[Any]:
        yield self.stand_in


class StandInDisplay:
    """One that tells on which thread it ends."""

    ended_on: list[threading.Thread] = []

    def __init__(self) -> None:
        self.inbox = StandInInbox()
        self.drawn: list[tuple[int, ...]] = []

    def draw(self, box: tuple[int, ...]) -> None:
        self.drawn.append(box)

    def __del__(self) -> None:
        self.ended_on.append(threading.current_thread())


class StandInInbox:
    def __init__(self) -> None:
        self.kept = 0

    def begin(self, context: Any) -> None:
        self.context = context

    def keep(self, film: Any, name: str) -> None:
        self.name = name
        self.kept += 1


class Window:
    """A viewport and the region that it is in."""

    def __init__(self) -> None:
        from addon.host.viewport import Viewport

        self.viewport = Viewport()
        self.session: Any = self.viewport.session
        self.depsgraph = SimpleNamespace(scene=bpy.context.scene)
        data = SimpleNamespace(window_matrix=np.eye(4), view_matrix=np.eye(4), view_perspective="PERSP")
        data.window_matrix[2:, 2:] = [[-1, -0.2], [-1, 0]]
        space = SimpleNamespace(use_render_border=False)
        self.context = SimpleNamespace(
            region=SimpleNamespace(width=40, height=20), region_data=data, space_data=space
        )
        self.pixel_size = 1

    @property
    def prepared(self) -> list[SceneData]:
        return self.session.stand_in.prepared

    def change(self, **parts: Any) -> None:
        self.session.next_scene = dataclasses.replace(self.session.next_scene, **parts)
        self.viewport.update(self.context, self.depsgraph)

    def draw(self) -> str:
        return self.viewport.draw(self.context, self.depsgraph, self.pixel_size)

    def finish(self) -> int:
        for draws in range(100):
            if self.viewport.is_done:
                return draws
            self.draw()
        raise AssertionError("never done")


@pytest.fixture(params=[False, True], ids=["shared", "own"])
def window(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Window]:
    from addon.host import viewport

    monkeypatch.setattr(viewport, "Session", StandInSession)
    monkeypatch.setattr(viewport, "SharedDisplay", StandInDisplay)
    monkeypatch.setattr(viewport, "UploadedDisplay", StandInDisplay)
    monkeypatch.setattr(viewport, "viewport_has_own_context", lambda: request.param)
    made = Window()
    yield made
    made.session.thread.end()


def test_from_the_first_draw_to_the_last(window: Window) -> None:
    window.change()
    assert window.draw()
    window.finish()
    assert window.draw().startswith("Sample 3/3 | 1 MiB | ")
    display = window.viewport._display
    assert isinstance(display, StandInDisplay) and display.inbox.kept >= 2 and display.drawn[-1] == (0, 0, 40, 20)
    count = len(window.prepared)
    window.viewport.update(window.context, window.depsgraph)  # something that is not in the picture
    window.draw()
    assert window.viewport.is_done and len(window.prepared) == count


def test_a_moved_view_is_another_picture_of_the_same_scene(window: Window) -> None:
    window.change()
    window.draw()
    window.finish()
    window.context.region_data.view_matrix[0, 3] = 1.0
    window.draw()
    window.finish()
    first, last = window.prepared[0], window.prepared[-1]
    assert last.camera.world_from_camera[0, 3] == -1.0 and last.meshes is first.meshes


@pytest.mark.parametrize("change", ["region", "pixel_size", "settings", "scene"])
def test_whatever_is_seen_begins_anew(window: Window, change: str) -> None:
    window.change()
    window.draw()
    window.finish()
    count = len(window.prepared)
    if change == "region":
        window.context.region.width = 80
    elif change == "pixel_size":
        window.pixel_size = 4
    elif change == "settings":
        window.session.settings = dataclasses.replace(window.session.settings, bounces=1)
    else:
        window.change(film_transparent=True)
    window.draw()
    window.finish()
    assert len(window.prepared) > count


def test_every_pass_that_can_be_chosen_is_an_output(window: Window) -> None:
    from addon.passes.compose import OUTPUTS

    for name, _, _ in Settings.declarations()["viewport_pass"].choices:
        window.session.settings = dataclasses.replace(window.session.settings, viewport_pass=name)
        window.change()
        window.draw()
        window.finish()
        assert window.session.stand_in.wanted <= set(OUTPUTS)
        assert {window.viewport._display.inbox.name} == window.session.stand_in.wanted


def test_errors_are_said_and_not_raised(window: Window) -> None:
    from addon.host.viewport import problems

    window.session.error = ValueError("odd data")
    window.change()
    assert "odd data" in window.draw() and window.viewport.is_done
    assert any("odd data" in text for text in problems())
    window.session.error = None
    window.session.stand_in.error = MemoryError("lower the voxel resolution")
    window.change()
    window.draw()
    window.finish()
    text = window.draw()
    assert text == "lower the voxel resolution"
    count = len(window.prepared)
    assert window.draw() == text and len(window.prepared) == count, "it is not tried again and again"
    window.session.stand_in.error = None
    window.change(film_transparent=True)
    window.draw()
    window.finish()
    assert "3/3" in window.draw()


def test_a_change_that_was_not_read_is_read_later(window: Window) -> None:
    window.change()
    window.change()
    assert not window.session.is_whole_reading
    region_data, window.context.region_data = window.context.region_data, None
    window.change()
    assert window.viewport.problem is not None and window.session.scene is None
    window.context.region_data = region_data
    window.change()
    assert window.viewport.problem is None and window.session.is_whole_reading


@pytest.mark.parametrize("of", ["scene", "render"])
def test_an_error_keeps_no_viewport_alive(window: Window, of: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the garbage collector: it may run on any thread, and never does between two edits."""
    monkeypatch.setattr(logging.getLogger("addon.host.viewport"), "disabled", True)  # pytest keeps what is logged
    failing = window.session if of == "scene" else window.session.stand_in
    failing.error = MemoryError("lower the voxel resolution")
    gone = weakref.ref(window.viewport)
    gc.collect()
    gc.disable()
    try:
        window.change()
        window.draw()
        window.finish()
        assert window.viewport.problem == "lower the voxel resolution"
        failing.error = None  # it has its traceback with it
        del window.viewport
        assert gone() is None
    finally:
        gc.enable()


def test_a_slice_at_work_is_not_forgotten(window: Window) -> None:
    if not window.session.thread.own:
        pytest.skip("without a thread of its own a slice is done when a draw is")
    window.session.stand_in.gate.clear()
    window.change()
    window.draw()
    at_work = window.viewport._slice
    window.session.error = ValueError("odd data")
    window.change()
    assert window.viewport._slice is at_work is not None
    window.session.error = None
    window.change()
    window.draw()
    assert window.viewport._slice is at_work, "there is never a second one"
    window.session.stand_in.gate.set()
    window.finish()


def test_a_viewport_ends_where_blender_draws(window: Window) -> None:
    """At once and on this thread, whatever is still at work on its own."""
    window.session.stand_in.gate.clear()
    if not window.session.thread.own:
        window.session.stand_in.gate.set()
    StandInDisplay.ended_on.clear()
    window.change()
    window.draw()
    gone = weakref.ref(window.viewport)
    del window.viewport
    assert gone() is None and StandInDisplay.ended_on == [threading.current_thread()]
    window.session.stand_in.gate.set()


def test_a_display_that_fails_is_said(window: Window, monkeypatch: pytest.MonkeyPatch) -> None:
    window.change()
    window.draw()
    window.finish()

    def fail(*_: Any) -> None:
        raise RuntimeError("no framebuffer")

    monkeypatch.setattr(StandInDisplay, "draw", fail)
    assert "no framebuffer" in window.draw() and window.viewport.is_done


def test_blender_does_not_wait_for_a_thread_of_ours(window: Window) -> None:
    if not window.session.thread.own:
        pytest.skip("without a thread of its own a step is waited for")
    window.session.stand_in.seconds = 1.0
    window.change()
    start = time.perf_counter()
    window.draw()
    assert time.perf_counter() - start < 0.7 and not window.viewport.is_done


def test_frame_rates() -> None:
    from addon.host.viewport import frame_seconds

    assert frame_seconds(0, "NVIDIA H100") == pytest.approx(1 / 30)
    for renderer in ("llvmpipe (LLVM 15.0.6, 256 bits)", "softpipe", "Mesa Lavapipe", "swrast", ""):
        assert frame_seconds(0, renderer) == pytest.approx(1 / 5)
    assert frame_seconds(60, "llvmpipe") == pytest.approx(1 / 60)
