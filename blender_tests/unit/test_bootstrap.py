# SPDX-License-Identifier: GPL-3.0-or-later
"""The environment that the scripts make for themselves: found, checked, made once, and safe when interrupted."""

from __future__ import annotations

import ast
import os
import pathlib
import re
import stat
import subprocess
import sys
import threading
import time
import tomllib

import _bootstrap
import pytest

ROOT = pathlib.Path(_bootstrap.ROOT)
HERE = f"{sys.version_info[0]}.{sys.version_info[1]}"
SCRIPTS = ("render", "test", "benchmark", "build_extension", "update_readme")


@pytest.fixture
def checkout(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    """An empty checkout with a lock file, in which set-up can be tried."""
    monkeypatch.setattr(_bootstrap, "ROOT", str(tmp_path))
    monkeypatch.setattr(_bootstrap.shutil, "which", lambda name: None)  # no uv
    (tmp_path / "requirements").mkdir()
    (tmp_path / "requirements" / f"py{HERE.replace('.', '')}.lock").write_text("a==1\n")
    return tmp_path


def fake_install(python: str, version: str) -> None:
    """Leaves what a real installation leaves, as far as the bootstrap looks at it."""
    path = pathlib.Path(_bootstrap.environment_python(version))
    path.parent.mkdir(parents=True)
    path.write_text("#!/bin/sh\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


# System libraries


def test_nothing_is_missing_where_everything_loads() -> None:
    assert _bootstrap.missing_libraries(lambda name: True) == []


def test_a_missing_library_is_named_with_its_packages(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        _bootstrap.check_system_libraries(lambda name: name not in ("libXi.so.6", "libEGL.so.1"))
    said = capsys.readouterr().err
    assert end.value.code == 1
    assert "libXi.so.6  (Debian: libxi6; Fedora: libXi)" in said
    assert "apt-get install libegl1 libxi6" in said
    assert "dnf install libglvnd-egl libXi" in said
    assert "libX11" not in said


def test_a_missing_egl_driver_is_named(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    vendor = tmp_path / "50_mesa.json"
    vendor.write_text('{"ICD": {"library_path": "libEGL_vendor.so.0"}}')
    monkeypatch.delenv("__EGL_VENDOR_LIBRARY_FILENAMES", raising=False)
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", str(tmp_path))
    assert _bootstrap.missing_libraries(lambda name: True) == []
    with pytest.raises(SystemExit):
        _bootstrap.check_system_libraries(lambda name: name != "libEGL_vendor.so.0")
    assert "an EGL driver  (Debian: libegl-mesa0" in capsys.readouterr().err


def test_a_broken_description_of_an_egl_driver_is_no_driver(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "10_broken.json").write_text("{")
    (tmp_path / "20_other.json").write_text('["ICD"]')
    monkeypatch.delenv("__EGL_VENDOR_LIBRARY_FILENAMES", raising=False)
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", str(tmp_path))
    assert not _bootstrap.has_egl_driver(lambda name: True)


def test_a_library_that_is_not_there_does_not_load() -> None:
    assert not _bootstrap.can_load("libconelight-is-not-there.so.1")


# Python


def test_the_running_python_is_taken() -> None:
    assert _bootstrap.version_of(_bootstrap.running_python()) == HERE


def test_a_forced_python_must_run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("CONELIGHT_PYTHON", "/not/there/python")
    with pytest.raises(SystemExit):
        _bootstrap.choose_python()
    assert "CONELIGHT_PYTHON is '/not/there/python', which does not run" in capsys.readouterr().err


def test_a_forced_python_must_have_a_blender(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    old = tmp_path / "python3.12"
    old.write_text("#!/bin/sh\necho 3.12\n")
    old.chmod(0o755)
    monkeypatch.setenv("CONELIGHT_PYTHON", str(old))
    with pytest.raises(SystemExit):
        _bootstrap.choose_python()
    said = capsys.readouterr().err
    assert "Python 3.12" in said and "3.11" in said and "3.13" in said


def test_without_a_fitting_python_one_sentence_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("CONELIGHT_PYTHON", raising=False)
    monkeypatch.setattr(_bootstrap.sys, "version_info", (3, 12, 1))
    monkeypatch.setattr(_bootstrap, "interpreters", lambda version: iter(()))
    with pytest.raises(SystemExit):
        _bootstrap.choose_python()
    said = capsys.readouterr().err
    assert "this is Python 3.12; Python 3.11 (Blender 4.5 LTS) or Python 3.13 (Blender 5.2 LTS) is needed" in said


def test_shims_that_do_not_run_are_passed_over(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shim, real = tmp_path / "shim", tmp_path / "real"
    shim.write_text("#!/bin/sh\nexit 127\n")
    real.write_text("#!/bin/sh\necho 3.99\n")
    for file in (shim, real):
        file.chmod(0o755)
    monkeypatch.setattr(_bootstrap, "interpreters", lambda version: iter([str(shim), str(real)]))
    assert _bootstrap.find_python("3.99") == str(real)


@pytest.mark.parametrize("name", ["_bootstrap.py", "conelight_cli/arguments.py", *SCRIPTS])
def test_what_runs_before_the_setup_is_readable_for_old_pythons(name: str) -> None:
    ast.parse((ROOT / "scripts" / name).read_text(encoding="utf-8"), feature_version=(3, 7))


@pytest.mark.parametrize("name", ["render", "test", "build_extension"])
def test_help_needs_no_setup(name: str, tmp_path: pathlib.Path) -> None:
    """A copy of the scripts alone, run by the bare Python, answers and makes no environment."""
    subprocess.run(["cp", "-r", str(ROOT / "scripts"), str(tmp_path / "scripts")], check=True)
    environ = {**os.environ, "PATH": os.path.dirname(_bootstrap.running_python()) + ":/usr/bin:/bin"}
    result = subprocess.run(
        [_bootstrap.running_python(), str(tmp_path / "scripts" / name), "--help"],
        capture_output=True, text=True, env=environ, timeout=60, check=False,
    )
    assert result.returncode == 0, result.stderr
    assert "usage: " + name in result.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scripts"]


# The environment


def test_setup_happens_once(checkout: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def install(python: str, version: str) -> None:
        calls.append(version)
        fake_install(python, version)

    monkeypatch.setattr(_bootstrap, "install_with_pip", install)
    for _ in range(2):
        _bootstrap.set_up(sys.executable, HERE)
    assert calls == [HERE]
    assert _bootstrap.is_complete(HERE)


def test_another_lock_file_makes_another_environment(checkout: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_bootstrap, "install_with_pip", fake_install)
    _bootstrap.set_up(sys.executable, HERE)
    leftover = checkout / f".venv-{HERE}" / "leftover"
    leftover.touch()
    pathlib.Path(_bootstrap.lock_file(HERE)).write_text("a==2\n")
    assert not _bootstrap.is_complete(HERE)
    _bootstrap.set_up(sys.executable, HERE)
    assert _bootstrap.is_complete(HERE)
    assert not leftover.exists()


def test_an_interrupted_setup_is_not_complete_and_starts_over(
    checkout: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(python: str, version: str) -> None:
        fake_install(python, version)
        (checkout / f".venv-{HERE}" / "half").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(_bootstrap, "install_with_pip", interrupted)
    with pytest.raises(KeyboardInterrupt):
        _bootstrap.set_up(sys.executable, HERE)
    assert not _bootstrap.is_complete(HERE)
    monkeypatch.setattr(_bootstrap, "install_with_pip", fake_install)
    _bootstrap.set_up(sys.executable, HERE)
    assert _bootstrap.is_complete(HERE)
    assert not (checkout / f".venv-{HERE}" / "half").exists()


def test_two_at_once_make_one_environment(
    checkout: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = []

    def slow(python: str, version: str) -> None:
        calls.append(version)
        time.sleep(0.3)
        fake_install(python, version)

    monkeypatch.setattr(_bootstrap, "install_with_pip", slow)
    threads = [threading.Thread(target=_bootstrap.set_up, args=(sys.executable, HERE)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert calls == [HERE]
    assert _bootstrap.is_complete(HERE)
    assert "waiting for it" in capsys.readouterr().err


def test_a_setup_that_was_killed_is_mended(checkout: pathlib.Path) -> None:
    """Its installer lives on and writes: the next one waits for it, and starts over."""
    folder, step = checkout / f".venv-{HERE}", checkout / "step"
    installer = f"""
import pathlib, sys, time
folder = pathlib.Path(sys.argv[1])
(folder / "bin").mkdir(parents=True)
pathlib.Path({str(step)!r}).touch()
time.sleep(1.0)
(folder / ("late " + sys.argv[2])).touch()
(folder / "bin" / "python").touch(mode=0o755)
"""
    code = f"""
import sys
import _bootstrap
_bootstrap.ROOT = {str(checkout)!r}
_bootstrap.shutil.which = lambda name: None
def install(python, version):
    command = [sys.executable, "-c", {installer!r}, _bootstrap.environment_folder(version), sys.argv[1]]
    if _bootstrap.run(command) != 0:
        sys.exit("the installer found what it did not expect")
_bootstrap.install_with_pip = install
_bootstrap.set_up(sys.executable, {HERE!r})
"""
    environ = {**os.environ, "PYTHONPATH": str(ROOT / "scripts")}
    first = subprocess.Popen([sys.executable, "-c", code, "first"], stderr=subprocess.DEVNULL, env=environ)
    for _ in range(1000):
        if step.exists():
            break
        time.sleep(0.02)
    first.kill()
    first.wait()
    assert not _bootstrap.is_complete(HERE) and not list(folder.glob("late *"))
    second = subprocess.run(
        [sys.executable, "-c", code, "second"], capture_output=True, text=True, env=environ, timeout=60, check=False
    )
    assert second.returncode == 0, second.stderr
    assert "waiting for it" in second.stderr
    assert _bootstrap.is_complete(HERE)
    assert [path.name for path in folder.glob("late *")] == ["late second"]


def test_an_environment_whose_python_is_gone_is_not_complete(
    checkout: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_bootstrap, "install_with_pip", fake_install)
    _bootstrap.set_up(sys.executable, HERE)
    os.remove(_bootstrap.environment_python(HERE))
    assert not _bootstrap.is_complete(HERE)


@pytest.mark.parametrize("is_there", [True, False])
def test_nothing_is_installed_through_a_link(
    is_there: bool,
    checkout: pathlib.Path,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "environment"
    if is_there:
        elsewhere.mkdir()
        (elsewhere / _bootstrap.STAMP_NAME).write_text("of another lock file\n")
    (checkout / f".venv-{HERE}").symlink_to(elsewhere)
    monkeypatch.setattr(_bootstrap, "install_with_pip", fake_install)
    with pytest.raises(SystemExit) as end:
        _bootstrap.set_up(sys.executable, HERE)
    assert end.value.code == 1
    assert str(elsewhere) in capsys.readouterr().err
    assert elsewhere.exists() == is_there
    assert not is_there or [path.name for path in elsewhere.iterdir()] == [_bootstrap.STAMP_NAME]


def test_a_python_without_venv_names_the_package(
    checkout: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(_bootstrap, "run", lambda command, **options: 1)
    with pytest.raises(SystemExit) as end:
        _bootstrap.install_with_pip("/usr/bin/python3.11", "3.11")
    assert end.value.code == 1
    assert "apt-get install python3.11-venv" in capsys.readouterr().err


def test_pip_takes_over_where_uv_fails(
    checkout: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(_bootstrap.shutil, "which", lambda name: "/bin/false" if name == "uv" else None)
    monkeypatch.setattr(_bootstrap, "install_with_pip", fake_install)
    _bootstrap.set_up(sys.executable, HERE)
    assert _bootstrap.is_complete(HERE)
    assert "trying again with pip" in capsys.readouterr().err


def test_the_users_python_settings_stay_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/somewhere")
    environ = _bootstrap.clean_environ()
    assert "PYTHONPATH" not in environ
    assert environ["PYTHONNOUSERSITE"] == "1"


# What is installed


@pytest.mark.parametrize("version", sorted(_bootstrap.BLENDER_OF_PYTHON))
def test_lock_files_pin_everything_with_hashes(version: str) -> None:
    text = pathlib.Path(_bootstrap.lock_file(version)).read_text(encoding="utf-8")
    entry = r"^([A-Za-z0-9_.-]+)==\S+ \\\n(?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+"
    entries = re.findall(entry, text, re.MULTILINE)
    names = {name.lower() for name in entries}
    assert {"bpy", "moderngl", "glcontext", "numpy", "pytest", "openimageio", "usd-core", "pip"} <= names
    assert len(re.findall(r"^[A-Za-z0-9]", text, re.MULTILINE)) == len(entries), "a line without version or hashes"
    assert "://" not in text, "a lock file must not say where packages come from"


def test_the_versions_agree() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    manifest = tomllib.loads((ROOT / "addon" / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert manifest["version"] == project["version"]
    assert manifest["license"] == ["SPDX:" + project["license"]]
