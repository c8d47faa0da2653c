# SPDX-License-Identifier: GPL-3.0-or-later
"""A rendered viewport: what changed -> pipeline -> picture. One for each engine object that draws one.

The same on all backends but for two things: where slices of work run (the session's thread), and how pictures reach the
region (display.py).
"""

from __future__ import annotations

import dataclasses
import functools
import logging
import time
import weakref
from concurrent.futures import Future, wait
from typing import Any

from ..gpu.loader import is_software
from ..progressive import Progressive, Status, Target
from . import rays, session
from .backend import viewport_has_own_context
from .display import Display, Inbox, SharedDisplay, UploadedDisplay
from .session import Session

#: Frames per second that are aimed at while something moves, where the setting says 0.
FPS_GPU, FPS_CPU = 30, 5

#: Viewports there are, for panels and tests.
viewports: weakref.WeakSet[Viewport] = weakref.WeakSet()

_log = logging.getLogger(__name__)


def problems() -> list[str]:
    """Why viewports show no picture, each sentence once."""
    return list(dict.fromkeys(viewport.problem for viewport in viewports if viewport.problem))


def warnings() -> list[str]:
    """What viewports cannot show as asked, by name, each once."""
    return list(dict.fromkeys(text for viewport in viewports for text in viewport.session.warnings))


def frame_seconds(fps: int, renderer: str) -> float:
    """How long one frame may take while something moves. ``fps``: as the setting has it."""
    return 1.0 / (fps or (FPS_CPU if not renderer or is_software(renderer) else FPS_GPU))


class Slices:
    """What slices of work need and leave behind, and nothing else: the last may end after its viewport has gone, and
    then all that it holds ends on the thread of the pipeline.
    """

    def __init__(self, session: Session, inbox: Inbox) -> None:
        self.progressive: Progressive | None = None
        self.status = Status("", False)
        self.reported: Target | None = None  # whose status that is
        self.facts = ""
        self.renderer = ""
        self.asked: tuple[float, float] | None = None  # whose rays are to be shown: place in the picture, 0..1
        self.rays: Any = None
        self._rays_of: tuple[Any, ...] = ()
        self._session = session
        self._inbox = inbox

    def run(self, target: Target, seconds: float) -> None:
        """One slice of work, in the context of the pipeline."""
        with self._session.pipeline() as pipeline:
            if self.progressive is None or self.progressive.pipeline is not pipeline:
                self.progressive = Progressive(pipeline)
                self._session.before_release = functools.partial(_end, self.progressive, self._inbox)
                self._inbox.begin(pipeline.gpu)
                self.renderer = pipeline.gpu.renderer
            if self.progressive.work(target, seconds):
                self._inbox.keep(pipeline.film, self.progressive.output)
            self.status, self.reported = self.progressive.status(target), target
            self.facts = _facts(pipeline, each_pass=target.settings.viewport_statistics)
        self.find_rays()

    def find_rays(self) -> None:
        """Rays of the pixel that is asked about, in the context of the pipeline; none in the middle of preparing."""
        progressive, asked, reported = self.progressive, self.asked, self.reported  # others may come meanwhile
        if asked is None or progressive is None or not progressive.is_between_steps:
            return
        if self._rays_of and self._rays_of[0] == asked and self._rays_of[1] is reported:
            return
        with self._session.pipeline() as pipeline:
            self.rays, self._rays_of = pipeline.rays_at(asked), (asked, reported)


def _end(progressive: Progressive, inbox: Inbox) -> None:
    """Before a pipeline goes."""
    progressive.stop()
    inbox.end()


class Viewport:
    """Reads the scene when it changes, and draws as much as there is time for."""

    def __init__(self) -> None:
        self.problem: str | None = None  # why there is no picture, in one sentence
        self.draws = 0
        self.session = Session(is_live=True, own_context=viewport_has_own_context())
        self._display: Display = UploadedDisplay() if self.session.thread.own else SharedDisplay()
        self._slices = Slices(self.session, self._display.inbox)
        self._view: Any = None
        self._scene: Any = None
        self._seen: tuple[Any, ...] = ()  # what the target was made from: by identity the scene and the view
        self._target: Target | None = None
        self._slice: Future[None] | None = None  # at work
        self._draw_ms = 0.0
        viewports.add(self)

    @property
    def is_done(self) -> bool:
        """Whether nothing more is to be done until something changes."""
        if self.problem is not None:
            return True
        if self._slice is not None:
            return False
        return self._target is None or (self._slices.reported is self._target and self._slices.status.is_done)

    @property
    def is_lit(self) -> bool:
        """Whether there is a picture."""
        progressive = self._slices.progressive
        return progressive is not None and progressive.shown_samples > 0

    @property
    def statistics(self) -> dict[str, Any]:
        """Of the picture: as the pipeline tells them, with the size that is shown."""
        progressive = self._slices.progressive
        return progressive.pipeline.statistics() if progressive is not None else {}

    def update(self, context: Any, depsgraph: Any) -> None:
        """The scene changed, or is seen for the first time. Touches no graphics. Raises nothing."""
        from .extract.view import extract_view

        try:
            view = extract_view(context.region, context.region_data, context.space_data, depsgraph.scene)
            size = (context.region.width, context.region.height)
            self.session.synchronize(depsgraph, size, camera=view.camera, viewport=context.space_data)
            self.problem = None
        except Exception as error:
            self.session.forget()
            self._fail(error)

    def draw(self, context: Any, depsgraph: Any, pixel_size: int) -> str:
        """Works for about one frame's time, and draws the best picture there is. Returns a line about it.

        ``pixel_size``: pixels of the region that one of the picture covers, along each side. Raises nothing.
        """
        start = time.perf_counter()
        self.draws += 1
        try:
            self._aim(context, depsgraph, pixel_size)
            self._work()
        except Exception as error:
            self._fail(error)
        try:
            if self._view is not None:
                self._display.draw(self._view.box)
                self._draw_rays(context)
        except Exception as error:
            self._fail(error)
        self._draw_ms = 1e3 * (time.perf_counter() - start)
        return self.problem or self._describe()

    def _aim(self, context: Any, depsgraph: Any, pixel_size: int) -> None:
        """Makes a new target when there is something else to be seen."""
        from .extract.view import extract_view, picture_size

        view = extract_view(context.region, context.region_data, context.space_data, depsgraph.scene)
        scene = self.session.scene
        if scene is None:
            return  # it could not be read
        view = self._view if view.is_same(self._view) else view
        seen = (id(scene), id(view), pixel_size, self.session.settings)
        if self._seen == seen:
            return
        self._view, self._scene, self._seen = view, scene, seen
        settings = self.session.settings
        output = settings.viewport_pass.lower()
        settings = dataclasses.replace(settings, samples=settings.viewport_samples)
        scene = dataclasses.replace(scene, camera=view.camera)
        self._target, self.problem = Target(scene, settings, picture_size(view.box, pixel_size), output), None

    def _work(self) -> None:
        """Lets a slice of work run, and waits for it as long as a frame may take."""
        target = self._target
        if target is None or self.problem is not None or self.is_done:
            return
        seconds = frame_seconds(target.settings.viewport_fps, self._slices.renderer)
        if self._slice is None:
            self._slice = self.session.thread.start(functools.partial(self._slices.run, target, seconds))
        wait([self._slice], seconds)
        if self._slice.done():
            done, self._slice = self._slice, None
            try:
                done.result()
            finally:
                del done  # else its error's traceback, which has this frame, would keep itself and the viewport alive

    def _draw_rays(self, context: Any) -> None:
        """Those of the pixel that the user asks about, found again when another picture or pixel is shown."""
        slices, asked = self._slices, rays.place_in(context.region)
        place: tuple[float, float] | None = None
        if asked is not None and self._view is not None:
            left, bottom, width, height = self._view.box
            place = (asked[0] - left + 0.5) / width, (asked[1] - bottom + 0.5) / height
            if min(place) < 0.0 or max(place) >= 1.0 or not self.is_lit:
                place = None
        else:
            slices.rays = None
        slices.asked = place
        if place is None:
            return
        if self._slice is None:
            self.session.thread.start(slices.find_rays).result()
        if slices.rays is not None:
            rays.draw_rays(slices.rays, context.region_data)

    def _fail(self, error: Exception) -> None:
        """Keeps what to tell the user. Nothing is tried again until something changes."""
        if not session.is_expected(error):
            _log.error("Conelight: unexpected error in a viewport", exc_info=error)
        self.problem = session.sentence(error)

    def _describe(self) -> str:
        """State, samples, voxels, memory and time in one line."""
        parts = self._slices.status.text, self._slices.facts, f"{self._draw_ms:.0f} ms"
        return " | ".join(part for part in parts if part)


def _facts(pipeline: Any, *, each_pass: bool) -> str:
    """Voxels and memory of a pipeline, and what ``each_pass`` took for this picture, longest first."""
    facts = [f"{sum(pipeline.gpu.memory.values()) / 2**20:.0f} MiB"]
    if pipeline.grid is not None:
        levels = pipeline.grid.levels
        size = " x ".join(map(str, (levels[0] if levels else pipeline.grid).size))
        facts.insert(0, f"{size} voxels" + (f" in the finest of {len(levels)} levels" if levels else ""))
        facts.append(_made_again(pipeline.statistics()))
    if each_pass:
        times = sorted(pipeline.gpu.times.items(), key=lambda entry: -entry[1].gpu_ms)
        facts += [f"{name} {time.gpu_ms / max(time.calls, 1):.1f} ms x {time.calls}" for name, time in times]
    return " | ".join(facts)


def _made_again(statistics: dict[str, Any]) -> str:
    """Shares of voxels and of their light that the last change of the scene has cost."""
    parts = (("voxels", "cells", "occupied"), ("links", "linked_faces", "faces"), ("light", "lit_faces", "faces"))
    shares = [f"{name} {statistics['redone'][key] / max(statistics[of], 1):.1%}" for name, key, of in parts]
    return "made again: " + ", ".join(shares)
