# SPDX-License-Identifier: GPL-3.0-or-later
"""One zip for Blender's extension system: the add-on, its shaders, and wheels of what it imports beside NumPy."""

from __future__ import annotations

import glob
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence

import _bootstrap

ROOT = _bootstrap.ROOT
BUILD = os.path.join(ROOT, "build")
DIST = os.path.join(ROOT, "dist")

#: Packages the add-on imports that Blender does not bring.
WHEELS = ("moderngl", "glcontext")
#: Platform of the manifest -> tags of the wheels that run there.
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
}


class BuildError(Exception):
    """A sentence for the user."""


def locked(lock: str, names: Sequence[str]) -> str:
    """The entries of some packages in a lock file's text, with their hashes. Raises BuildError if one is missing."""
    entries = []
    for name in names:
        match = re.search(rf"^{re.escape(name)}==(?:.*\\\n)*.*\n", lock, re.MULTILINE)
        if match is None:
            raise BuildError(f"the lock file has no package '{name}'; scripts/lock writes it anew")
        entries.append(match.group())
    return "".join(entries)


def download_wheels(version: str, platform: str) -> list[str]:
    """Paths of the wheels for a Python and a platform, from the cache under build/ or else downloaded."""
    with open(_bootstrap.lock_file(version), encoding="utf-8") as file:
        requirements = locked(file.read(), WHEELS)
    key = hashlib.sha256(requirements.encode()).hexdigest()[:12]
    folder = os.path.join(BUILD, "wheels", f"{platform}-{version}-{key}")
    if not os.path.isdir(folder):
        os.makedirs(os.path.dirname(folder), exist_ok=True)
        with tempfile.TemporaryDirectory(dir=os.path.dirname(folder)) as partial:
            wanted = os.path.join(partial, "requirements.txt")
            with open(wanted, "w", encoding="utf-8") as file:
                file.write(requirements)
            made = os.path.join(partial, "wheels")
            command = [
                sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--no-deps", "--require-hashes",
                "--only-binary=:all:", "--implementation", "cp", "--python-version", version, "--dest", made,
                "--requirement", wanted,
            ]
            for tag in PLATFORMS[platform]:
                command += ["--platform", tag]
            if subprocess.run(command, stdout=_bootstrap.STDERR, check=False).returncode != 0:
                raise BuildError(f"the wheels for {platform}, Python {version} could not be downloaded; see above")
            if len(os.listdir(made)) != len(WHEELS):
                brought = ", ".join(sorted(os.listdir(made)))
                raise BuildError(f"pip brought {brought} for {platform}, Python {version}: not one wheel each")
            os.replace(made, folder)
    return sorted(glob.glob(os.path.join(folder, "*.whl")))


def gather(folder: str) -> None:
    """Copies everything that is shipped into ``folder``."""
    unwanted = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")
    shutil.copytree(os.path.join(ROOT, "addon"), folder, ignore=unwanted, dirs_exist_ok=True)
    shaders = os.path.join(folder, "shaders")
    shutil.copytree(os.path.join(ROOT, "shaders"), shaders, ignore=shutil.ignore_patterns("tests", ".*"))
    shutil.copy(os.path.join(ROOT, "LICENSE"), folder)
    wheels = os.path.join(folder, "wheels")
    os.mkdir(wheels)
    for version in sorted(_bootstrap.BLENDER_OF_PYTHON):
        for platform in PLATFORMS:
            for wheel in download_wheels(version, platform):
                shutil.copy(wheel, wheels)  # a wheel that serves several Pythons is there once
    list_wheels(os.path.join(folder, "blender_manifest.toml"), sorted(os.listdir(wheels)))


def list_wheels(manifest: str, names: Sequence[str]) -> None:
    """Writes the names of the wheels into a manifest. Raises BuildError if it has no empty list of them."""
    with open(manifest, encoding="utf-8") as file:
        text = file.read()
    listed = "wheels = [\n" + "".join(f'  "./wheels/{name}",\n' for name in names) + "]"
    text, count = re.subn(r"^wheels = \[\].*$", listed, text, flags=re.MULTILINE)
    if count != 1:
        raise BuildError("addon/blender_manifest.toml needs one line 'wheels = []'")
    with open(manifest, "w", encoding="utf-8") as file:
        file.write(text)


def version() -> str:
    """The version of the extension. Raises BuildError if the manifest and pyproject.toml disagree."""
    with open(os.path.join(ROOT, "addon", "blender_manifest.toml"), "rb") as file:
        shipped = tomllib.load(file)["version"]
    with open(os.path.join(ROOT, "pyproject.toml"), "rb") as file:
        project = tomllib.load(file)["project"]["version"]
    if shipped != project:
        raise BuildError(f"addon/blender_manifest.toml has version {shipped}, pyproject.toml {project}; make them one")
    return str(shipped)


def extension_tool() -> str:
    """Blender's own command line for extensions; it runs with any Python, and Blender is not loaded for it."""
    package = importlib.util.find_spec("bpy")
    folder = os.path.dirname(package.origin or "") if package else ""
    found = glob.glob(os.path.join(folder, "*", "scripts", "addons_core", "bl_pkg", "cli", "blender_ext.py"))
    if not found:
        raise BuildError(f"there is no blender_ext.py in the Blender module '{folder}'")
    return found[0]


def run_tool(*arguments: str) -> None:
    """Runs Blender's extension tool. Raises BuildError if it finds fault."""
    if subprocess.run([sys.executable, extension_tool(), *arguments], stdout=_bootstrap.STDERR, check=False).returncode:
        raise BuildError(f"Blender's extension tool refused to {arguments[0]}; see above")


def build() -> str:
    """Builds the zip and returns its path. Raises BuildError."""
    path = os.path.join(DIST, f"conelight-{version()}.zip")
    os.makedirs(DIST, exist_ok=True)
    os.makedirs(BUILD, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=BUILD) as folder:
        source = os.path.join(folder, "conelight")
        made = os.path.join(folder, "conelight.zip")
        gather(source)
        run_tool("validate", source)
        run_tool("build", "--source-dir", source, "--output-filepath", made)
        run_tool("validate", made)
        os.replace(made, path)
    return path


def main() -> int:
    """Builds, and prints the path. Returns the exit status."""
    try:
        print(build())
    except BuildError as error:
        _bootstrap.say(f"build_extension: {error}")
        return 1
    return 0
