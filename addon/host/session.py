# SPDX-License-Identifier: GPL-3.0-or-later
"""From a depsgraph to a film: one session for each viewport, F12 render or preview.

A session first reads the scene (:meth:`Session.synchronize`, no graphics context needed) and then renders it
(:meth:`Session.render`, in the context that is current). It holds copies of data, never anything of Blender's.
"""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import bpy
import numpy as np

from ..camera import filter_reach
from ..scene import CameraData, SceneData
from ..settings import Settings
from . import legacy
from .abandoned import abandon, free, free_abandoned
from .backend import ContextThread, backend_in_use, has_own_context
from .properties import settings_from_scene

#: What the last render (not a preview) was and took; empty before the first. Keys: see docs of ``--stats``.
last_statistics: dict[str, Any] = {}

#: Why the last render (not a preview) failed, in one sentence; None: it did not. A render of several layers or frames
#: ends with the first that fails.
last_error: str | None = None

#: Hears of every step of a render (not of previews): fraction 0..1 done, and what is being done.
progress_listener: Callable[[float, str], None] | None = None

#: Renders so far, of one frame or of an animation.
_renders = 0

#: Called after every step: fraction 0..1 done, and what is being done. False cancels.
Step = Callable[[float, str], bool]

#: Share of the progress bar that goes to what happens before the first sample.
_PREPARATION_SHARE = 0.25


class RenderFailed(Exception):
    """A render cannot go on; the message is a sentence for the user."""


class RenderCancelled(Exception):
    """The user pressed Esc."""


def begin_render() -> None:
    """Forgets what the last render left behind."""
    global last_error, last_statistics, _renders
    _renders += 1
    last_error = None
    last_statistics = {}


def add_warning(text: str) -> None:
    """Adds to the warnings of the last render something that only the host knows."""
    warnings = last_statistics.setdefault("warnings", [])
    if text not in warnings:
        warnings.append(text)


def sentence(error: BaseException) -> str:
    """What to tell the user about ``error``."""
    if is_expected(error):
        return str(error)
    if isinstance(error, ImportError):
        return f"Conelight is not installed completely ({error}): install the extension again."
    if isinstance(error, MemoryError):
        return str(error) or "There is not enough memory for this render: lower the resolution or the voxel resolution."
    if isinstance(error, KeyboardInterrupt):
        return "The render was interrupted."
    return f"Conelight failed where it should not: {type(error).__name__}: {error}"


def is_expected(error: BaseException) -> bool:
    """Whether the message of ``error`` was written for the user."""
    kinds: list[type[BaseException]] = [RenderFailed]
    try:
        from ..gpu.context import GpuUnavailable
        from ..gpu.program import ShaderError
        from ..pipeline import PipelineError
        from .extract.scene import ExtractionError

        kinds += [GpuUnavailable, PipelineError, ShaderError, ExtractionError]
    except ImportError:
        pass  # then the error is this one, or came before it mattered
    return isinstance(error, tuple(kinds))


class Session:
    """What is kept between the frames of one picture: the scene that was read, and the pipeline that renders it."""

    def __init__(self, *, is_preview: bool = False, is_live: bool = False, own_context: bool | None = None) -> None:
        """``is_live``: somebody edits the scene while it is shown. ``own_context``: whether to render in a context of
        our own instead of Blender's; None: as F12 does."""
        self.is_preview, self.is_live = is_preview, is_live
        self.settings = Settings()
        self.scene: SceneData | None = None
        self.thread = ContextThread(own=has_own_context() if own_context is None else own_context)
        self._reader: Any = None
        self._extraction_ms = 0.0
        self._context: Any = None
        self._pipeline: Any = None
        self._legacy: legacy.Legacy | None = None  # whose reader this has, and whose pipeline it may have
        self._render_number = -1  # of the last picture
        self._shown = (slice(None), slice(None))  # rows and columns of the film that were asked for
        #: Ends what was left half done in the pipeline, before it is freed: called where its context is current.
        self.before_release: Callable[[], None] | None = None

    def synchronize(
        self,
        depsgraph: Any,
        resolution: tuple[int, int],
        test_break: Callable[[], bool] = lambda: False,
        *,
        camera: CameraData | None = None,
        viewport: Any = None,
    ) -> None:
        """Reads settings and what may have changed in the scene. ``resolution``: of the whole frame, in pixels.

        ``camera`` takes the place of the scene's. ``viewport``: ``bpy.types.SpaceView3D`` that shows the scene, and
        may leave out some of it.
        To be called after each evaluation of the depsgraph. Raises ExtractionError, or RenderCancelled when
        ``test_break`` says so, and then holds no scene.
        """

        def check() -> None:
            if test_break():
                raise RenderCancelled

        from .extract.scene import SceneReader

        start = time.perf_counter()
        self.settings = settings_from_scene(
            depsgraph.scene, samples=depsgraph.view_layer.samples, is_preview=self.is_preview
        )
        self.scene = None
        if self._reader is None:
            self._legacy = legacy.inherit() if self.is_live and self._pipeline is None else None
            self._reader = self._legacy.reader if self._legacy else SceneReader(is_preview=self.is_preview)
        self.scene = self._reader.read(depsgraph, resolution, check, camera=camera, viewport=viewport)
        self._extraction_ms = 1e3 * (time.perf_counter() - start)

    def forget(self) -> None:
        """Lets go of the scene. To be called where an evaluation of the depsgraph is not read: its changes are lost."""
        self.scene = self._reader = self._legacy = None

    def render(
        self,
        size: tuple[int, int],
        wanted: Iterable[str],
        step: Step,
        after_sample: Callable[[int], None] | None = None,
        border: tuple[float, float, float, float] | None = None,
        *,
        is_animation: bool = False,
    ) -> bool:
        """Renders all samples of a picture of ``size`` pixels into :attr:`film`.

        ``wanted``: names of passes. ``border``: part of the frame that the picture shows (x0, y0, x1, y1 in 0..1,
        origin bottom left), where it is not what the scene says. ``is_animation``: what this render's frame before has
        found may be taken over. ``after_sample(samples)`` may read the film. Returns
        False when ``step`` cancelled. To be called on :attr:`thread`, as :meth:`release`; leaves the state of a GL
        context of Blender's as it was.
        Raises GpuUnavailable, PipelineError, and RenderFailed when there is no scene.
        """
        if self.scene is None:
            raise RenderFailed("There is no scene to render.")
        with self.pipeline():
            return self._render(self.scene, size, set(wanted), step, after_sample, border, is_animation)

    @contextlib.contextmanager
    def pipeline(self) -> Iterator[Any]:
        """The pipeline of this session; leaves the state of a GL context of Blender's as it was.

        To be used on :attr:`thread`. Raises GpuUnavailable and RenderFailed.
        """
        self._ensure_pipeline()
        with self._context.guard():
            yield self._pipeline

    def _render(
        self,
        scene: SceneData,
        size: tuple[int, int],
        wanted: set[str],
        step: Step,
        after_sample: Callable[[int], None] | None,
        border: tuple[float, float, float, float] | None,
        is_animation: bool,
    ) -> bool:
        start = time.perf_counter()
        border, rendered, self._shown = with_margin(
            border or scene.camera.border, size, filter_reach(scene.pixel_filter_width)
        )
        if border != scene.camera.border:
            scene = dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, border=border))
        self._pipeline.want(wanted)
        follows = is_animation and self._render_number == _renders
        self._render_number = _renders
        for progress in self._pipeline.prepare(scene, self.settings, rendered, follows=follows):
            if not step(_PREPARATION_SHARE * progress.fraction, progress.text):
                return False

        samples = self.settings.samples
        first_frame_ms = 0.0
        for sample in range(samples):
            for progress in self._pipeline.sample():
                fraction = (sample + progress.fraction) / samples
                done = _PREPARATION_SHARE + (1.0 - _PREPARATION_SHARE) * fraction
                if not step(done, f"Sample {sample + 1}/{samples}"):
                    return False
            elapsed = time.perf_counter() - start
            first_frame_ms = first_frame_ms or 1e3 * elapsed
            if after_sample is not None:
                after_sample(sample + 1)
            if self.film.is_converged or 0.0 < self.settings.time_limit <= elapsed:
                break
        self._publish_statistics(size, 1e3 * (time.perf_counter() - start), first_frame_ms)
        return True

    @property
    def film(self) -> Any:
        """Where the pictures are, once :meth:`render` has begun: ``names``, ``samples``; :meth:`read` reads them."""
        return self._pipeline.film

    def read(self, name: str) -> np.ndarray:
        """(H, W, C) float32, row 0 at the bottom: what was asked for of a picture of the film."""
        picture: np.ndarray = self.film.read(name)[self._shown]
        return picture

    @property
    def warnings(self) -> list[str]:
        """What could not be rendered as asked, by name, each once."""
        found = list(self.scene.warnings) if self.scene is not None else []
        if self._pipeline is not None:
            found += self._pipeline.warnings
        return list(dict.fromkeys(found))

    def release(self) -> None:
        """Frees everything on the GPU. The context that :meth:`render` had must be current."""
        free(*self._hand_over())

    def __del__(self) -> None:
        heir = None
        if self.is_live and self.scene is not None and self._pipeline is not None:
            heir = legacy.leave(self._reader, self.scene)
        self._let_go(heir)  # this may be any thread

    def _let_go(self, heir: legacy.Legacy | None = None) -> None:
        """Has everything on the GPU freed, when its context is current again. ``heir``: what keeps what it can."""
        context, pipeline, before = self._hand_over()
        if context is not None and not self.thread.own:
            abandon(context, pipeline, before, heir)
            context = None
        self.thread.end((lambda: free(context, pipeline, before, heir)) if context is not None else None)

    def _hand_over(self) -> tuple[Any, Any, Callable[[], None] | None]:
        """The context, what lives in it, and what is to be called before that is freed: no longer the session's."""
        found = self._context, self._pipeline, self.before_release
        self._context = self._pipeline = self.before_release = None
        return found

    def _ensure_pipeline(self) -> None:
        from ..gpu.context import GpuContext
        from ..pipeline import Pipeline

        free_abandoned()
        if self._context is not None and not self.thread.own and not self._context.is_current:
            self._let_go()  # Blender has made another
        if self._pipeline is None:
            _, problem = backend_in_use()
            if problem is not None:
                raise RenderFailed(problem)
            if self._inherit():
                return
            self._context = GpuContext.standalone() if self.thread.own else GpuContext.attach()
            with self._context.guard():
                self._pipeline = Pipeline(self._context, is_live=self.is_live)

    def _inherit(self) -> bool:
        """Whether there is a pipeline now, as the last viewport has left it."""
        made, self._legacy = self._legacy.claim() if self._legacy else None, None
        if made is None:
            return False
        context, pipeline = made
        try:
            with context.guard():
                pipeline.put_back()
        except Exception:  # no memory for one: what is made anew may be smaller, or says why not
            with contextlib.suppress(Exception), context.guard():
                context.release()
            return False
        self._context, self._pipeline = made
        return True

    def _publish_statistics(self, size: tuple[int, int], render_ms: float, first_frame_ms: float) -> None:
        global last_statistics
        if self.is_preview:
            return
        last_statistics = self._pipeline.statistics() | {
            "blender": bpy.app.version_string,
            "resolution": list(size),
            "samples": self.film.samples,
            "warnings": self.warnings,
            "wall_ms": self._extraction_ms + render_ms,
            "first_frame_ms": self._extraction_ms + first_frame_ms,  # until the first pass was in the film
        }


def with_margin(
    border: tuple[float, float, float, float], size: tuple[int, int], reach: int
) -> tuple[tuple[float, float, float, float], tuple[int, int], tuple[slice, slice]]:
    """A border of ``size`` pixels, wider by the ``reach`` of the pixel filter as far as the frame goes; its pixels, and
    which rows and columns of them lie inside. Pixels at its edge take what they take in the whole picture then."""
    low, high, sizes, inside = [0.0, 0.0], [1.0, 1.0], [0, 0], [slice(None), slice(None)]
    for axis, pixels in enumerate(size):
        start, end = border[axis], border[axis + 2]
        frame = max(round(pixels / max(end - start, 1e-9)), pixels)
        first = round(start * frame)
        before, after = min(reach, first), min(reach, max(frame - first - pixels, 0))
        if before or after:
            start, end = (first - before) / frame, (first + pixels + after) / frame
        low[axis], high[axis], sizes[axis] = start, end, before + pixels + after
        inside[axis] = slice(before, before + pixels)
    return (low[0], low[1], high[0], high[1]), (sizes[0], sizes[1]), (inside[1], inside[0])


def pixel_border(
    render: Any, frame: tuple[int, int], size: tuple[int, int]
) -> tuple[float, float, float, float] | None:
    """The part of the frame that a render result shows, on whole pixels as Blender cuts it; None: the whole frame.

    ``render``: ``bpy.types.RenderSettings``. ``frame``: pixels of the whole frame. ``size``: pixels of the result.
    """
    if size == frame or not render.use_border:
        return None
    left = int(np.float32(render.border_min_x) * np.float32(frame[0]))
    bottom = int(np.float32(render.border_min_y) * np.float32(frame[1]))
    return left / frame[0], bottom / frame[1], (left + size[0]) / frame[0], (bottom + size[1]) / frame[1]
