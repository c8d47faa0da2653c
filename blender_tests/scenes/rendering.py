# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders the current scene in this process, with Conelight or Cycles, and gives the picture as numbers."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import bpy

from blender_tests.pictures import Picture, read

CYCLES_BOUNCES = 16


class RenderError(Exception):
    """What the engine, or else Blender, says about why there is no picture."""


_registered = False


def register() -> None:
    """Registers the engine from the source tree, once for each process."""
    global _registered
    if not _registered:
        import addon

        addon.register()
        _registered = True


def conelight(size: tuple[int, int] | None = None, *, voxels: int = 64, **settings: Any) -> Picture:
    """The scene's picture, (H, W, 4) linear with row 0 at the top. ``settings`` are those of ``addon/settings.py``.

    Raises RenderError with what the engine says.
    """
    register()
    from addon.host import session

    scene = bpy.context.scene
    scene.render.engine = "CONELIGHT"
    for name, value in {"voxel_auto": False, "voxel_resolution": voxels, **settings}.items():
        setattr(scene.conelight, name, value)
    session.last_error = None
    try:
        picture = render_current(scene, size)
    except RuntimeError as error:
        raise RenderError(session.last_error or str(error)) from error
    if session.last_error is not None:
        raise RenderError(session.last_error)
    return picture


def last_statistics() -> dict[str, Any]:
    """What the engine counted while it made the last picture."""
    from addon.host import session

    return session.last_statistics


def last_warnings() -> list[str]:
    """What the engine said about the last picture."""
    return list(last_statistics()["warnings"])


def cycles(size: tuple[int, int] | None = None, *, samples: int, bounces: int = CYCLES_BOUNCES) -> Picture:
    """As :func:`conelight`, with Cycles on the CPU, without anything that changes the answer."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    values = {
        "device": "CPU", "samples": samples, "use_adaptive_sampling": False, "use_denoising": False,
        "sample_clamp_direct": 0.0, "sample_clamp_indirect": 0.0, "caustics_reflective": True,
        "caustics_refractive": True, "blur_glossy": 0.0, "use_fast_gi": False, "use_guiding": False,
        "max_bounces": bounces, "diffuse_bounces": bounces, "glossy_bounces": bounces,
        "transmission_bounces": bounces, "transparent_max_bounces": 16,
    }
    for name, value in values.items():
        setattr(scene.cycles, name, value)
    return render_current(scene, size)


def save(path: str | os.PathLike[str], *, file_format: str = "OPEN_EXR", color_depth: str = "32") -> None:
    """Writes the last picture, as Blender's own Save Image does."""
    scene = bpy.context.scene
    choose_format(file_format, color_depth)
    bpy.data.images["Render Result"].save_render(str(path), scene=scene)


def choose_format(file_format: str = "OPEN_EXR", color_depth: str = "32") -> None:
    """What the scene's pictures are written as, with alpha."""
    image = bpy.context.scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5.0 and later sort the formats by kind
        image.media_type = "IMAGE"
    image.file_format = file_format
    image.color_mode = "RGBA"
    image.color_depth = color_depth


def render_current(scene: Any, size: tuple[int, int] | None = None) -> Picture:
    """With the engine and settings that are set."""
    if size is not None:
        scene.render.resolution_x, scene.render.resolution_y = size
    bpy.ops.render.render(scene=scene.name)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        save(path)
        return read(path)
