# SPDX-License-Identifier: GPL-3.0-or-later
"""A child process that writes the file of one scene: ``python -m conelight_benchmark.build_scene NAME FOLDER``.

USD is written without Blender: each brings a USD library of its own.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from conelight_cli import process

from .catalogue import SCENES


def main(name: str, folder: Path) -> None:
    """Writes ``scene.usda`` or ``scene.blend``, and pictures it needs, into ``folder``."""
    recipe = SCENES[name].recipe
    arguments = dict(recipe.arguments)
    if recipe.is_usd:
        getattr(importlib.import_module(recipe.module), recipe.function)(folder / "scene.usda", **arguments)
        return
    process.isolate_blender()
    import bpy

    getattr(importlib.import_module(recipe.module), recipe.function)(**arguments)
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"), compress=True)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
    process.leave(0)
