# SPDX-License-Identifier: GPL-3.0-or-later
"""Light at pixels that passes take over from those before, and frames from the frames before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import moderngl
import numpy as np

from ..camera import CameraRays
from ..gpu import interface
from ..gpu.context import GpuContext
from .frame import Frame, Gather, run_tiles

#: A frame that takes over light gathers in one of so many passes in which it would gather otherwise ...
CONTINUED = 4
#: ... and what it takes over counts as so many frames, at most: noise falls to one in root of 2 LONGEST + 1, and what
#: is looked up between pixels again and again is blurred the more.
LONGEST = 12
#: What a pixel of a pass costs, in rays.
COST = 1


class _Record:
    """What one frame has found: means of each kind of light, and the surfaces they belong to."""

    def __init__(self, gpu: GpuContext, size: tuple[int, int], kinds: int) -> None:
        self.means = [gpu.texture("light of frames", size, 4, "f4") for _ in range(kinds)]
        self.place = gpu.texture("light of frames", size, 4, "u4")

    def release(self, gpu: GpuContext) -> None:
        gpu.free(*self.means, self.place)


class LightHistory:
    """Owns the light of this frame and of the last one, and says which passes gather."""

    def __init__(self, gpu: GpuContext, *, glossy: bool) -> None:
        self.gpu = gpu
        self.glossy = glossy
        self._now: _Record | None = None
        self._last: _Record | None = None  # made when a frame first takes over light
        self._key: tuple = ()
        self.forget()

    def forget(self) -> None:
        """What is known belongs to another scene."""
        self._cameras: list[CameraRays] = []  # this frame's, the last one's
        self._first_sample = self._first_gather = 0  # of this frame, counted through
        self._interval = self._gathers = self._base = 1

    def start(self, camera: CameraRays, samples: int, interval: int, taken: int, *, continues: bool) -> None:
        """Begin a frame of ``samples`` passes of which one in ``interval`` gathers.

        ``continues``: all but the camera is as it was in the last frame, which took ``taken`` passes: 0 leave
        nothing to take over.
        """
        base = interval  # of frames that take over nothing
        if continues and taken:
            self._first_sample += taken
            self._first_gather += -(-taken // self._interval)
            self._cameras = [camera, self._cameras[0]]
            self._now, self._last = self._last, self._now
            interval *= CONTINUED
        else:
            self.forget()
            self._cameras = [camera]
        self._interval, self._base = interval, base
        self._gathers = max(1, -(-samples // interval))

    def sample(self, index: int) -> int:
        """Number of this frame's pass ``index``, counted through frames."""
        return self._first_sample + index

    def gather(self, index: int) -> Gather | None:
        """The gather of this frame's pass ``index``, or None."""
        number, rest = divmod(index, self._interval)
        return None if rest else Gather(number, self._first_gather + number)

    def run(self, frame: Frame, lights: Sequence[moderngl.Texture]) -> Iterator[float]:
        """Of a pass that gathers: blend ``lights`` (rgba32f) with those of the last frame. Of another: fill them with
        what this frame's passes have found so far; w is -1 where that is nothing. Yields the share done."""
        key = (frame.size, len(lights))
        if key != self._key:
            self.release()
            self._key = key
        if self._now is None:
            self._now = _Record(self.gpu, frame.size, len(lights))
        now, last, gather = self._now, self._last, frame.gather
        takes_over = gather is not None and len(self._cameras) > 1 and last is not None
        before = now if gather is None else last
        matrix = self._cameras[0 if gather is None else -1].raster_matrix((0.5, 0.5))
        kernel = self.gpu.kernel(
            "history",
            frame.defines
            | {"KINDS": len(lights), "LOOKS_UP": gather is None, "TAKES_OVER": takes_over, "GLOSSY": self.glossy},
        )

        def bind() -> None:
            slot = interface.slot
            frame.bind(kernel)
            if self.glossy:
                kernel.set(specular_aperture=frame.settings.specular_aperture)
            for kind, light in enumerate(lights):
                light.bind_to_image(slot("IMG_0") + kind, read=True, write=True)
            if takes_over or gather is None:
                assert before is not None
                self.gpu.use_source(before.place, "TEX_BEFORE_PLACE")
                for kind, mean in enumerate(before.means):
                    self.gpu.use_source(mean, "TEX_BEFORE_0", kind)
                kernel.set(before_from_grid=tuple(np.asarray(matrix.T, np.float32).ravel().tolist()))
            if self.glossy and gather is None:
                # Sharp reflections take over nothing: they are found as often as in a frame by itself.
                kernel.set(least_passes=2.0 if len(self._cameras) > 1 and frame.index % self._base == 0 else 1.0)
            if takes_over:
                kernel.set(most_passes=float(LONGEST * self._gathers))
                if self.glossy:
                    kernel.set(before_eye=self._cameras[-1].eye)
            if gather is not None:
                for kind, mean in enumerate(now.means):
                    mean.bind_to_image(slot("IMG_3") + kind, read=True, write=True)
                now.place.bind_to_image(slot("IMG_6"), read=True, write=True)
                kernel.set(frame_passes=float(self._gathers), is_first=gather.index == 0)

        yield from run_tiles(self.gpu, "history", kernel, frame, COST, bind)

    def release(self) -> None:
        """Free everything."""
        for record in (self._now, self._last):
            if record is not None:
                record.release(self.gpu)
        self._now = self._last = None
        self._key = ()
