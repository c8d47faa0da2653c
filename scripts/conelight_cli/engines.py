# SPDX-License-Identifier: GPL-3.0-or-later
"""The engines a scene can be rendered with, behind one small interface."""

from __future__ import annotations

import contextlib
import importlib
import re
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import bpy

from addon.settings import PRESETS, Settings

from .console import VERBOSE_VARIABLE
from .errors import CommandError

Listener = Callable[[float, str], None]

BOUNCES = 16  # of Cycles, for comparison: far more than what can be seen


class Engine(Protocol):
    """What the command line asks of an engine."""

    def prepare(self, scene: Any, is_animation: bool) -> list[str]:
        """Sets the scene up for this engine, to render one picture or several; returns sentences for the user."""

    def progress_to(self, listener: Listener) -> contextlib.AbstractContextManager[None]:
        """While the block runs, the listener hears of progress."""

    def frame_statistics(self, cpu_ms: float) -> dict[str, Any]:
        """What is known about the frame just rendered. Raises CommandError if the engine could not render it."""


class Choices:
    """What the command line says about settings, checked."""

    def __init__(
        self, preset: str | None, samples: int | None, voxels: int | None, time_limit: float | None,
        assignments: tuple[tuple[str, str], ...],
    ) -> None:
        """Raises ValueError for an unknown setting or a value that is out of range."""
        self.preset = preset
        self.texts: dict[str, str] = {}
        if samples is not None:
            self.texts["samples"] = str(samples)
        if voxels is not None:
            self.texts.update(voxel_auto="off", voxel_resolution=str(voxels))
        if time_limit is not None:
            self.texts["time_limit"] = str(time_limit)
        self.texts.update(dict(assignments))
        self.settings()

    def settings(self, stored: dict[str, Any] | None = None) -> Settings:
        """All settings. ``stored`` are those of the scene file; a preset that is asked for goes before them."""
        base = Settings(**PRESETS[self.preset]) if self.preset else Settings().with_values(**(stored or {}))
        return base.with_texts(self.texts)

    def changed(self, settings: Settings) -> dict[str, Any]:
        """Values to write into a scene: all with a preset, else those that were asked for."""
        names = Settings.declarations() if self.preset else self.texts
        return {name: getattr(settings, name) for name in names}


class Conelight:
    """This project's engine, from the source tree."""

    def __init__(self, choices: Choices) -> None:
        self._choices = choices
        try:
            importlib.import_module("addon").register()
            self._session: Any = importlib.import_module("addon.host.session")
        except ImportError as error:
            raise CommandError(f"the engine could not be loaded: {error}") from error

    def prepare(self, scene: Any, is_animation: bool) -> list[str]:
        scene.render.engine = "CONELIGHT"
        scene.render.use_persistent_data = is_animation
        stored = {
            name: getattr(scene.conelight, name)
            for name in Settings.declarations() if scene.conelight.is_property_set(name)
        }
        settings = self._choices.settings(stored)
        for name, value in self._choices.changed(settings).items():
            setattr(scene.conelight, name, value)
        return []

    @contextlib.contextmanager
    def progress_to(self, listener: Listener) -> Iterator[None]:
        self._session.last_error = None
        self._session.last_statistics = {}
        self._session.progress_listener = listener
        try:
            yield
        finally:
            self._session.progress_listener = None

    def frame_statistics(self, cpu_ms: float) -> dict[str, Any]:
        if self._session.last_error:
            raise CommandError(self._session.last_error)
        statistics, self._session.last_statistics = self._session.last_statistics, {}
        if not statistics:
            raise CommandError(f"the engine ended without a picture; {VERBOSE_VARIABLE}=1 shows what it printed")
        return statistics


class BlenderEngine:
    """One of Blender's own engines."""

    def __init__(self, choices: Choices) -> None:
        self._choices = choices
        self._settings = choices.settings()

    def prepare(self, scene: Any, is_animation: bool) -> list[str]:
        raise NotImplementedError

    def _ignored(self, engine: str, used: set[str]) -> list[str]:
        unused = [name for name in self._choices.texts if name not in used]
        return [f"{engine} has no use for these settings: {', '.join(unused)}"] if unused else []

    @contextlib.contextmanager
    def progress_to(self, listener: Listener) -> Iterator[None]:
        def heard(text: str, *_: Any) -> None:
            counted = re.search(r"(\d+)\s*/\s*(\d+)", str(text))
            if counted and int(counted.group(2)) > 0:
                listener(int(counted.group(1)) / int(counted.group(2)), "")

        bpy.app.handlers.render_stats.append(heard)
        try:
            yield
        finally:
            bpy.app.handlers.render_stats.remove(heard)

    def frame_statistics(self, cpu_ms: float) -> dict[str, Any]:
        return {
            "samples": self._settings.samples,
            "passes": [{"name": "render", "calls": 1, "cpu_ms": cpu_ms, "gpu_ms": 0.0}],
        }


class Cycles(BlenderEngine):
    """The reference: on the CPU, plain path tracing without anything that changes the answer."""

    def prepare(self, scene: Any, is_animation: bool) -> list[str]:
        scene.render.engine = "CYCLES"
        values = {
            "device": "CPU", "samples": self._settings.samples, "seed": self._settings.seed,
            "time_limit": self._settings.time_limit, "use_adaptive_sampling": False, "use_denoising": False,
            "sample_clamp_direct": 0.0, "sample_clamp_indirect": 0.0, "caustics_reflective": True,
            "caustics_refractive": True, "blur_glossy": 0.0, "use_fast_gi": False, "use_guiding": False,
            "max_bounces": BOUNCES, "diffuse_bounces": BOUNCES, "glossy_bounces": BOUNCES,
            "transmission_bounces": BOUNCES, "transparent_max_bounces": BOUNCES,
        }
        for name, value in values.items():
            setattr(scene.cycles, name, value)
        for layer in scene.view_layers:
            layer.samples = 0  # no count of its own
            layer.cycles.use_denoising = False
        return self._ignored("cycles", {"samples", "seed", "time_limit"})

    def frame_statistics(self, cpu_ms: float) -> dict[str, Any]:
        return {**super().frame_statistics(cpu_ms), "bounces": BOUNCES}


class Eevee(BlenderEngine):
    """Blender's rasterizing engine, with its screen-space ray tracing."""

    def prepare(self, scene: Any, is_animation: bool) -> list[str]:
        scene.render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0, 0) else "BLENDER_EEVEE"
        scene.eevee.taa_render_samples = self._settings.samples
        scene.eevee.use_raytracing = True
        for layer in scene.view_layers:
            layer.samples = 0
        return self._ignored("eevee", {"samples"})


def create(name: str, choices: Choices) -> Engine:
    """The engine of a name of ``--engine``. Raises CommandError if it is not there."""
    kinds: dict[str, Callable[[Choices], Engine]] = {"conelight": Conelight, "cycles": Cycles, "eevee": Eevee}
    return kinds[name](choices)


def cpu_milliseconds() -> float:
    """CPU time that all threads of this process have taken."""
    return time.process_time() * 1000.0
