# SPDX-License-Identifier: GPL-3.0-or-later
"""A process that renders files one after the other, as ``scripts/render`` does: a line of JSON in, lines of JSON out.

In: ``file``, ``engine``, and ``seed``, from which values are changed after the file was read (null: none).
Out: ``doing`` before each step, then ``end``: what became of it, with ``ours`` where that is a defect of this project.
"""

from __future__ import annotations

import json
import os
import random
import resource
import sys
import tempfile
from pathlib import Path
from typing import Any

from conelight_cli import main, process
from conelight_cli.arguments import parse
from conelight_cli.errors import CommandError

from .changes import change_values

OPTIONS = ["--resolution", "16x12", "--samples", "1", "--voxels", "16", "--set", "bounces=2"]
MOST_MEMORY = 8 << 30  # of address space: the drivers of a machine take some, a runaway takes more

#: Of messages that say that something broke that should not.
OURS = ("failed where it should not", "ended without a picture")


def tell(**what: Any) -> None:
    os.write(_out, (json.dumps(what) + "\n").encode())


def render(file: Path, seed: int | None, engine: str, folder: Path) -> dict[str, Any]:
    """How rendering ``file`` ended. ``folder``: for the picture."""
    import bpy
    from conelight_cli import scene as scene_files

    from blender_tests.pictures import read

    load = scene_files.load
    changed: list[str] = []

    def load_and_change(path: str, **options: Any) -> Any:
        found = load(path, **options)
        if seed is not None:
            changed.extend(change_values(bpy.data, random.Random(seed)))
        tell(doing="rendering", changed=changed)
        return found

    output = folder / "picture.exr"
    output.unlink(missing_ok=True)
    scene_files.load = load_and_change
    tell(doing="reading")
    try:
        main.render(parse([str(file), "-o", str(output), "--engine", engine, *OPTIONS]))
        picture = read(output)
        bad = int((picture != picture).sum() + (abs(picture) == float("inf")).sum())
        return {"end": f"{bad} values of the picture are not finite" if bad else "rendered", "ours": bool(bad)}
    except CommandError as error:
        return {"end": f"refused: {error}", "ours": any(text in str(error) for text in OURS)}
    except Exception as error:
        return {"end": f"{type(error).__name__}: {error}", "ours": True}
    finally:
        scene_files.load = load


def work() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    folder = Path(tempfile.mkdtemp(dir=os.environ["TMPDIR"]))
    main.confine_writing(parse(["x.obj", "-o", str(folder / "picture.exr")]))
    main.confine_writing = lambda arguments: None  # once is enough: the kernel counts
    for line in sys.stdin:
        asked = json.loads(line)
        tell(**render(Path(asked["file"]), asked["seed"], asked["engine"], folder))


if __name__ == "__main__":
    _out = os.dup(1)
    os.dup2(2, 1)
    process.isolate_blender()
    work()
    process.leave(0)
