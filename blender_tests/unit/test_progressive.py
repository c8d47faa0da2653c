# SPDX-License-Identifier: GPL-3.0-or-later
"""What a viewport works on, and in which order, with a pipeline that only counts."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from addon.progressive import DIVISORS, MotionResolution, Progressive, Target, reduced
from addon.scene import CameraData, SceneData
from addon.settings import Settings

SIZE = (120, 60)
STEP = 0.01  # seconds of the clock for each step


class Counting:
    """A pipeline of which all steps take as long, or as long as the picture is large."""

    def __init__(self, *, preparation: int = 3, seconds_per_pixel: float = 0.0) -> None:
        self.now = 0.0
        self.film = SimpleNamespace(samples=0, is_converged=False)
        self.log: list[Any] = []
        self.drafts: list[tuple[bool, bool]] = []  # whether light is taken over, and whether there is some
        self.fails = self.at_work = False
        self.enough = 1000
        self._preparation = preparation
        self._seconds_per_pixel = seconds_per_pixel
        self._size = (0, 0)

    def clock(self) -> float:
        return self.now

    def _steps(self, count: int, text: str) -> Iterator[Any]:
        self.at_work = True
        try:
            for _ in range(count):
                self.now += STEP
                if self.fails:
                    raise RuntimeError("no more memory")
                yield SimpleNamespace(text=text)
        finally:
            self.at_work = False

    def want(self, names: set[str]) -> None:
        self.wanted = names

    def prepare(
        self, scene: SceneData, settings: Settings, size: tuple[int, int], *, follows: bool, is_draft: bool
    ) -> Iterator[Any]:
        assert is_draft == settings.reuse_frames
        self.log.append((scene, size))
        self.drafts.append((is_draft, follows))
        yield from self._steps(self._preparation, "Voxelizing")
        self.film.samples, self.film.is_converged, self._size = 0, False, size

    def sample(self) -> Iterator[Any]:
        yield from self._steps(2, "Surfaces")
        self.now += self._seconds_per_pixel * self._size[0] * self._size[1]
        self.film.samples += 1
        self.film.is_converged = self.film.samples >= self.enough
        self.log.append("pass")


def scene(**more: Any) -> SceneData:
    parts: dict[str, Any] = dict.fromkeys(("meshes", "instances", "materials", "lights"), ()) | {"world": None}
    return SceneData(**(parts | {"camera": CameraData(np.eye(4), np.eye(4))} | more))


def target(samples: int = 3, of: SceneData | None = None) -> Target:
    return Target(of or scene(), Settings(samples=samples), SIZE)


def progressive(pipeline: Counting) -> Progressive:
    return Progressive(pipeline, pipeline.clock)


def finish(work: Progressive, what: Target, seconds: float = 1.0) -> int:
    """Slices until nothing is left to do."""
    for slices in range(1000):
        if work.status(what).is_done:
            return slices
        work.work(what, seconds)
    raise AssertionError("never done")


def test_a_first_picture_comes_at_low_resolution_and_then_all_at_full() -> None:
    pipeline = Counting()
    work, what = progressive(pipeline), target()
    assert work.work(what, 1.0) and work.shown_samples == 1, "one slice shows something"
    finish(work, what)
    (_, first), *rest = pipeline.log
    assert first == reduced(SIZE, 4.0)
    assert rest == ["pass", (what.scene, SIZE), "pass", "pass", "pass"]
    assert work.status(what).text == "Sample 3/3"
    assert not work.work(what, 1.0) and pipeline.log[-4:] == rest[-4:], "and then nothing is done any more"


def test_an_output_that_is_shown_is_asked_for() -> None:
    pipeline = Counting()
    work, what = progressive(pipeline), Target(scene(), Settings(samples=1), SIZE, "normal")
    finish(work, what)
    assert pipeline.wanted == {"normal"} and work.output == "normal"
    other = Target(scene(materials=("paint",)), Settings(samples=1), SIZE, "combined")
    work.work(other, STEP)
    assert not work.work(what, STEP) and work.output == "combined", "the film has what was begun"


def moved(of: Target, by: float) -> Target:
    camera = CameraData(np.eye(4), np.eye(4) * (1 + by))
    return dataclasses.replace(of, scene=dataclasses.replace(of.scene, camera=camera))


def test_drafts_of_a_moving_view_take_over_light() -> None:
    pipeline = Counting()
    work, first = progressive(pipeline), target()
    for index in range(3):
        work.work(moved(first, index), 1.0)
    work.work(target(of=scene(materials=("paint",))), 1.0)
    assert pipeline.drafts == [(True, False), (True, True), (True, True), (True, False)]
    what = moved(first, 9)
    finish(work, what)
    assert pipeline.drafts[-1] == (False, False), "the picture itself takes over nothing"


def test_a_sharp_draft_is_shown_until_the_picture_is_better() -> None:
    pipeline = Counting()
    work, first = progressive(pipeline), target(samples=6)
    work.work(first, 1.0)
    work.work(moved(first, 1), 1.0)  # there is time for more
    what = moved(first, 2)
    work.work(what, 1.0)
    assert pipeline.log[-2] == (what.scene, SIZE), "the draft is sharp"
    shown = []
    while not work.status(what).is_done:
        if work.work(what, STEP):
            shown.append(work.shown_samples)
    assert shown == [4, 5, 6]


def test_slices_end_in_time_and_go_on_where_they_ended() -> None:
    pipeline = Counting(preparation=50)
    work, what = progressive(pipeline), target(samples=1)
    while not work.status(what).is_done:
        before = pipeline.now
        work.work(what, 5 * STEP)
        assert pipeline.now - before <= 6 * STEP
    assert [entry for entry in pipeline.log if entry != "pass"] == [
        (what.scene, reduced(SIZE, 4.0)), (what.scene, SIZE)
    ], "each resolution is prepared once"  # fmt: skip


def test_a_steady_flow_of_edits_is_shown() -> None:
    pipeline = Counting(preparation=20)
    work = progressive(pipeline)
    pictures = sum(work.work(target(of=scene(materials=(index,))), 4 * STEP) for index in range(40))
    assert pictures >= 5


def test_a_newer_target_ends_refinement_at_once() -> None:
    pipeline = Counting()
    work, old, new = progressive(pipeline), target(), target(of=scene(lights=("lamp",)))
    work.work(old, 1.0)
    work.work(old, STEP)  # begins at full resolution
    assert pipeline.log[-1] == (old.scene, SIZE)
    assert work.work(new, 1.0)
    assert pipeline.log[-2][0] is new.scene and pipeline.log[-1] == "pass"
    assert not work.status(old).is_done


def test_what_failed_is_begun_anew() -> None:
    pipeline = Counting()
    work, what = progressive(pipeline), target()
    pipeline.fails = True
    with pytest.raises(RuntimeError, match="memory"):
        work.work(what, 1.0)
    pipeline.fails = False
    assert work.work(what, 1.0)


def test_what_is_stopped_is_ended_there_and_begun_anew() -> None:
    pipeline = Counting()
    work, what = progressive(pipeline), target()
    work.stop()
    work.work(what, STEP)
    assert pipeline.at_work
    steps = work._steps  # as an error's traceback may hold it
    work.stop()
    assert not pipeline.at_work and steps is not None
    work.stop()
    assert not work.status(what).is_done
    finish(work, what)
    assert pipeline.film.samples == 3


def test_a_film_below_its_noise_threshold_is_done() -> None:
    pipeline = Counting()
    work, what = progressive(pipeline), target(samples=100)
    pipeline.enough = 3
    finish(work, what)
    assert pipeline.film.samples == 3


@pytest.mark.parametrize("seconds_per_pixel", [1e-6, 1e-5, 3e-5, 1e-4])
def test_a_moving_view_reaches_its_frame_rate_within_ten_frames(seconds_per_pixel: float) -> None:
    pipeline = Counting(preparation=1, seconds_per_pixel=seconds_per_pixel)
    work, seconds = progressive(pipeline), 0.1
    base = scene()
    took = []
    for frame in range(30):
        camera = CameraData(np.eye(4), np.eye(4) * (1 + frame))
        before = pipeline.now
        work.work(Target(SceneData(**(vars(base) | {"camera": camera})), Settings(), SIZE), seconds)
        took.append(pipeline.now - before)
    size = pipeline.log[-2][1]
    assert max(took[10:]) <= seconds or size == reduced(SIZE, DIVISORS[-1])
    assert len({entry[1] for entry in pipeline.log[20:] if entry != "pass"}) == 1, "the resolution rests"


def test_resolution_is_not_lower_than_need_be() -> None:
    resolution = MotionResolution()
    resolution.measured(1000, 0.01)
    assert resolution.divisor((100, 100), 0.2) == 1.0
    resolution.measured(10000, 1.0)
    assert resolution.divisor((100, 100), 0.3) == 2.0, "a quarter of the pixels is in time, a half is not"


def test_one_slow_frame_does_not_count_for_much() -> None:
    resolution = MotionResolution()
    resolution.measured(1000, 0.01)
    assert resolution.divisor((100, 100), 0.13) == 1.0
    resolution.measured(10000, 0.1)
    resolution.measured(10000, 5.0)
    assert resolution.divisor((100, 100), 0.13) == 1.0
    resolution.measured(10000, 5.0)
    assert resolution.divisor((100, 100), 0.13) > 1.0


def test_what_an_edit_takes_does_not_lower_the_resolution() -> None:
    pipeline = Counting(preparation=500)  # five seconds
    work = progressive(pipeline)
    for index in range(6):
        finish(work, target(of=scene(materials=(index,))), seconds=0.1)
    prepared = [entry[1] for entry in pipeline.log[-6:] if entry != "pass"]
    assert prepared == [SIZE, SIZE], "passes are quick, so that drafts are sharp"


def test_other_numbers_of_passes_go_on_with_the_picture() -> None:
    """More or fewer of them, another rate, a limit in time: what is there already stays."""
    pipeline = Counting()
    drawing, first = progressive(pipeline), target(3)
    finish(drawing, first)
    prepared = sum(isinstance(entry, tuple) for entry in pipeline.log)
    more = dataclasses.replace(
        first, settings=dataclasses.replace(first.settings, samples=6, viewport_fps=7, viewport_statistics=True)
    )
    assert not drawing.status(more).is_done
    finish(drawing, more)
    assert pipeline.film.samples == 6 and drawing.status(more).text == "Sample 6/6"
    fewer = dataclasses.replace(first, settings=dataclasses.replace(first.settings, samples=2))
    assert not drawing.work(fewer, 1.0) and drawing.status(fewer).is_done
    assert sum(isinstance(entry, tuple) for entry in pipeline.log) == prepared
    finish(drawing, dataclasses.replace(first, settings=dataclasses.replace(first.settings, rays=5)))
    assert sum(isinstance(entry, tuple) for entry in pipeline.log) > prepared, "more rays are another picture"


def test_time_has_a_limit() -> None:
    pipeline = Counting()
    drawing = progressive(pipeline)
    limited = Target(scene(), Settings(samples=1000, time_limit=1.0), SIZE)
    finish(drawing, limited)
    assert 5 < pipeline.film.samples < 100 and 1.0 <= pipeline.now < 1.2
