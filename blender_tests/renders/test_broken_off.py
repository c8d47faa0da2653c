# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/render when something goes wrong around it: crashes, kills, full disks, folders that go away.

A sentence each time, no file but whole ones, and nothing temporary left. Cycles draws, as it is quick to start.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender_tests.pictures import read  # noqa: E402
from blender_tests.scenes import build  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
QUICK = ["--engine", "cycles", "--samples", "1", "--resolution", "64x48"]


class Folders:
    """Where a scene is, where pictures go, and where Blender keeps temporary files."""

    def __init__(self, top: Path) -> None:
        self.top, self.out, self.temporary = top, top / "out", top / "temporary"
        for folder in (self.out, self.temporary):
            folder.mkdir()

    def start(self, *arguments: str | Path, **options: Any) -> subprocess.Popen[str]:
        environ = {**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self.temporary))}
        return subprocess.Popen(
            [sys.executable, str(ROOT / "scripts" / "render"), *map(str, arguments), *QUICK], cwd=self.out, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, env=environ, **options,
        )  # fmt: skip

    def render(self, *arguments: str | Path, status: int = 0, **options: Any) -> str:
        """What is said."""
        process = self.start(*arguments, **options)
        said = process.communicate(timeout=240)[1]
        assert process.returncode == status, said
        assert "Traceback" not in said
        assert self.nothing_is_left()
        return said

    def nothing_is_left(self) -> bool:
        """What a process leaves that ends by itself."""
        return list(self.temporary.iterdir()) == [] and not [path for path in self.out.rglob(".*") if path.is_file()]

    def pictures(self) -> list[str]:
        return sorted(path.name for path in self.out.iterdir())


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    return Folders(tmp_path)


def save(path: Path, at_start: str = "", at_frames: str = "") -> Path:
    """A lit box that turns. ``at_start`` and ``at_frames``: code that runs there, with --enable-autoexec."""
    scene = build.empty_scene()
    box = build.add_box("Box", (1, 1, 1), (0, 0, 0), material=build.diffuse("Grey", (0.5, 0.5, 0.5)))
    build.set_world((1.0, 1.0, 1.0))
    build.add_light("POINT", (2, -2, 2), energy=100.0)
    build.add_camera((0, -3, 3), (0, 0, 0), lens=35.0)
    for frame, turn in ((1, 0.0), (9, 1.5)):
        box.rotation_euler.z = turn
        box.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)
    if at_start or at_frames:
        text = bpy.data.texts.new("start.py")
        text.write(
            "import bpy, os, shutil, signal, time\n"
            + textwrap.dedent(at_start) + "\ndef at_frame(scene, *_):\n    pass\n"
            + textwrap.indent(textwrap.dedent(at_frames), "    ") + "\nbpy.app.handlers.render_pre.append(at_frame)\n"
        )  # fmt: skip
        text.use_module = True
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    return path


def wait_for(happened: Callable[[], bool], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def children(process: int) -> list[int]:
    path = Path(f"/proc/{process}/task/{process}/children")
    return [int(number) for number in path.read_text().split()] if path.exists() else []


def is_alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


# ---- the process that Blender is in ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("death", "words"),
    [
        ("import ctypes; ctypes.string_at(1)", "Blender crashed (SIGSEGV) while"),
        ("os.abort()", "Blender crashed (SIGABRT) while"),
        (
            "os.kill(os.getpid(), signal.SIGKILL)",
            "Blender was killed from outside (as happens where memory runs out) while",
        ),
        ("os._exit(0)", "Blender ended without a word while"),
    ],
    ids=["access", "abort", "kill", "exit"],
)
def test_a_crash_of_blender_is_a_sentence(folders: Folders, death: str, words: str) -> None:
    (folders.out / "a.png").write_text("the old picture")
    for where, scene in (
        ("reading the file", save(folders.top / "start.blend", at_start=death)),
        ("rendering", save(folders.top / "frame.blend", at_frames=death)),
    ):
        said = folders.render(scene, "-o", "a.png", "--enable-autoexec", status=1)
        assert said.splitlines()[-1].startswith(f"render: '{scene}' could not be rendered: {words} {where}; "), said
        assert (folders.out / "a.png").read_text() == "the old picture"


def test_frames_before_a_crash_are_kept(folders: Folders) -> None:
    death = "if scene.frame_current == 3: os.kill(os.getpid(), signal.SIGSEGV)"
    scene = save(folders.top / "a.blend", at_frames=death)
    said = folders.render(scene, "-o", "a.exr", "--frames", "1-5", "--enable-autoexec", status=1)
    assert "crashed (SIGSEGV) while rendering frame 3" in said
    assert folders.pictures() == ["a_0001.exr", "a_0002.exr"]
    assert all(read(folders.out / name).shape == (48, 64, 4) for name in folders.pictures())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_request_to_stop(folders: Folders, number: signal.Signals) -> None:
    """Of the command alone, as a batch system sends it."""
    scene = save(folders.top / "a.blend", at_frames="open('rendering', 'w').close()\ntime.sleep(60)")
    process = folders.start(scene, "--enable-autoexec", "-o", "a.png")
    wait_for((folders.out / "rendering").exists)
    process.send_signal(number)
    assert process.wait(30) == 128 + number
    assert process.communicate()[1].splitlines() == []
    assert folders.pictures() == ["rendering"] and folders.nothing_is_left()


def test_nothing_goes_on_after_a_kill(folders: Folders) -> None:
    """The command itself is killed: what it started ends, and tidies up."""
    scene = save(folders.top / "a.blend", at_frames="open('rendering', 'w').close()\ntime.sleep(60)")
    process = folders.start(scene, "--enable-autoexec", "-o", "a.png")
    wait_for((folders.out / "rendering").exists)
    (child,) = children(process.pid)
    process.kill()
    process.wait(30)
    wait_for(lambda: not is_alive(child), 30.0)
    assert folders.pictures() == ["rendering"] and folders.nothing_is_left()


# ---- animations --------------------------------------------------------------------------------------------------


def test_an_animation_goes_on_after_a_kill(folders: Folders) -> None:
    """All processes at once are killed in frame 4. What is there is whole, and only what is missing is rendered."""
    scene = save(folders.top / "whole.blend")
    folders.render(scene, "-o", "whole.exr", "--frames", "1-6")
    stuck = save(folders.top / "a.blend", at_frames="if scene.frame_current == 4: time.sleep(60)")
    process = folders.start(stuck, "-o", "a.exr", "--frames", "1-6", "--enable-autoexec", start_new_session=True)
    wait_for((folders.out / "a_0003.exr").exists)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait(30)
    done = [folders.out / f"a_000{frame}.exr" for frame in (1, 2, 3)]
    assert sorted(folders.out.glob("a_*")) == done
    written = [path.stat().st_mtime_ns for path in done]
    (folders.out / "a_0002.exr").unlink()  # a gap
    for path in folders.temporary.iterdir():
        path.rename(folders.top / path.name)  # nobody was left to tidy up
    said = folders.render(scene, "-o", "a.exr", "--frames", "1-6", "--skip-existing")
    assert said.splitlines() == [
        "2 of 6 frames are there already", *(f"wrote a_000{frame}.exr" for frame in (2, 4, 5, 6))
    ]
    assert [done[0].stat().st_mtime_ns, done[2].stat().st_mtime_ns] == [written[0], written[2]]
    for frame in range(1, 7):
        whole, again = (read(folders.out / f"{name}_000{frame}.exr") for name in ("whole", "a"))
        assert np.array_equal(whole, again), frame


def test_all_frames_are_there(folders: Folders) -> None:
    scene = save(folders.top / "a.blend")
    folders.render(scene, "-o", "a.png", "--frames", "1-2")
    said = folders.render(scene, "-o", "a.png", "--frames", "1-2", "--skip-existing", "--stats", "s.json")
    assert said.splitlines() == ["2 of 2 frames are there already"]


# ---- files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("extension", ["exr", "png", "jpg", "tif", "webp", "bmp", "tga", "hdr"])
def test_a_full_disk(folders: Folders, extension: str) -> None:
    """Files may not grow beyond half of what the picture needs: the old picture stays."""
    scene, path = save(folders.top / "a.blend"), folders.out / f"a.{extension}"
    folders.render(scene, "-o", path.name)
    whole = path.read_bytes()
    half = len(whole) // 2

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (half, half))

    for options in ([], ["--frames", "1-2"]):
        said = folders.render(scene, "-o", path.name, *options, status=1, preexec_fn=limit)
        assert said.splitlines()[-1].startswith("render: "), said
        assert "could not be" in said.splitlines()[-1]
        assert folders.pictures() == [path.name] and path.read_bytes() == whole


def test_a_disk_without_room_for_statistics(folders: Folders) -> None:
    scene = save(folders.top / "a.blend")
    (folders.out / "s.json").symlink_to("/dev/full")
    folders.render(scene, "-o", "a.png", "--stats", "s.json")
    assert (folders.out / "s.json").read_text().startswith("{"), "the file, not what it led to"


@pytest.mark.parametrize("options", [[], ["--frames", "1-2"]], ids=["still", "animation"])
def test_the_folder_goes_away(folders: Folders, options: list[str]) -> None:
    """It is made again where it may be; else the picture is named that could not be written."""
    gone = folders.out / "gone"
    scene = save(folders.top / "a.blend", at_frames=f"if scene.frame_current == 1: shutil.rmtree({str(gone)!r})")
    said = folders.render(scene, "-o", "gone/a.png", "--enable-autoexec", *options)
    assert said.splitlines() == [f"wrote gone/{path.name}" for path in sorted(gone.iterdir())]
    scene = save(folders.top / "a.blend", at_frames=f"shutil.rmtree({str(gone)!r}); open({str(gone)!r}, 'w').close()")
    said = folders.render(scene, "-o", "gone/a.png", "--enable-autoexec", *options, status=1)
    assert "could not be" in said.splitlines()[-1]
    assert folders.pictures() == ["gone"] and gone.read_text() == ""


def test_the_file_changes_while_it_is_rendered(folders: Folders) -> None:
    """It was read; what becomes of it does not matter."""
    scene = save(folders.top / "a.blend")
    folders.render(scene, "-o", "a.exr")
    for change in ("os.remove(PATH)", "open(PATH, 'wb').write(b'BLENDER-v999garbage')"):
        changing = save(folders.top / "b.blend", at_frames=change.replace("PATH", repr(str(folders.top / "b.blend"))))
        folders.render(changing, "-o", "b.exr", "--enable-autoexec")
        assert np.array_equal(read(folders.out / "a.exr"), read(folders.out / "b.exr"))


def test_two_renders_of_one_picture(folders: Folders) -> None:
    """The file is of one of them, and whole at any time."""
    scene = save(folders.top / "a.blend")
    folders.render(scene, "-o", "a.exr")
    whole = read(folders.out / "a.exr")
    processes = [folders.start(scene, "-o", "a.exr") for _ in range(2)]
    while any(process.poll() is None for process in processes):
        assert np.array_equal(read(folders.out / "a.exr"), whole)
        time.sleep(0.05)
    for process in processes:
        said = process.communicate()[1]
        assert (process.returncode, said) == (0, "wrote a.exr\n")
    assert folders.pictures() == ["a.exr"] and folders.nothing_is_left()


def test_leftovers_of_an_importer_are_no_scene(folders: Folders) -> None:
    """What is neither a file nor readable is named."""
    os.mkfifo(folders.top / "pipe.blend")
    assert "does not exist" in folders.render(folders.top / "pipe.blend", status=1)
    (folders.top / "folder.obj").mkdir()
    assert "does not exist" in folders.render(folders.top / "folder.obj", status=1)
