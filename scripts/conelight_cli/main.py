# SPDX-License-Identifier: GPL-3.0-or-later
"""From a checked command line to pictures: the steps of ``scripts/render``, inside the environment."""

from __future__ import annotations

import compileall
import os
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

from . import process
from .arguments import Arguments, frame_path
from .console import VERBOSE_VARIABLE, Progress, is_verbose, only_our_messages, say
from .errors import FAILED, USAGE, CommandError, reason

if TYPE_CHECKING:
    from .engines import Choices, Engine


ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def main(arguments: Arguments) -> NoReturn:
    """Renders, says what went wrong if something did, and ends the process."""
    process.isolate_blender()
    process.go_on_in_child(lambda child, number, doing: report_death(arguments, child, number, doing))
    process.end_on_signals()
    sys.path.insert(0, ROOT)
    try:
        if arguments.list_settings:
            from . import settings_table

            print(settings_table.as_text())
        else:
            render(arguments)
        status = 0
    except CommandError as error:
        fail(error)
    except Exception as error:  # a defect here or in the engine: still a sentence and not a traceback
        say(f"render: '{arguments.scene}' could not be rendered: {reason(error)} ({type(error).__name__}); "
            f"{VERBOSE_VARIABLE}=1 shows where")
        if is_verbose():
            traceback.print_exc()
        status = FAILED
    process.leave(status)


def report_death(arguments: Arguments, child: int, number: int, doing: str) -> None:
    """Says how the process ended that Blender ran in, and removes what it left. ``number``: of the signal, or 0."""
    from .output import remove_temporary

    for path, _ in output_files(arguments):
        remove_temporary(path, child)
    if number == signal.SIGKILL:
        how = "was killed from outside (as happens where memory runs out)"
    else:
        how = f"crashed ({signal.Signals(number).name})" if number else "ended without a word"
    say(f"render: '{arguments.scene}' could not be rendered: Blender {how} while {doing}; "
        f"{VERBOSE_VARIABLE}=1 shows what it printed")


def fail(error: CommandError) -> NoReturn:
    """Says what went wrong and ends the process."""
    say(f"render: {error}")
    process.leave(error.status)


def render(arguments: Arguments) -> None:
    """Renders and writes everything that was asked for. Raises CommandError."""
    started = time.perf_counter()
    for path, what in output_files(arguments):
        from .output import check_writable

        check_writable(path, what)
    if not os.path.isfile(arguments.scene):
        raise CommandError(f"scene file '{arguments.scene}' does not exist")
    if not arguments.enable_autoexec:
        confine_writing(arguments)
    with only_our_messages():
        choices = checked_choices(arguments)
        scene, engine, warnings = prepare(arguments, choices)
        frames: list[dict[str, Any]] = []
        first_frame_ms = 0.0
        wanted = frames_to_render(arguments)
        progress = Progress(len(wanted) if arguments.frames else 1)

        def written(path: str, statistics: dict[str, Any]) -> None:
            nonlocal first_frame_ms
            progress.end_frame()
            say(f"wrote {path}")
            frames.append(statistics)
            first_frame_ms = first_frame_ms or (time.perf_counter() - started) * 1000.0
            for text in statistics.get("warnings", ()):
                if text not in warnings:
                    warnings.append(text)
                    say(text)

        if arguments.frames:
            for run in runs(wanted):
                render_animation(scene, engine, arguments.output, run, progress, written)
        else:
            written(arguments.output, render_still(scene, engine, arguments.output, progress))
        progress.close()
        if arguments.stats:
            write_statistics(arguments, scene, frames, started, first_frame_ms, warnings)


def frames_to_render(arguments: Arguments) -> list[int]:
    """Frames of an animation whose file is not to be skipped, in order; empty for a still."""
    if arguments.frames is None:
        return []
    first, last = arguments.frames
    frames = list(range(first, last + 1))
    if not arguments.skip_existing:
        return frames
    missing = [frame for frame in frames if not os.path.isfile(frame_path(arguments.output, frame))]
    if len(missing) < len(frames):
        say(f"{len(frames) - len(missing)} of {len(frames)} frames are there already")
    return missing


def runs(frames: list[int]) -> list[tuple[int, int]]:
    """First and last of each run of frames without a gap.

    >>> runs([1, 2, 5])
    [(1, 2), (5, 5)]
    """
    found: list[tuple[int, int]] = []
    for frame in frames:
        if found and found[-1][1] == frame - 1:
            found[-1] = found[-1][0], frame
        else:
            found.append((frame, frame))
    return found


def confine_writing(arguments: Arguments) -> None:
    """From now on only the folders of what was asked for can be written to, whatever the scene file says."""
    from .confinement import confine_writing

    for folder in ("addon", "scripts"):
        compileall.compile_dir(os.path.join(ROOT, folder), quiet=2)  # Python cannot store it itself from now on
    outputs = [os.path.dirname(os.path.abspath(path)) for path, _ in output_files(arguments)]
    confine_writing([*outputs, tempfile.gettempdir()])


def output_files(arguments: Arguments) -> list[tuple[str, str]]:
    """Files that will be written, each with what it is."""
    files = [(arguments.output, "output")]
    return [*files, (arguments.stats, "statistics")] if arguments.stats else files


def checked_choices(arguments: Arguments) -> Choices:
    """Settings of the command line. Raises CommandError with status 2 for one that is unknown or out of range."""
    from .engines import Choices

    try:
        return Choices(
            arguments.preset, arguments.samples, arguments.voxels, arguments.time_limit, arguments.assignments,
        )
    except ValueError as error:
        raise CommandError(str(error), USAGE) from error


def prepare(arguments: Arguments, choices: Choices) -> tuple[Any, Engine, list[str]]:
    """The scene, ready to render, its engine, and what was said to the user about it."""
    from . import engines, framing, lighting, output
    from . import scene as scene_files

    engine = engines.create(arguments.engine, choices)
    messages: list[str] = []
    process.now_does("reading the file")
    scene = scene_files.load(arguments.scene, trusted=arguments.enable_autoexec)
    if not arguments.enable_autoexec:
        messages += scene_files.without_other_outputs(arguments.scene)
    if arguments.resolution:
        scene.render.resolution_x, scene.render.resolution_y = arguments.resolution
        scene.render.resolution_percentage = 100
    scene.render.use_sequencer = False
    choose_view_layer(scene, arguments)
    messages += engine.prepare(scene, is_animation=bool(arguments.frames))
    messages += choose_camera(scene, arguments, framing)
    if not lighting.has_light(scene):
        lighting.add_neutral_world(scene)
        messages.append(f"'{arguments.scene}' has no light: a neutral white world of strength 1 lights it")
    output.choose_format(scene, arguments.output, arguments.passes)
    if arguments.passes:
        output.enable_passes(scene)
    for text in messages:
        say(text)
    return scene, engine, messages


def choose_view_layer(scene: Any, arguments: Arguments) -> None:
    """Leaves only the view layer that was asked for. Raises CommandError if there is none of that name."""
    if arguments.view_layer is None:
        return
    names = [layer.name for layer in scene.view_layers]
    if arguments.view_layer not in names:
        known = ", ".join(names)
        raise CommandError(f"'{arguments.scene}' has no view layer '{arguments.view_layer}'; it has: {known}")
    for layer in scene.view_layers:
        layer.use = layer.name == arguments.view_layer


def choose_camera(scene: Any, arguments: Arguments, framing: Any) -> list[str]:
    """Sets the scene's camera: the one asked for, its own, its first, or a new one. Returns what the user must know."""
    cameras = {thing.name: thing for thing in scene.objects if thing.type == "CAMERA"}
    if arguments.camera is not None:
        if arguments.camera not in cameras:
            known = f"it has: {', '.join(cameras)}" if cameras else "it has none"
            raise CommandError(f"'{arguments.scene}' has no camera '{arguments.camera}'; {known}")
        scene.camera = cameras[arguments.camera]
        for marker in scene.timeline_markers:
            marker.camera = None  # markers would switch back to another camera
        return []
    if scene.camera is not None:
        return []
    if cameras:
        name, scene.camera = next(iter(cameras.items()))
        return [f"'{arguments.scene}' has no active camera: its camera '{name}' is used"]
    view = framing.add_camera(scene)
    if view is None:
        return [f"'{arguments.scene}' has nothing to show: the picture shows the world alone"]
    where = "one inside the room" if view.is_inside else "one that frames everything"
    return [f"'{arguments.scene}' has no camera: {where} is used"]


def render_still(scene: Any, engine: Engine, path: str, progress: Progress) -> dict[str, Any]:
    """Renders the current frame into a file and returns the engine's statistics. Raises CommandError."""
    import bpy

    from .engines import cpu_milliseconds
    from .output import replacing

    before = cpu_milliseconds()
    process.now_does("rendering")
    call_blender(scene, engine, progress, lambda: scene.frame_current)
    process.now_does("writing the picture")
    # Blender may only be asked to write what is there: it crashes when an engine failed before it began a result.
    statistics = engine.frame_statistics(cpu_milliseconds() - before)
    with replacing(path, "output") as temporary:
        try:
            bpy.data.images["Render Result"].save_render(temporary, scene=scene)
        except (KeyError, RuntimeError) as error:
            why = reason(error).replace(temporary, path)
            raise CommandError(f"output '{path}' could not be written: {why}") from error
        if not os.path.exists(temporary):
            raise CommandError(f"output '{path}' was not written; {VERBOSE_VARIABLE}=1 shows what Blender printed")
    return statistics


def render_animation(
    scene: Any, engine: Engine, output: str, frames: tuple[int, int], progress: Progress,
    written: Callable[[str, dict[str, Any]], None],
) -> None:
    """Renders frames from the first to the last into files, in one go: engines may keep what does not change.

    ``written`` hears of each file and of the engine's statistics. Raises CommandError.
    """
    import bpy

    from .engines import cpu_milliseconds
    from .output import remove_temporary, replacing, temporary_path

    scene.frame_start, scene.frame_end = frames
    scene.frame_step = 1
    scene.render.use_overwrite, scene.render.use_placeholder = True, False
    scene.render.filepath = temporary_path(output, "#######.")
    process.at_end(lambda: remove_temporary(output, os.getpid()))  # of a broken frame
    frame, before = frames[0], cpu_milliseconds()

    def frame_written(*_: Any) -> None:
        nonlocal frame, before
        path = frame_path(output, frame)
        try:
            statistics = engine.frame_statistics(cpu_milliseconds() - before)
            with replacing(path, "output") as temporary:
                os.replace(scene.render.frame_path(frame=frame), temporary)
        except CommandError as error:
            fail(error)  # Blender would go on with the next frame
        written(path, statistics)
        frame, before = frame + 1, cpu_milliseconds()
        process.now_does(f"rendering frame {frame}")

    bpy.app.handlers.render_write.append(frame_written)
    process.now_does(f"rendering frame {frame}")
    try:
        call_blender(scene, engine, progress, lambda: frame, animation=True)
    finally:
        bpy.app.handlers.render_write.remove(frame_written)
    if frame <= frames[1]:
        engine.frame_statistics(0.0)
        raise CommandError(f"frame {frame} was not rendered; {VERBOSE_VARIABLE}=1 shows what Blender printed")


def call_blender(scene: Any, engine: Engine, progress: Progress, frame: Callable[[], int], **options: Any) -> None:
    """Runs Blender's render operator. ``frame``: the one that is being rendered. Raises CommandError."""
    import bpy

    try:
        with engine.progress_to(progress.update):
            bpy.ops.render.render(scene=scene.name, **options)
    except RuntimeError as error:
        engine.frame_statistics(0.0)  # raises what the engine itself says about it
        raise CommandError(f"frame {frame()} could not be rendered: {reason(error)}") from error


def write_statistics(
    arguments: Arguments, scene: Any, frames: list[dict[str, Any]], started: float, first_frame_ms: float,
    warnings: list[str],
) -> None:
    """Writes the file of ``--stats``."""
    import bpy

    from . import statistics
    from .output import write_json

    assert arguments.stats is not None
    render = scene.render
    scale = render.resolution_percentage / 100.0
    content = statistics.report(
        frames,
        blender=bpy.app.version_string,
        renderer=arguments.engine,
        resolution=(int(render.resolution_x * scale), int(render.resolution_y * scale)),
        wall_ms=(time.perf_counter() - started) * 1000.0,
        first_frame_ms=first_frame_ms,
        warnings=warnings,
    )
    write_json(arguments.stats, content)
