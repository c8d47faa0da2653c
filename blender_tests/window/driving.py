# SPDX-License-Identifier: GPL-3.0-or-later
"""What the drivers share: a user's actions in a Blender with a window, what is seen, and how cases are run.

    blender ... --python drive_SOMETHING.py -- CASE ARCHIVE FOLDER

CASE is a function ``case_*`` of the driver, ARCHIVE the zip of scripts/build_extension, FOLDER where screenshots and
``CASE.json`` go: an object of what was measured, with ``error`` where the case did not come to its end.

A case is a generator, advanced by a timer of Blender: between two of its steps Blender draws and renders. It yields
seconds to wait. Nothing is judged here; the tests do that.
"""

from __future__ import annotations

import faulthandler
import json
import math
import os
import re
import subprocess
import sys
import time
import traceback
import zipfile
from collections.abc import Callable, Iterator
from typing import Any

import bpy
import gpu

MODULE = "bl_ext.user_default.conelight"
SAMPLES = 8
SIZE = (320, 180)

Steps = Iterator[float]

#: Objects that get a material: name, base colour, metallic.
_MATERIALS = (("Plane", (0.7, 0.7, 0.7), 0), ("Sphere", (0.8, 0.3, 0.1), 1), ("Torus", (0.1, 0.4, 0.8), 0))

case_name, archive, folder = sys.argv[sys.argv.index("--") + 1 :]
measured: dict[str, Any] = {"shots": [], "stats": [], "pauses": [], "previews": 0}


# What a user does -------------------------------------------------------------------------------------------------


def window() -> bpy.types.Window:
    """The main window; renders open others."""
    return bpy.context.window_manager.windows[0]


def area(kind: str) -> bpy.types.Area:
    """The largest editor of a kind in the main window."""
    return max((a for a in window().screen.areas if a.type == kind), key=lambda a: a.width * a.height)


def operator(call: Callable[..., Any], *arguments: Any, kind: str = "VIEW_3D", **options: Any) -> Any:
    """Calls an operator as from an editor of the main window."""
    if bpy.app.background:
        return call(*arguments, **options)
    editor = area(kind)
    region = next(r for r in editor.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=editor, region=region):
        return call(*arguments, **options)


def installable(path: str) -> str:
    """The zip, or a copy of it without wheels where none of them is for Blender's Python.

    Blender refuses such a zip. Blenders of distributions have the system's Python, and its moderngl must serve.
    """
    tag = f"-cp{sys.version_info[0]}{sys.version_info[1]}-"
    with zipfile.ZipFile(path) as source:
        measured["wheels"] = any(tag in name for name in source.namelist())
        if measured["wheels"]:
            return path
        copy = os.path.join(folder, "without_wheels.zip")
        with zipfile.ZipFile(copy, "w") as target:
            for name in source.namelist():
                content = source.read(name)
                if name == "blender_manifest.toml":
                    content = re.sub(rb"^wheels = \[.*?\]", b"", content, flags=re.MULTILINE | re.DOTALL)
                if not name.endswith(".whl"):
                    target.writestr(name, content)
    return copy


def install() -> None:
    """Installs the zip as from Preferences > Get Extensions > Install from Disk."""
    path = installable(archive)
    operator(bpy.ops.extensions.package_install_files, filepath=path, repo="user_default", enable_on_install=True)
    if MODULE not in bpy.context.preferences.addons:
        raise RuntimeError("the extension was not enabled")
    import moderngl

    original = session().Session.render

    def counted(self: Any, *arguments: Any, **options: Any) -> bool:
        finished = original(self, *arguments, **options)
        if self.is_preview:
            measured["previews"] += 1
        return finished

    session().Session.render = counted
    measured["moderngl"] = moderngl.__file__
    measured["addon"] = sys.modules[MODULE].__file__
    if not bpy.app.background:  # there it has no graphics before it renders
        measured["backend"] = gpu.platform.backend_type_get()
        measured["gl"] = gpu.platform.version_get()


def build_scene() -> None:
    """Cube and light of a new file, on a floor, with a sphere, a torus and a text."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=14, location=(0, 0, -1))
    bpy.ops.mesh.primitive_uv_sphere_add(location=(2.2, 0.5, 0))  # its corners come in another order each time
    bpy.ops.object.shade_smooth()
    bpy.ops.mesh.primitive_torus_add(location=(-2.2, 1.2, 0), rotation=(0.9, 0.2, 0))
    bpy.ops.object.text_add(location=(-1, -3, -0.9))
    for name, colour, metallic in _MATERIALS:
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5,):
            material.use_nodes = True
        shader = material.node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (*colour, 1)
        shader.inputs["Metallic"].default_value = metallic
        bpy.data.objects[name].data.materials.append(material)
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    bpy.ops.ed.undo_push(message="scene")
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "scene.blend"), copy=True)


def use_conelight(samples: int = SAMPLES, voxels: int = 48) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CONELIGHT"
    scene.conelight.samples = samples
    scene.conelight.voxel_auto = False
    scene.conelight.voxel_resolution = voxels


def shade(kind: str) -> None:
    for editor in window().screen.areas:
        if editor.type == "VIEW_3D":
            editor.spaces.active.shading.type = kind
            editor.tag_redraw()


def press(*keys: str) -> None:
    """Presses keys where the pointer is."""
    subprocess.run(["xdotool", "key", *keys], check=True, timeout=20)


# What is seen -----------------------------------------------------------------------------------------------------


def shot(name: str) -> None:
    """A screenshot of the whole display, or where that tool is missing of Blender's main window."""
    path = os.path.join(folder, f"{case_name}_{name}.png")
    try:
        subprocess.run(["import", "-window", "root", path], check=True, timeout=30)
    except FileNotFoundError:
        operator(bpy.ops.screen.screenshot, filepath=path)
    measured["shots"].append(path)


def save(name: str) -> None:
    """Writes the render result as EXR."""
    image = bpy.context.scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format = "OPEN_EXR"
    image.color_depth = "32"
    bpy.data.images["Render Result"].save_render(os.path.join(folder, f"{case_name}_{name}.exr"))


def session() -> Any:
    return sys.modules[f"{MODULE}.host.session"]


class Events:
    """When renders began, wrote, ended or were cancelled, and every line of statistics."""

    def __init__(self) -> None:
        self.seen: list[tuple[str, float]] = []
        handlers = bpy.app.handlers
        for kind in ("render_init", "render_complete", "render_cancel"):
            getattr(handlers, kind).append(lambda *_, kind=kind: self.seen.append((kind, time.perf_counter())))
        handlers.render_stats.append(lambda text, *_: measured["stats"].append(str(text)))

    def last(self) -> str:
        return self.seen[-1][0] if self.seen else ""

    def when(self, kind: str) -> float:
        return max((when for seen, when in self.seen if seen == kind), default=math.nan)


def render(display: str = "WINDOW") -> None:
    """F12. Returns at once; Blender renders on another thread."""
    bpy.context.preferences.view.render_display_type = display
    events.seen.clear()
    measured["stats"].append("--")
    operator(bpy.ops.render.render, "INVOKE_DEFAULT")


def finish(limit: float = 120.0) -> Steps:
    """Waits until the render has ended, and measures how long the user interface stood still meanwhile."""
    start = last = time.perf_counter()
    longest = 0.0
    while events.last() not in ("render_complete", "render_cancel") or bpy.app.is_job_running("RENDER"):
        if time.perf_counter() - start > limit:
            raise RuntimeError(f"a render did not end within {limit:g} s")
        yield 0.05
        longest, last = max(longest, time.perf_counter() - last), time.perf_counter()
    measured["pauses"].append(round(longest, 3))
    yield 0.5


def back_from_render() -> None:
    """Leaves the image editor that a render took an area for, as Esc over it does."""
    operator(bpy.ops.render.view_cancel, kind="IMAGE_EDITOR")
    for editor in window().screen.areas:
        if editor.type == "IMAGE_EDITOR":
            editor.type = "VIEW_3D"


def close_render_windows() -> None:
    while len(bpy.context.window_manager.windows) > 1:
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
            bpy.ops.wm.window_close()


# Driving ----------------------------------------------------------------------------------------------------------

events = Events()


def drive(cases: dict[str, Any]) -> None:
    """Runs the case among ``cases`` that the command line names, and ends Blender."""
    faulthandler.dump_traceback_later(60, repeat=True, file=sys.__stderr__)  # where it hangs, if it does
    bpy.context.preferences.view.show_splash = False
    steps = cases[f"case_{case_name}"]()

    def advance() -> float | None:
        try:
            return next(steps)
        except StopIteration:
            pass
        except BaseException:
            measured["error"] = traceback.format_exc()
            print(measured["error"], file=sys.stderr)
            try:
                shot("error")
            except Exception:
                traceback.print_exc()
        with open(os.path.join(folder, f"{case_name}.json"), "w", encoding="utf-8") as file:
            json.dump(measured, file, indent=1)
        bpy.ops.wm.quit_blender()
        return None

    if bpy.app.background:
        while advance() is not None:
            pass
    else:
        bpy.app.timers.register(advance, first_interval=2.0, persistent=True)
