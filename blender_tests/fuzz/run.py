# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes damaged files from a seed, has them rendered, and says what became of them: ``scripts/fuzz``."""

from __future__ import annotations

import argparse
import json
import os
import random
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .changes import FILES, changed_bytes, changed_text

ROOT = Path(__file__).resolve().parents[2]
CASE_SECONDS = 60.0  # of CPU time: a file that takes longer hangs, or one that is not done after WAIT times as long
WAIT = 10.0


@dataclass
class Finding:
    """A file that broke something."""

    number: int
    name: str
    what: str
    ours: bool
    changed: list[str] = field(default_factory=list)


@dataclass
class Report:
    cases: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    findings: list[Finding] = field(default_factory=list)


class Worker:
    """A process of worker.py, started again when it has died."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None

    def _start(self) -> subprocess.Popen[bytes]:
        paths = os.pathsep.join((str(ROOT), str(ROOT / "scripts")))
        environ = {**os.environ, "PYTHONPATH": paths, "TMPDIR": str(self._folder), "CONELIGHT_TRACEBACK": ""}
        return subprocess.Popen(
            [sys.executable, "-m", "blender_tests.fuzz.worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, cwd=self._folder, env=environ,
        )  # fmt: skip

    def render(self, file: Path, seed: int | None, engine: str = "conelight") -> dict[str, Any]:
        """How rendering the file ended (worker.py), or ``died`` with what it was doing."""
        if self._process is None:
            self._process = self._start()
        process, last = self._process, {}
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write((json.dumps({"file": str(file), "seed": seed, "engine": engine}) + "\n").encode())
        process.stdin.flush()
        deadline, most = time.monotonic() + WAIT * CASE_SECONDS, cpu_seconds(process.pid) + CASE_SECONDS
        while True:
            ready: list[Any] = []
            while not ready and time.monotonic() < deadline and cpu_seconds(process.pid) < most:
                ready = select.select([process.stdout], [], [], 1.0)[0]
            line = process.stdout.readline() if ready else b""
            if not line:
                hangs = not ready
                self.end()
                code = process.returncode
                how = f"no end after {CASE_SECONDS:g} s of CPU time" if hangs else f"status {code}"
                if not hangs and code < 0:
                    how = signal.Signals(-code).name
                return {**last, "died": f"{how} while {last.get('doing', 'starting')}", "hangs": hangs}
            last = {**last, **json.loads(line)}
            if "end" in last:
                return last

    def end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
            for left in self._folder.glob("conelight-*"):
                shutil.rmtree(left, ignore_errors=True)


def cpu_seconds(pid: int) -> float:
    """CPU time of a process, user and system; 0 where it has ended. A busy machine makes no file hang."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def make_case(originals: Path, folder: Path, name: str, kind: str, chance: random.Random) -> tuple[Path, int | None]:
    """A changed copy of one of the originals, with what it refers to beside it; and the seed of changes to values."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(originals, folder)
    file = folder / name
    if kind == "values":
        return file, chance.randrange(1 << 31)
    target = next(folder.glob(f"image.{file.stem.removeprefix('image_')}")) if kind == "picture" else file
    change = changed_text if kind == "text" else changed_bytes
    target.write_bytes(change(target.read_bytes(), chance))
    return file, None


def is_contained(file: Path, folder: Path) -> tuple[bool, str]:
    """Renders a file that killed the worker with ``scripts/render``: whether that ends in a sentence, and which."""
    from .worker import OPTIONS, OURS

    command = [sys.executable, str(ROOT / "scripts" / "render"), str(file), "-o", str(folder / "again.exr"), *OPTIONS]
    try:
        result = subprocess.run(
            command, capture_output=True, text=True, timeout=WAIT * CASE_SECONDS, cwd=folder, stdin=subprocess.DEVNULL,
            check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return False, f"no end after {WAIT * CASE_SECONDS:g} s"
    said = (result.stderr.splitlines() or [""])[-1]
    is_refused = result.returncode == 1 and said.startswith("render: ") and not any(text in said for text in OURS)
    return result.returncode == 0 or is_refused, said


def fuzz(seconds: float, seed: int, kept: Path, only: str = "", most: int | None = None) -> Report:
    """Renders changed files for some time, ``most`` at most. Those that broke something are kept in ``kept``."""
    report = Report()
    names = [name for name in FILES if only in name]
    with tempfile.TemporaryDirectory(prefix="conelight-fuzz-") as top:
        originals, case = Path(top) / "originals", Path(top) / "case"
        originals.mkdir()
        subprocess.run(
            [sys.executable, "-m", "blender_tests.fuzz.originals", str(originals)], check=True, cwd=ROOT,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        worker, end = Worker(Path(top)), time.monotonic() + seconds
        while time.monotonic() < end and report.cases != most:
            number = report.cases
            chance = random.Random(f"{seed} {number}")
            name = names[number % len(names)] if chance.random() < 0.5 else chance.choice(names)
            file, value_seed = make_case(originals, case, name, FILES[name], chance)
            result = worker.render(file, value_seed)
            report.cases += 1
            what, ours = result.get("end", ""), bool(result.get("ours"))
            if "died" in result:
                with_cycles = worker.render(file, value_seed, "cycles")
                contained, said = is_contained(file, Path(top))
                what = f"{result['died']}; with Cycles: {with_cycles.get('died', 'not')}; scripts/render: {said}"
                ours = not contained or ("died" not in with_cycles and result.get("doing") == "rendering")
            report.ends[FILES[name] + " " + (result.get("died") or what.split(":")[0])] += 1
            if "died" in result or ours:
                report.findings.append(Finding(number, name, what, ours, result.get("changed", [])))
                shutil.copytree(case, kept / f"{seed}_{number}_{name}", dirs_exist_ok=True)
        worker.end()
    return report


def main(texts: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="fuzz", description="Renders damaged scene files and says which broke something. The exit status is 0 "
        "only if nothing of this project did; a crash that Cycles has too is Blender's, and ends in a sentence here.",
    )  # fmt: skip
    parser.add_argument("--seconds", type=float, default=60.0, help="how long (default: %(default)g)")
    parser.add_argument("--seed", type=int, default=0, help="another seed, other files (default: %(default)s)")
    parser.add_argument("--only", default="", help="files with this in their name")
    parser.add_argument("--keep", type=Path, default=Path("output/fuzz"), help="where files that broke something go")
    given = parser.parse_args(list(texts))
    report = fuzz(given.seconds, given.seed, given.keep, given.only)
    for finding in report.findings:
        owner = "OURS" if finding.ours else "Blender's"
        print(f"{owner}: case {finding.number} of seed {given.seed} ({finding.name}): {finding.what}")
        for line in finding.changed:
            print(f"    {line}")
    for end, count in report.ends.most_common():
        print(f"{count:6d}  {end}")
    print(f"{report.cases} files, {sum(finding.ours for finding in report.findings)} findings of ours")
    return 1 if any(finding.ours for finding in report.findings) else 0
