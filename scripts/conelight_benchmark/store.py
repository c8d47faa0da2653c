# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept between runs: built scenes and results, each in a folder named by a hash of what it depends on.

A folder appears under its name only when it is complete.
"""

from __future__ import annotations

import ast
import contextlib
import importlib.metadata
import json
import os
import platform
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from blender_tests.pictures import Picture, read

from .catalogue import ROOT, BenchmarkScene, Recipe
from .job import Job, digest

INFO = "info.json"


class Store:
    """The folder of a cache."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for kind in ("scenes", "references", "measurements"):
            (folder / kind).mkdir(parents=True, exist_ok=True)

    def scene_file(self, scene: BenchmarkScene) -> Path:
        """Where the file of a scene is, or will be."""
        suffix = ".usda" if scene.recipe.is_usd else ".blend"
        return self.folder / "scenes" / f"{scene.name}-{scene_key(scene)}" / f"scene{suffix}"

    def result_folder(self, scene: BenchmarkScene, job: Job) -> Path:
        """Where the results of a job are, or will be."""
        if job.timed:
            code = code_digest() + shader_changes(job) if job.engine == "conelight" else ""
            key = job.key(scene_key(scene), blender_version(), code, machine())
            return self.folder / "measurements" / f"{scene.name}-{key}"
        return self.folder / "references" / f"{scene.name}-{job.key(scene_key(scene), blender_version())}"

    def result(self, scene: BenchmarkScene, job: Job) -> Result | None:
        """The results of a job, if it is done."""
        folder = self.result_folder(scene, job)
        try:
            return Result(folder, json.loads((folder / INFO).read_text(encoding="utf-8")))
        except FileNotFoundError:
            return None


class Result:
    """Pictures and numbers of one job."""

    def __init__(self, folder: Path, info: dict[str, Any]) -> None:
        self.folder = folder
        self.info = info

    def picture(self, part: str = "full", frame: int = 0) -> Picture:
        """(H, W, 3) linear, row 0 at the top. ``part``: ``full``; ``direct``: what lamps light, by the engine's own
        passes; ``seen``: what the camera sees glowing. ``frame``: from 0, of a sequence."""
        name = f"{part}_{frame:04d}.exr" if self.info["frames"] else f"{part}.exr"
        return np.ascontiguousarray(read(self.folder / name)[..., :3])


@contextlib.contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """A folder beside ``folder`` that takes its name when the block ends without an error."""
    temporary = Path(tempfile.mkdtemp(prefix=".part-", dir=folder.parent))
    try:
        yield temporary
        with contextlib.suppress(OSError):  # another run was first
            os.rename(temporary, folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


# ---- what results depend on --------------------------------------------------------------------------------------


@cache
def scene_key(scene: BenchmarkScene) -> str:
    """Changes with the numbers and the code that a scene is built from, and with the file it comes from."""
    files = scene.needs.parent.rglob("*") if scene.needs else ()
    return digest(repr(scene.recipe), *recipe_code(scene.recipe), *contents(sorted(files)))


def recipe_code(recipe: Recipe) -> list[str]:
    """The code of a recipe without comments, docstrings and layout: module by module."""
    tests = ROOT / "blender_tests" / "scenes"
    scenes = Path(__file__).parent / "scenes"
    shared = [tests / "make_usd.py", scenes / "stage.py"] if recipe.is_usd else [tests / "build.py"]
    folder = tests if recipe.module.startswith("blender_tests") else scenes
    return [bare_code(path) for path in [folder / (recipe.module.rpartition(".")[2] + ".py"), *shared]]


def bare_code(path: Path) -> str:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.FunctionDef, ast.ClassDef)) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return ast.unparse(tree)


def contents(paths: Iterable[Path]) -> list[bytes]:
    return [path.read_bytes() for path in paths if path.is_file()]


@cache
def code_digest() -> str:
    """Changes with the code of the engine, and with what measures the machine's rates beside it."""
    folders = (ROOT / "addon", ROOT / "shaders")
    paths = sorted(path for folder in folders for path in folder.rglob("*") if path.suffix in (".py", ".glsl"))
    here = Path(__file__).parent
    return digest(*contents([*paths, here / "fetch_rate.py", here / "kernels" / "fetch_rate.comp.glsl"]))


def shader_changes(job: Job) -> str:
    """Changes with the code that changes the engine's shaders for a job; empty where they stay as they are."""
    here = Path(__file__).parent
    paths = [here / "kernels" / "gather.comp.glsl"] if job.kernel else []
    paths += [here / "fetches.py"] if job.counts_fetches else []
    return digest(*contents(paths)) if paths else ""


@cache
def blender_version() -> str:
    return importlib.metadata.version("bpy")


@cache
def machine() -> str:
    """The processor, and how many of it: times are of one machine."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return f"{os.cpu_count()} x {line.partition(':')[2].strip()}"
    return f"{os.cpu_count()} x {platform.processor() or platform.machine()}"
