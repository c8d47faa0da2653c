# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/test: what runs where, and that nothing that goes wrong is counted as passed."""

from __future__ import annotations

import contextlib
import pathlib
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future

import pytest
from conelight_test import runner


@pytest.fixture
def tests(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    """A folder of tests of every group."""
    folder = tmp_path / "blender_tests"
    for name in ("unit/test_a.py", "unit/test_b.py", "passes/test_c.py", "renders/test_d.py", "renders/test_e.py"):
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("def test_it(): pass\n")
    monkeypatch.setattr(runner, "ROOT", str(tmp_path))
    monkeypatch.setattr(runner, "TESTS", str(folder))
    return folder


def test_each_file_of_renders_has_its_process(tests: pathlib.Path) -> None:
    assert [run.targets for run in runner.plan([], False)] == [
        ("blender_tests/unit/test_a.py", "blender_tests/unit/test_b.py"), ("blender_tests/passes/test_c.py",),
        ("blender_tests/renders/test_d.py",), ("blender_tests/renders/test_e.py",),
    ]


def test_pass_tests_run_again_on_the_second_driver(tests: pathlib.Path) -> None:
    runs = [run for run in runner.plan([], True) if run.targets == ("blender_tests/passes/test_c.py",)]
    assert [run.environ for run in runs] == [{}, runner.ZINK]


def test_targets_are_told_from_options(tests: pathlib.Path) -> None:
    one = str(tests / "renders" / "test_d.py") + "::test_it"
    assert runner.split([one, "-k", "word", "-x"]) == ([one], ["-k", "word", "-x"])
    assert [run.targets for run in runner.plan([one], False)] == [("blender_tests/renders/test_d.py::test_it",)]


@pytest.mark.parametrize(
    "text, line, status",
    [
        ("def test_it(): pass", "1 passed, 0 failed, 0 skipped", 0),
        ("def test_it(): assert 0", "0 passed, 1 failed, 0 skipped", 1),
        ("def test_it(no_such_fixture): pass", "0 passed, 1 failed, 0 skipped", 1),
        ("import pytest\ndef test_it(): pytest.skip('why')", "0 passed, 0 failed, 1 skipped", 1),
        ("raise RuntimeError", "0 passed, 1 failed, 0 skipped", 1),
        ("import os\ndef test_it(): os.abort()", "0 passed, 1 failed, 0 skipped", 1),
        ("nothing = 1", "0 passed, 0 failed, 0 skipped", 1),
    ],
)
def test_what_happens_is_counted(tests: pathlib.Path, text: str, line: str, status: int) -> None:
    file = tests / "unit" / "test_a.py"
    file.write_text(text + "\n")
    totals = runner.execute(runner.Run("one", (str(file),)), sys.executable, ["-q", "-p", "no:cacheprovider"])
    assert totals.line() == line
    assert totals.status() == status


@pytest.mark.parametrize("jobs", ["", "3"])
def test_processes_side_by_side_say_what_they_have_to_in_one_piece(
    jobs: str, tests: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CONELIGHT_JOBS", jobs)
    monkeypatch.delenv("CONELIGHT_ALL_PYTHONS", raising=False)
    monkeypatch.delenv("CONELIGHT_ALL_DRIVERS", raising=False)
    for name in ("d", "e"):
        file = tests / "renders" / f"test_{name}.py"
        says = f"print('{name}', flush=True); time.sleep(0.2)"
        file.write_text(f"import time\ndef test_it():\n    for _ in range(5): {says}\n")
    assert runner.main([str(tests / "renders"), "-s", "-q", "-p", "no:cacheprovider"]) == 0
    said = capfd.readouterr().out.splitlines()
    letters = "".join(line.strip(". ") for line in said if line.strip(". ") in ("d", "e"))
    assert letters in ("dddddeeeee", "eeeeeddddd")
    assert said[-1] == "2 passed, 0 failed, 0 skipped"


def test_a_system_that_is_being_set_up_is_left_when_tests_end(
    monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path
) -> None:
    monkeypatch.delenv("CONELIGHT_BLENDER_WINDOW", raising=False)
    monkeypatch.setenv("CONELIGHT_WINDOW", "1")
    monkeypatch.setattr(runner.window, "FOLDER", str(tmp_path))
    for name in ("SYSTEM", "READY", "LOG"):
        monkeypatch.setattr(runner.window, name, str(tmp_path / name.lower()))
    monkeypatch.setattr(runner.window.os, "geteuid", lambda: 0)
    monkeypatch.setattr(runner.window.shutil, "which", lambda name: name)
    monkeypatch.setattr(runner.window, "_mirror", lambda: "nowhere")
    run = runner.window._run
    monkeypatch.setattr(runner.window, "_run", lambda command, *rest: run(["sleep", "60"], *rest))
    start = time.monotonic()
    with runner.window.being_set_up() as system:
        time.sleep(0.5)
    assert time.monotonic() - start < 20.0
    with pytest.raises(runner.window.NoWindow, match="failed"):
        system.result()


def test_without_a_window_the_reason_is_said_and_nothing_fails(
    tests: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tests / "window" / "test_f.py"
    file.parent.mkdir()
    file.write_text("def test_it(): assert 0\n")
    runs = [run for run in runner.plan([], False) if run.needs_window]
    assert [run.targets for run in runs] == [("blender_tests/window/test_f.py",)]

    @contextlib.contextmanager
    def environment(_: Future[None]) -> Iterator[dict[str, str]]:
        raise runner.window.NoWindow("there is no display")
        yield {}

    monkeypatch.setattr(runner.window, "environment", environment)
    totals = runner.run_in_window(runs, sys.executable, [], Future())
    assert totals == runner.Totals()
    assert capsys.readouterr().out == "Not tested in a window: there is no display.\n"


def test_no_system_is_set_up_by_others_than_root(monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path) -> None:
    monkeypatch.delenv("CONELIGHT_BLENDER_WINDOW", raising=False)
    monkeypatch.setattr(runner.window, "READY", str(tmp_path / "ready"))
    monkeypatch.setattr(runner.window.os, "geteuid", lambda: 1000)
    for asked, answer in (("", "CONELIGHT_WINDOW=1 has"), ("1", "by root on Linux only")):
        monkeypatch.setenv("CONELIGHT_WINDOW", asked)
        with runner.window.being_set_up() as system, pytest.raises(runner.window.NoWindow, match=answer):
            with runner.window.environment(system):
                pass


def test_what_all_pythons_and_drivers_say_alike_is_asked_once(
    tests: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setenv("CONELIGHT_ALL_DRIVERS", "1")
    monkeypatch.delenv("CONELIGHT_JOBS", raising=False)  # one after the other
    monkeypatch.setattr(runner, "has_lavapipe", lambda: True)
    monkeypatch.setattr(runner, "pythons", lambda: ["one", "two"])
    monkeypatch.setattr(runner, "run_in_window", lambda *_: runner.Totals())
    monkeypatch.setattr(runner, "announced", lambda *run: asked.append(run) or runner.Totals())
    runner.main([str(tests / "passes")])
    assert [(bool(run.environ), python, options) for run, python, options in asked] == [
        (False, "one", []), (True, "one", runner.AGAIN), (False, "two", runner.AGAIN),
    ]  # fmt: skip
