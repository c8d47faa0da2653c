# SPDX-License-Identifier: GPL-3.0-or-later
"""Which tests run in which process, and the sum of what they found.

Blender is one global state for each process, so every file of ``renders`` has a process of its own.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import glob
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TextIO

import _bootstrap

from . import window

ROOT = _bootstrap.ROOT
TESTS = os.path.join(ROOT, "blender_tests")
WORKER = os.path.join(ROOT, "scripts", "conelight_test", "worker.py")
PROCESS_LIMIT = 1500.0  # seconds; a process that takes longer hangs

#: With a second Python or GL, what says the same with all of them is left out.
AGAIN = ["-m", "not once"]

#: Environment of a second GL implementation: OpenGL by zink on Vulkan by lavapipe, both of Mesa. On the CPU zink
#: compiles uniforms that bound loops into programs, and then runs programs compiled for other values (Mesa 22.3).
ZINK = {"LIBGL_ALWAYS_SOFTWARE": "1", "MESA_LOADER_DRIVER_OVERRIDE": "zink", "ZINK_INLINE_UNIFORMS": "0"}

NO_TESTS = 5  # pytest's exit status when it found none


@dataclass(frozen=True)
class Run:
    """One pytest process."""

    title: str
    targets: tuple[str, ...]
    environ: dict[str, str] = field(default_factory=dict)
    needs_window: bool = False


@dataclass
class Totals:
    passed: int = 0
    failed: int = 0
    skipped: int = 0

    def add(self, other: Totals) -> None:
        self.passed += other.passed
        self.failed += other.failed
        self.skipped += other.skipped

    def line(self) -> str:
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"

    def status(self) -> int:
        """Exit status: 0 only if something passed and nothing failed."""
        return 0 if self.passed and not self.failed else 1


def has_lavapipe() -> bool:
    folders = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
    return any(glob.glob(os.path.join(folder, "lvp_icd*.json")) for folder in folders)


def split(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Arguments of pytest as (targets: files and folders under blender_tests, everything else)."""
    targets, options = [], []
    for argument in arguments:
        path = os.path.abspath(argument.split("::")[0])
        is_test = os.path.exists(path) and (path == TESTS or path.startswith(TESTS + os.sep))
        (targets if is_test and not argument.startswith("-") else options).append(argument)
    return targets, options


def files_under(folder: str) -> list[str]:
    """Test files in a folder, by name."""
    return sorted(glob.glob(os.path.join(folder, "**", "test_*.py"), recursive=True))


def plan(targets: Sequence[str], second_driver: bool) -> list[Run]:
    """Processes for some targets (none: everything)."""
    by_group: dict[str, list[str]] = {"unit": [], "passes": [], "renders": [], "window": []}
    for target in targets or [os.path.join(TESTS, name) for name in by_group]:
        path, separator, rest = target.partition("::")
        path = os.path.abspath(path)
        for file in [path] if os.path.isfile(path) else files_under(path):
            group = os.path.relpath(file, TESTS).split(os.sep)[0]
            by_group.setdefault(group, []).append(os.path.relpath(file, ROOT) + separator + rest)
    runs = []
    for group, files in by_group.items():
        if group in ("unit", "passes") and files:
            runs.append(Run(f"blender_tests/{group}", tuple(files)))
            if group == "passes" and second_driver:
                runs.append(Run(f"blender_tests/{group} on zink", tuple(files), ZINK))
        else:
            runs += [Run(file, (file,), needs_window=group == "window") for file in files]
    return runs


def execute(run: Run, python: str, options: Sequence[str], output: TextIO | None = None) -> Totals:
    """Runs one process and counts. One that dies or hangs counts as a failed test.

    ``output``: where what it prints goes, if not where this process prints.
    """
    with tempfile.TemporaryDirectory(prefix="conelight-test-") as folder:
        results = os.path.join(folder, "results.json")
        environ = {
            **_bootstrap.clean_environ(), **run.environ,
            "BLENDER_USER_RESOURCES": os.path.join(folder, "blender"), "PYTHONUNBUFFERED": "1",
            "CONELIGHT_TRACEBACK": "",  # tests look at what users see
        }
        os.mkdir(environ["BLENDER_USER_RESOURCES"])
        environ.update(dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder))  # nobody tidies up after os._exit
        try:
            process = subprocess.run(
                [python, WORKER, results, *options, *run.targets], cwd=ROOT, env=environ, timeout=PROCESS_LIMIT,
                stdin=subprocess.DEVNULL, stdout=output, stderr=output, check=False,
            )
            end = f"exit status {process.returncode}"
        except subprocess.TimeoutExpired:
            end = f"no end after {PROCESS_LIMIT:g} s"
        counts = None
        with contextlib.suppress(OSError, ValueError), open(results, encoding="ascii") as file:
            counts = json.load(file)
    if counts is None:
        print(f"{run.title}: the test process died ({end})", file=output, flush=True)
        return Totals(failed=1)
    status = counts.pop("status")
    totals = Totals(**counts)
    if status not in (0, NO_TESTS) and not totals.failed:
        print(f"{run.title}: pytest ended with status {status}", file=output, flush=True)
        totals.failed += 1
    return totals


def lint() -> Totals:
    """Ruff and mypy; each that finds something counts as a failed test."""
    totals = Totals()
    for command in (["ruff", "check"], ["mypy"]):
        title = " ".join(command)
        print(f"== {title}", flush=True)
        if subprocess.run([sys.executable, "-m", *command], cwd=ROOT, check=False).returncode != 0:
            print(f"{title}: see above", flush=True)
            totals.failed += 1
    return totals


def pythons() -> list[str]:
    """Environments to test in: this one, and with CONELIGHT_ALL_PYTHONS=1 the others this machine has a Python for."""
    found = [sys.executable]
    if os.environ.get("CONELIGHT_ALL_PYTHONS", "") in ("", "0"):
        return found
    for version in _bootstrap.BLENDER_OF_PYTHON:
        if version == f"{sys.version_info[0]}.{sys.version_info[1]}":
            continue
        python = _bootstrap.find_python(version)
        if python is None:
            blender = _bootstrap.BLENDER_OF_PYTHON[version]
            print(f"There is no Python {version} on this machine: not tested with {blender}.", flush=True)
            continue
        _bootstrap.set_up(python, version)
        found.append(_bootstrap.environment_python(version))
    return found


def main(arguments: Sequence[str]) -> int:
    """Runs the tests and prints one closing line. Returns the exit status."""
    targets, options = split(arguments)
    total = lint() if not arguments else Totals()
    second_driver = os.environ.get("CONELIGHT_ALL_DRIVERS", "") not in ("", "0")
    if second_driver and not has_lavapipe():
        print("There is no lavapipe on this machine (Debian: mesa-vulkan-drivers; Fedora: mesa-vulkan-drivers): "
              "pass tests run on one OpenGL only.", flush=True)
        second_driver = False
    found = pythons()
    with contextlib.ExitStack() as stack:
        work: list[Callable[[], Totals]] = []
        for number, python in enumerate(found):
            runs = plan(targets, second_driver and number == 0)
            for run in runs:
                if not run.needs_window:
                    again = [] if number == 0 and not run.environ else AGAIN
                    work.append(functools.partial(announced, run, python, [*again, *options]))
            in_window = [run for run in runs if run.needs_window]
            if number == 0 and in_window:  # it uses another Blender, with a Python of its own
                system = stack.enter_context(window.being_set_up())
                work.append(functools.partial(run_in_window, in_window, python, options, system))
        pool = stack.enter_context(ThreadPoolExecutor(process_count()))
        stack.callback(pool.shutdown, cancel_futures=True)  # after an interruption
        for one in [pool.submit(each) for each in work]:
            total.add(one.result())
    print(total.line(), flush=True)
    return total.status()


def process_count() -> int:
    """Test processes at the same time."""
    return max(1, int(os.environ.get("CONELIGHT_JOBS") or 1))


def announced(run: Run, python: str, options: Sequence[str]) -> Totals:
    """As :func:`execute`, and says what it does; of several at the same time each says all in the end."""
    title = f"== {run.title}  ({_bootstrap.version_of(python)})"
    if process_count() == 1:
        print(title, flush=True)
        return execute(run, python, options)
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as said:
        totals = execute(run, python, options, said)
        said.seek(0)
        with _saying:
            print(title, said.read(), sep="\n", flush=True)
    return totals


_saying = threading.Lock()


def run_in_window(runs: Sequence[Run], python: str, options: Sequence[str], system: Future[None]) -> Totals:
    """Tests in a window, one after the other, as they press keys; where there is none says why not."""
    totals = Totals()
    try:
        with window.environment(system) as environ:
            for run in runs:
                totals.add(announced(dataclasses.replace(run, environ=environ), python, options))
    except window.NoWindow as reason:
        print(f"Not tested in a window: {reason}.", flush=True)
    return totals
