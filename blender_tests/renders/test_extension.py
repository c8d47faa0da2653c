# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip that users install: built, installed into a fresh Blender without the source tree, and rendered with."""

from __future__ import annotations

import os
import pathlib
import re
import subprocess
import sys
import zipfile

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(not (ROOT / "addon" / "__init__.py").exists(), reason="the add-on is not there")
HAS_ENGINE = (ROOT / "addon" / "host" / "engine.py").exists()
needs_engine = pytest.mark.skipif(not HAS_ENGINE, reason="the engine is not there")

INSTALL = """
import importlib.machinery, os, sys
archive, folder, root, picture = sys.argv[1:]

class HideOurCopies:  # the wheels must serve, not what the test environment has of the same packages
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.split(".")[0] not in ("moderngl", "glcontext") or path is not None:
            return None
        elsewhere = [folder for folder in sys.path if not folder.startswith(sys.prefix)]
        spec = importlib.machinery.PathFinder.find_spec(name, elsewhere)
        if spec is None:
            raise ModuleNotFoundError(f"No module named {name!r} outside the test environment")
        return spec

sys.meta_path.insert(0, HideOurCopies)
import bpy
roots = (root, os.path.realpath(root))
ours = [path for path in sys.path if path.startswith(roots) and not path.startswith(sys.prefix)]
assert not ours, ours
result = bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
assert result == {"FINISHED"}, result
module = sys.modules["bl_ext.user_default.conelight"]
assert os.path.realpath(module.__file__).startswith(os.path.realpath(folder)), module.__file__
assert "bl_ext.user_default.conelight" in bpy.context.preferences.addons
wheels = os.path.join(folder, "extensions", ".local", "lib", f"python3.{sys.version_info[1]}", "site-packages")
assert {"moderngl", "glcontext"} <= set(os.listdir(wheels)), os.listdir(wheels)
for name in ("moderngl", "glcontext"):
    loaded = __import__(name).__file__
    assert os.path.realpath(loaded).startswith(os.path.realpath(wheels)), f"{name} comes from {loaded}"
if picture:
    import numpy
    scene = bpy.context.scene
    scene.render.engine = "CONELIGHT"
    scene.render.resolution_x = scene.render.resolution_y = 32
    scene.render.resolution_percentage = 100
    scene.conelight.samples = 1
    scene.conelight.voxel_auto = False
    scene.conelight.voxel_resolution = 16
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    bpy.ops.render.render()
    bpy.data.images["Render Result"].save_render(picture, scene=scene)
print("INSTALLED")
sys.stdout.flush()
os._exit(0)
"""


@pytest.fixture(scope="module")
def archive() -> pathlib.Path:
    """The zip, built by the script."""
    result = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "build_extension")], capture_output=True, text=True, timeout=240,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    path = pathlib.Path(result.stdout.strip())
    assert path.parent == ROOT / "dist"
    return path


def install(archive: pathlib.Path, folder: pathlib.Path, picture: str) -> None:
    """Installs into an empty Blender in a process that cannot see the source tree."""
    resources = folder / "resources"
    resources.mkdir()
    environ = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER_"))}
    result = subprocess.run(
        [sys.executable, "-I", "-c", INSTALL, str(archive), str(resources), str(ROOT), picture], cwd=folder,
        env={**environ, "BLENDER_USER_RESOURCES": str(resources)}, capture_output=True, text=True, timeout=240,
        check=False,
    )
    assert result.returncode == 0 and "INSTALLED" in result.stdout, result.stdout + result.stderr


def test_the_zip_holds_what_is_needed_and_nothing_else(archive: pathlib.Path) -> None:
    with zipfile.ZipFile(archive) as file:
        names = file.namelist()
    assert {"blender_manifest.toml", "__init__.py", "settings.py", "LICENSE"} <= set(names)
    shaders = {path.relative_to(ROOT).as_posix() for path in (ROOT / "shaders").rglob("*.glsl")}
    needed = {name for name in shaders if not name.startswith("shaders/tests/")}
    assert needed and needed <= set(names) and not (shaders - needed) & set(names)
    assert not [name for name in names if "__pycache__" in name or name.endswith((".pyc", ".toml.orig"))]
    wheels = [re.match(r"wheels/(moderngl|glcontext)-[^-]+-cp(\d+)-cp\d+-.*(linux|win)", name) for name in names]
    found = {match.groups() for match in wheels if match}
    assert found == {(package, python, system) for package in ("moderngl", "glcontext") for python in ("311", "313")
                     for system in ("linux", "win")}


def test_it_installs_without_the_source_tree(archive: pathlib.Path, tmp_path: pathlib.Path) -> None:
    install(archive, tmp_path, "")


@needs_engine
def test_what_is_installed_renders(archive: pathlib.Path, tmp_path: pathlib.Path) -> None:
    import OpenImageIO as oiio

    install(archive, tmp_path, str(tmp_path / "cube.exr"))
    pixels = np.asarray(oiio.ImageBuf(str(tmp_path / "cube.exr")).get_pixels(oiio.FLOAT))[..., :3]
    assert pixels.shape == (32, 32, 3)
    assert np.isfinite(pixels).all()
    assert pixels.mean() > 0.01
