# SPDX-License-Identifier: GPL-3.0-or-later
"""A child process that renders one scene, job after job: ``python -m conelight_benchmark.worker JOBS.json``.

Each job ends with a folder of pictures and ``info.json``. Times are those of the render call alone; a tiny picture is
rendered first, so that shaders are compiled and libraries loaded.
"""

from __future__ import annotations

import contextlib
import json
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from conelight_cli import process

process.isolate_blender()  # before the first import of Blender

import bpy  # noqa: E402
from conelight_cli import engines  # noqa: E402
from conelight_cli import scene as scene_files  # noqa: E402
from conelight_cli.errors import FAILED  # noqa: E402
from conelight_cli.output import choose_format  # noqa: E402
from mathutils import Matrix, Vector  # noqa: E402

from addon.host.film import PASSES  # noqa: E402
from addon.passes.converge import FIRST_LOOK  # noqa: E402
from blender_tests.pictures import Picture, write  # noqa: E402

from . import fetch_rate, fetches, kernels  # noqa: E402
from .job import Job  # noqa: E402
from .store import INFO, filling  # noqa: E402

#: A picture is rendered again until this many CPU seconds or runs are spent; the run with the median time counts.
REPEAT_SECONDS, REPEAT_RUNS = 4.0, 3
WARM_UP_SIZE = (32, 24)

#: Passes (names of ``addon/host/film.py``) that the direct light and the glow are made of.
LIGHT_PASSES = ("diffuse_direct", "diffuse_color", "glossy_direct", "glossy_color", "emission", "environment")


def main(jobs_file: Path) -> NoReturn:
    """Renders all jobs and ends the process, also after an error, whose traceback is printed."""
    try:
        render_all(jobs_file)
    except Exception:
        traceback.print_exc()
        process.leave(FAILED)
    process.leave(0)


def render_all(jobs_file: Path) -> None:
    """Renders the jobs of a file in their order."""
    work = json.loads(jobs_file.read_text(encoding="utf-8"))
    jobs = [(Job.from_dict(entry["job"]), Path(entry["folder"])) for entry in work["jobs"]]
    if kernel := jobs[0][0].kernel:  # all jobs of a process have the same
        kernels.install(kernel)
    counter = fetches.install() if jobs[0][0].counts_fetches else None
    for job, folder in jobs:
        run(Path(work["scene"]), job, folder, counter)


def run(scene_file: Path, job: Job, folder: Path, counter: fetches.FetchCounter | None) -> None:
    """Renders one job into ``folder``."""
    print(f"{scene_file.parent.name}: {job}", flush=True)
    # Settings and passes of the job before must not stay, so the file is read again.
    engine = engines.create(job.engine, _choices(job))
    scene = scene_files.load(str(scene_file))
    scene.camera = scene.camera or next(thing for thing in scene.objects if thing.type == "CAMERA")
    scene.render.resolution_percentage = 100
    scene.render.use_sequencer = False
    engine.prepare(scene, is_animation=False)  # a sequence keeps data only after the warm-up
    if job.engine == "cycles":
        _prepare_cycles(scene, job)
    _ask_for_passes(scene, job.passes and job.engine == "cycles")
    if job.timed and counter is None:
        _warm_up(scene, job)
    scene.render.resolution_x, scene.render.resolution_y = job.size
    with filling(folder) as place:
        if counter is not None:
            info = _count_fetches(scene, engine, counter)
        else:
            info = _sequence(scene, job, engine, place) if job.frames else _still(scene, job, engine, place)
        info |= {"job": job.as_dict(), "frames": job.frames, "blender": bpy.app.version_string}
        (place / INFO).write_text(json.dumps(info, indent=1) + "\n", encoding="utf-8")


def _choices(job: Job) -> engines.Choices:
    seed = (("seed", str(job.seed)),)
    return engines.Choices(job.preset, job.samples, None, None, (*job.assignments, *seed))


def _prepare_cycles(scene: Any, job: Job) -> None:
    cycles = scene.cycles
    cycles.use_denoising = bool(job.denoiser)
    for layer in scene.view_layers:
        layer.cycles.use_denoising = bool(job.denoiser)
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_use_gpu = False
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = "FAST" if job.denoiser == "fast" else "ACCURATE"
    cycles.denoising_quality = "FAST" if job.denoiser == "fast" else "HIGH"
    if job.bounces:
        for kind in ("max", "diffuse", "glossy", "transmission", "transparent_max"):
            setattr(cycles, f"{kind}_bounces", job.bounces)
    if job.lamps_only:
        cycles.max_bounces = 0
        for thing in scene.objects:
            if thing.type != "LIGHT":  # the world's light below; surfaces still throw shadows and are seen
                thing.visible_diffuse = thing.visible_glossy = thing.visible_transmission = False
        if scene.world is not None:
            visibility = scene.world.cycles_visibility
            visibility.diffuse = visibility.glossy = visibility.transmission = visibility.scatter = False


def _warm_up(scene: Any, job: Job) -> None:
    """A tiny picture with few samples, by the same programs: some of ours run only in later passes, and which they are
    may depend on the voxels."""
    scene.render.resolution_x, scene.render.resolution_y = WARM_UP_SIZE
    ours = getattr(scene, "conelight", None)
    names = [(ours, "samples", FIRST_LOOK)]
    names += [(scene.cycles, "samples", 1), (scene.eevee, "taa_render_samples", 1)]
    kept = [(owner, name, getattr(owner, name)) for owner, name, _ in names if owner is not None]
    for owner, name, value in names:
        if owner is not None:
            setattr(owner, name, value)
    bpy.ops.render.render(scene=scene.name)
    for owner, name, value in reversed(kept):
        setattr(owner, name, value)


def _ask_for_passes(scene: Any, wanted: bool) -> None:
    for film_pass in PASSES:
        if film_pass.flag is not None:
            for layer in scene.view_layers:
                setattr(layer, film_pass.flag, wanted and film_pass.name in LIGHT_PASSES)
    choose_format(scene, "picture.exr", multilayer=wanted)


# ---- rendering ---------------------------------------------------------------------------------------------------


def _still(scene: Any, job: Job, engine: engines.Engine, place: Path) -> dict[str, Any]:
    runs: list[dict[str, Any]] = []
    while not runs or (
        job.timed and len(runs) < REPEAT_RUNS and sum(run["cpu_ms"] for run in runs) < 1e3 * REPEAT_SECONDS
    ):
        runs.append(_timed_render(scene, engine))
    runs.sort(key=lambda run: run["cpu_ms"])
    passes = _rendered_passes(scene)
    _save(place / "full.exr", passes["combined"])
    if job.passes:
        _save_parts(scene, job, place, passes)
    info = {**runs[len(runs) // 2], "runs": len(runs)}
    if job.engine == "conelight" and job.timed:
        with fetch_rate.after_sample() as info["fetch_rates"]:
            _warm_up(scene, job)
    return info


def _count_fetches(scene: Any, engine: engines.Engine, counter: fetches.FetchCounter) -> dict[str, Any]:
    bpy.ops.render.render(scene=scene.name)
    return {"statistics": engine.frame_statistics(0.0), "fetches": counter.counts}


def _save_parts(scene: Any, job: Job, place: Path, passes: dict[str, Picture]) -> None:
    """Writes ``direct`` and ``seen``; see :meth:`.store.Result.picture`.

    Cycles divides a light pass by its colour pass after summing, so their product is the sum again. Conelight renders
    the same samples again, not timed, without the gathers that find all light but that of lamps.
    """
    if job.engine == "cycles":
        direct = sum(passes[f"{kind}_direct"] * passes[f"{kind}_color"] for kind in ("diffuse", "glossy"))
        seen = passes["emission"] + passes["environment"]
    else:
        scene.conelight.use_indirect = scene.conelight.use_specular = False
        _ask_for_passes(scene, True)
        bpy.ops.render.render(scene=scene.name)
        passes = _rendered_passes(scene)
        seen = passes["emission"] + passes["environment"]
        direct = passes["combined"] - seen
    _save(place / "direct.exr", np.asarray(direct, np.float32))
    _save(place / "seen.exr", seen)


def _sequence(scene: Any, job: Job, engine: engines.Engine, place: Path) -> dict[str, Any]:
    """All frames as one animation; what an engine keeps between frames, it may keep."""
    assert job.motion is not None
    start = scene.camera.matrix_world.copy()
    scene.camera.animation_data_clear()
    scene.camera.parent = None
    scene.camera.rotation_mode = "QUATERNION"
    for frame in range(job.frames):
        share = frame / max(job.frames - 1, 1)
        turn = Matrix.Rotation(np.radians(job.motion.turn) * share, 4, "Z")
        position = start @ (Vector(job.motion.travel) * share)
        rotation = turn @ start.to_quaternion().to_matrix().to_4x4()
        scene.camera.matrix_world = Matrix.Translation(position) @ rotation
        for path in ("location", "rotation_quaternion"):
            scene.camera.keyframe_insert(path, frame=frame + 1)
    scene.frame_start, scene.frame_end, scene.frame_step = 1, job.frames, 1
    scene.render.use_persistent_data = True
    scene.render.use_file_extension = scene.render.use_overwrite = True
    scene.render.filepath = str(place / "raw_####.exr")
    frames: list[dict[str, Any]] = []
    clocks: list[_Clock] = []

    def begun(*_: Any) -> None:
        _forget_peak_memory()
        clocks.append(_Clock())

    def ended(*_: Any) -> None:
        cpu_ms = clocks[-1].cpu_ms()
        frames.append({
            "cpu_ms": cpu_ms, "wall_ms": clocks[-1].wall_ms(), "peak_rss": _peak_memory(),
            "statistics": engine.frame_statistics(cpu_ms),
        })  # fmt: skip

    bpy.app.handlers.render_pre.append(begun)
    bpy.app.handlers.render_post.append(ended)
    try:
        with engine.progress_to(lambda *_: None):
            bpy.ops.render.render(animation=True, scene=scene.name)
    finally:
        bpy.app.handlers.render_pre.remove(begun)
        bpy.app.handlers.render_post.remove(ended)
    for frame in range(job.frames):
        raw = place / f"raw_{frame + 1:04d}.exr"
        _save(place / f"full_{frame:04d}.exr", dict(_read_passes(raw))["combined"])
        raw.unlink()
    return {
        "cpu_ms": sum(frame["cpu_ms"] for frame in frames),
        "wall_ms": sum(frame["wall_ms"] for frame in frames),
        "peak_rss": max(frame["peak_rss"] for frame in frames),
        "each": frames,
    }


class _Clock:
    """CPU time of all threads and wall time, ms, since it was made."""

    def __init__(self) -> None:
        self._cpu, self._wall = time.process_time(), time.perf_counter()

    def cpu_ms(self) -> float:
        return 1e3 * (time.process_time() - self._cpu)

    def wall_ms(self) -> float:
        return 1e3 * (time.perf_counter() - self._wall)


def _timed_render(scene: Any, engine: engines.Engine) -> dict[str, Any]:
    """Renders the current frame. ``preparation_*``: until the first sample began, for engines that say so."""
    preparation = {"preparation_cpu_ms": 0.0, "preparation_wall_ms": 0.0}

    def heard(fraction: float, text: str) -> None:
        if text and not text.startswith("Sample"):
            preparation.update(preparation_cpu_ms=clock.cpu_ms(), preparation_wall_ms=clock.wall_ms())

    _forget_peak_memory()
    clock = _Clock()
    with engine.progress_to(heard):
        bpy.ops.render.render(scene=scene.name)
    cpu_ms, wall_ms = clock.cpu_ms(), clock.wall_ms()
    return {
        "cpu_ms": cpu_ms, "wall_ms": wall_ms, **preparation, "peak_rss": _peak_memory(),
        "statistics": engine.frame_statistics(cpu_ms),
    }


def _forget_peak_memory() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def _peak_memory() -> int:
    """Bytes, since :func:`_forget_peak_memory`."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    return 0


# ---- pictures ----------------------------------------------------------------------------------------------------


def _save(path: Path, picture: Picture) -> None:
    write(path, picture, half=False)


def _rendered_passes(scene: Any) -> dict[str, Picture]:
    """What the render just done holds; see :func:`_read_passes`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "raw.exr"
        bpy.data.images["Render Result"].save_render(str(path), scene=scene)
        return dict(_read_passes(path))


def _read_passes(path: Path) -> Iterator[tuple[str, Picture]]:
    """Colours of each pass of :data:`LIGHT_PASSES` and the picture, by the renderer's names; black if not there."""
    import OpenImageIO as oiio

    channels: dict[str, dict[str, Picture]] = {}
    for part in range(oiio.ImageBuf(str(path)).nsubimages):  # Blender 5.0 and later: one for each pass
        buffer = oiio.ImageBuf(str(path), part, 0)
        pixels = np.asarray(buffer.get_pixels(oiio.FLOAT), np.float32)
        for index, channel in enumerate(buffer.spec().channelnames):
            *_, layer, component = ("Combined." + channel).split(".")
            channels.setdefault(layer, {})[component] = pixels[..., index]
    black = np.zeros_like(channels["Combined"]["R"])
    for film_pass in PASSES:
        if film_pass.name == "combined" or film_pass.name in LIGHT_PASSES:
            found = channels.get(film_pass.blender_name(bpy.app.version), {})
            yield film_pass.name, np.stack([found.get(component, black) for component in "RGB"], axis=-1)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
