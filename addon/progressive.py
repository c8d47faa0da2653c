# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture for somebody who works on the scene: soon there, then better and better. Knows nothing of Blender and GL.

The work of a pipeline is done in slices of bounded time. A new target (another view, an edited scene) is shown first by
one pass, the draft, at a reduced resolution that fits into the time of one frame; where only the view has moved it
takes over light from the draft before. When nothing newer has come then, passes at full resolution follow until there
are as many as the settings ask for: the picture that F12 makes.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .scene import SceneData
    from .settings import Settings

#: Reductions of a picture's sides while the scene or the view changes.
DIVISORS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
#: The reduction when nothing is known yet of how long a pass takes.
_FIRST_DIVISOR = 4.0
#: Passes before a picture takes the place of a draft of its size: a draft that took over light has less noise than one.
_PASSES_AFTER_DRAFT = 4
#: A smaller reduction is taken only when it would need less than this share of the time, so that the resolution rests.
_RESERVE = 0.8


#: Settings that change nothing in a pass.
_OF_NO_MATTER = ("samples", "viewport_samples", "viewport_fps", "viewport_statistics", "time_limit")


@dataclass(frozen=True, eq=False)
class Target:
    """What is to be shown. Two targets are the same only when they are one object."""

    scene: SceneData
    settings: Settings
    size: tuple[int, int]  # pixels, of the finished picture
    output: str = "combined"  # of the film: what is shown

    def sees_the_same(self, other: Target | None) -> bool:
        """Whether nothing but the view and the size differs."""
        if other is None or self.settings != other.settings or self.output != other.output:
            return False
        parts = ("meshes", "instances", "materials", "lights", "world")
        return all(getattr(self.scene, name) is getattr(other.scene, name) for name in parts)

    def continues(self, other: Target | None) -> bool:
        """Whether its picture is that of ``other``, with more or fewer passes, or other time for them."""
        if other is None or self.size != other.size or self.output != other.output:
            return False
        if self.output == "sample_count" and self.settings.samples != other.settings.samples:
            return False  # which is a share of them
        free = {name: getattr(other.settings, name) for name in _OF_NO_MATTER}
        if dataclasses.replace(self.settings, **free) != other.settings:
            return False
        pairs = [(getattr(self.scene, f.name), getattr(other.scene, f.name)) for f in dataclasses.fields(self.scene)]
        return all(a is b or (isinstance(a, (bool, float)) and a == b) for a, b in pairs)


class MotionResolution:
    """The resolution at which a frame takes no longer than it may, from what frames took before.

    Each frame has a cost that does not depend on its size, so each resolution is measured by itself. One that was not
    tried yet is taken to cost as much for each pixel as that of the last frame, which is never too little.
    """

    def __init__(self) -> None:
        self._divisor = _FIRST_DIVISOR
        self._last: dict[float, float] = {}  # divisor -> seconds for each pixel of its last frame
        self._costs: dict[float, float] = {}  # the same, of the quicker of its last two frames

    def measured(self, pixels: int, seconds: float) -> None:
        """A frame at the divisor given last took so long. One alone may have been held up, by a compiler for one."""
        cost = seconds / max(pixels, 1)
        self._costs[self._divisor] = min(cost, self._last.get(self._divisor, cost))
        self._last[self._divisor] = cost

    def divisor(self, size: tuple[int, int], seconds: float) -> float:
        """The smallest of :data:`DIVISORS` for a frame of ``seconds``; the greatest where none will do."""
        cost = self._costs.get(self._divisor)
        if cost is None:
            return self._divisor
        for divisor in DIVISORS:
            width, height = reduced(size, divisor)
            expected = width * height * min(cost, self._costs.get(divisor, cost))
            if expected <= seconds * (1.0 if divisor >= self._divisor else _RESERVE):
                break
        self._divisor = divisor
        return divisor


def reduced(size: tuple[int, int], divisor: float) -> tuple[int, int]:
    """Pixels of a picture at a reduced resolution."""
    return max(1, round(size[0] / divisor)), max(1, round(size[1] / divisor))


@dataclass(frozen=True)
class Status:
    """How far a picture is."""

    text: str
    is_done: bool


class Progressive:
    """Drives one pipeline, slice by slice."""

    def __init__(self, pipeline: Any, clock: Callable[[], float] = time.perf_counter) -> None:
        self.pipeline = pipeline
        self.resolution = MotionResolution()
        self.shown_samples = 0  # of the last picture that was finished
        self._clock = clock
        self._target: Target | None = None  # what the pipeline was prepared for
        self._size = (0, 0)  # at which
        self._steps: Generator[Any, None, None] | None = None
        self._text = ""
        self._is_sampling = False  # or else preparing
        self._is_draft = False
        self._has_pass = False  # the film holds a pass over the target, of the draft or of the picture
        self._is_shown = False  # there was a draft of the target
        self._is_motion = False  # only the view has changed since the last target
        self._hidden_passes = 0  # that are not shown, as the draft is better still
        self._started = 0.0  # when work on the target began
        self._spent = 0.0  # seconds on the draft, as far as they follow from its resolution

    def work(self, target: Target, seconds: float) -> bool:
        """Works for about ``seconds``, less when all is done. Returns whether there is a new picture in the film.

        Ends early after the first pass over a target, so that it is seen at once. A target of which nothing was shown
        yet is not left for a newer one: else a steady flow of edits would show nothing. Raises what the pipeline
        raises; the next call then begins again.
        """
        start = now = self._clock()
        is_new = False
        try:
            while now - start < seconds and self._next_steps(target, seconds):
                is_first = not self._has_pass
                if self._step():
                    is_new = True
                before, now = now, self._clock()
                self._spent += now - before
                if is_first and self._has_pass:
                    if self._is_draft:
                        self.resolution.measured(self._size[0] * self._size[1], self._spent)
                    break
        except BaseException:
            self._steps = self._target = None
            raise
        return is_new

    def stop(self) -> None:
        """Ends what is half done, which frees what it had for itself. Called where the pipeline's context is current.

        The next call of :meth:`work` begins anew.
        """
        steps, self._steps, self._target = self._steps, None, None
        if steps is not None:
            steps.close()

    @property
    def is_between_steps(self) -> bool:
        """Whether the pipeline is not in the middle of something."""
        return self._steps is None or self._is_sampling

    @property
    def output(self) -> str:
        """The output of the film that the target at work asks for."""
        return self._target.output if self._target is not None else "combined"

    def status(self, target: Target) -> Status:
        """How far the picture of ``target`` is."""
        samples, wanted = self.shown_samples, target.settings.samples
        if self._is_done(target):
            return Status(f"Sample {samples}/{wanted}", True)
        if not self._is_shown:
            return Status(self._text, False)
        return Status(f"Sample {samples}/{wanted}" if self._has_pass else "Sample 1", False)

    def _is_done(self, target: Target) -> bool:
        if target is not self._target or self._is_draft or not self._has_pass or self._steps is not None:
            return False
        film, limit = self.pipeline.film, target.settings.time_limit
        is_late = 0.0 < limit <= self._clock() - self._started
        return film.samples >= target.settings.samples or film.is_converged or is_late

    def _next_steps(self, target: Target, seconds: float) -> bool:
        """Sees to it that there is something to do. Returns False when there is nothing left."""
        if target is not self._target and target.continues(self._target):
            self._target = target
        if target is not self._target and (self._target is None or self._is_shown):
            self._is_motion = target.sees_the_same(self._target)
            self._is_shown = False
            self._prepare(target, reduced(target.size, self.resolution.divisor(target.size, seconds)), is_draft=True)
        elif self._steps is not None:
            pass
        elif self._is_draft and self._has_pass:
            is_sharp = self._size == target.size
            self._hidden_passes = min(_PASSES_AFTER_DRAFT, target.settings.samples) - 1 if is_sharp else 0
            self._prepare(target, target.size, is_draft=False)
        elif not self._is_done(target):
            if not self._is_motion:
                self._spent = 0.0  # what an edit takes before has nothing to do with the resolution
            self._is_sampling = True
            self._steps = self.pipeline.sample()
        else:
            return False
        return True

    def _prepare(self, target: Target, size: tuple[int, int], *, is_draft: bool) -> None:
        self._target, self._size, self._is_draft, self._spent = target, size, is_draft, 0.0
        self._has_pass = self._is_sampling = False
        if is_draft:
            self._started = self._clock()
        settings = dataclasses.replace(target.settings, reuse_frames=True) if is_draft else target.settings
        self.pipeline.want({target.output})
        follows = is_draft and self._is_motion
        self._steps = self.pipeline.prepare(target.scene, settings, size, follows=follows, is_draft=is_draft)

    def _step(self) -> bool:
        """Does one piece of work. Returns whether there is a new picture to be shown."""
        assert self._steps is not None
        try:
            self._text = next(self._steps).text
            return False
        except StopIteration:
            self._steps = None
        if not self._is_sampling:
            return False
        self._has_pass = True
        samples = self.pipeline.film.samples
        if not self._is_draft and samples <= self._hidden_passes and not self.pipeline.film.is_converged:
            return False
        self._is_shown, self.shown_samples = True, samples
        return True
