# SPDX-License-Identifier: GPL-3.0-or-later
"""From a checked command line to a report: the steps of ``scripts/benchmark``, inside the environment.

This process never imports Blender. Each scene is built, and rendered by each engine, in child processes: one that
crashes costs no more than the job it was at.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from conelight_cli.console import is_verbose
from conelight_cli.errors import FAILED, CommandError
from tqdm import tqdm

from .arguments import Arguments
from .catalogue import ROOT, SCENES, BenchmarkScene
from .job import Job
from .peers import PEERS
from .plan import Plan, plans
from .store import Store, filling

#: Order of the engines in a scene, as each has a process of its own.
ENGINES = ("cycles", "conelight", "eevee")


def main(arguments: Arguments) -> int:
    """Renders what is missing and writes the report. Returns the exit status."""
    if arguments.list:
        print("scenes: " + " ".join(SCENES) + "\n\npeers: " + " ".join(PEERS))
        return 0
    signal.signal(signal.SIGTERM, _interrupt)  # children are ended then too
    try:
        todo, missing = plans(arguments)
        for text in missing:
            say(text)
        store = Store(Path(arguments.cache).absolute())
        failures = render_all(store, todo)
        if set(arguments.only) != {"references"}:
            from . import report

            say(f"wrote {report.write(Path(arguments.output).absolute(), store, todo, failures)}")
        return FAILED if failures else 0
    except CommandError as error:
        say(f"benchmark: {error}")
        return error.status
    except KeyboardInterrupt:
        say("benchmark: stopped; what was finished is kept")
        return 130


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def say(text: str) -> None:
    """A message for the user; a progress bar moves aside for it."""
    tqdm.write(text, file=sys.stderr)


def render_all(store: Store, todo: Sequence[Plan]) -> list[str]:
    """Renders every job that has no result yet. Returns sentences about those that failed."""
    failures: list[str] = []
    waiting = [(plan, [job for job in plan.jobs if store.result(plan.scene, job) is None]) for plan in todo]
    with tqdm(total=sum(len(jobs) for _, jobs in waiting), file=sys.stderr, disable=None, unit="job") as bar:
        for plan, jobs in waiting:
            if not jobs:
                continue
            bar.set_postfix_str(plan.scene.name)
            try:
                build(store, plan.scene)
            except CommandError as error:
                failures.append(str(error))
                say(str(error))
                bar.update(len(jobs))
                continue
            jobs.sort(key=lambda job: (ENGINES.index(job.engine), job.process))
            for _, alike in itertools.groupby(jobs, key=lambda job: job.process):
                failures += render(store, plan.scene, list(alike), bar)
    return failures


def build(store: Store, scene: BenchmarkScene) -> None:
    """Writes the file of a scene, if it is not there. Raises CommandError."""
    folder = store.scene_file(scene).parent
    if folder.exists():
        return
    with filling(folder) as place:
        status, said = run_child(["conelight_benchmark.build_scene", scene.name, str(place)])
        if status or not (place / store.scene_file(scene).name).is_file():
            raise CommandError(f"scene '{scene.name}' could not be built: {last_line(said)}")


def render(store: Store, scene: BenchmarkScene, jobs: Sequence[Job], bar: tqdm) -> list[str]:
    """Renders jobs that one process can do, in a new one again after one that failed. Returns what is to be said of
    those."""
    failures: list[str] = []
    left = list(jobs)

    def count() -> None:
        """Takes what is finished off the list; a worker goes through it in order."""
        while left and store.result(scene, left[0]) is not None:
            del left[0]
            bar.update()

    while left:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "jobs.json"
            file.write_text(json.dumps({
                "scene": str(store.scene_file(scene)),
                "jobs": [{"job": job.as_dict(), "folder": str(store.result_folder(scene, job))} for job in left],
            }), encoding="utf-8")
            _, said = run_child(["conelight_benchmark.worker", str(file)], count)
        if left:
            failures.append(f"scene '{scene.name}': {left[0].engine} gave no picture: {last_line(said)}")
            say(failures[-1])
            del left[0]
            bar.update()
    return failures


def run_child(arguments: Sequence[str], while_waiting: Callable[[], None] = lambda: None) -> tuple[int, str]:
    """Runs a module of this project in a new Python. Returns its exit status and what it printed."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "scripts")])}
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as output:
        child = subprocess.Popen(
            [sys.executable, "-m", *arguments], stdin=subprocess.DEVNULL, env=environment, start_new_session=True,
            stdout=None if is_verbose() else output, stderr=None if is_verbose() else subprocess.STDOUT,
        )
        try:
            while child.poll() is None:
                time.sleep(0.2)
                while_waiting()
        finally:
            if child.poll() is None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(child.pid, signal.SIGTERM)
                child.wait()
        while_waiting()
        output.seek(0)
        return child.returncode, output.read()


def last_line(text: str) -> str:
    """The last line that says something, such as the error of a traceback."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "it said nothing"
