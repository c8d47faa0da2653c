# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that are written: pictures and statistics, each complete or not there at all."""

from __future__ import annotations

import contextlib
import glob
import json
import os
from collections.abc import Iterator
from typing import Any

from .arguments import PICTURE_FORMATS
from .errors import CommandError

#: Colour depth of each format, as Blender names it; formats that are not here have only one.
_DEPTHS = {"OPEN_EXR": "32", "OPEN_EXR_MULTILAYER": "32", "PNG": "8", "TIFF": "16"}
_WITHOUT_ALPHA = ("JPEG", "BMP", "HDR")
_WITH_ALPHA = ("OPEN_EXR", "OPEN_EXR_MULTILAYER")

#: Passes of a view layer by the name of their switch, for --passes.
PASS_SWITCHES = (
    "combined", "z", "mist", "position", "normal", "vector", "uv", "object_index", "material_index",
    "diffuse_direct", "diffuse_indirect", "diffuse_color", "glossy_direct", "glossy_indirect", "glossy_color",
    "transmission_direct", "transmission_indirect", "transmission_color", "emit", "environment", "ambient_occlusion",
)


#: Bytes that a disk must still take after a file: more than a block of any file system.
_MORE = 1 << 16


def choose_format(scene: Any, output: str, multilayer: bool) -> None:
    """Sets the scene's picture format from the extension of ``output``.

    EXR gets 32-bit scene-linear values; everything else goes through the scene's view transform.
    """
    name = "OPEN_EXR_MULTILAYER" if multilayer else PICTURE_FORMATS[os.path.splitext(output)[1].lower()]
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # Blender 5.0 and later sort the formats by kind
        settings.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    settings.file_format = name
    if name not in _WITHOUT_ALPHA and (name in _WITH_ALPHA or scene.render.film_transparent):
        settings.color_mode = "RGBA"
    else:
        settings.color_mode = "RGB"
    if name in _DEPTHS:
        settings.color_depth = _DEPTHS[name]
    if name.startswith("OPEN_EXR"):
        settings.exr_codec = "ZIP"
    settings.quality = 95
    scene.render.use_file_extension = False
    scene.render.use_multiview = False


def enable_passes(scene: Any) -> None:
    """Switches on every pass of every view layer."""
    for layer in scene.view_layers:
        for name in PASS_SWITCHES:
            if hasattr(layer, "use_pass_" + name):
                setattr(layer, "use_pass_" + name, True)


def temporary_path(path: str, number: str = "") -> str:
    """A file beside ``path`` that only this process writes."""
    folder, extension = os.path.dirname(os.path.abspath(path)), os.path.splitext(path)[1]
    return os.path.join(folder, f".{os.getpid()}.{number}part{extension}")


def remove_temporary(path: str, process: int) -> None:
    """Removes what a process has left beside ``path``."""
    folder = os.path.dirname(os.path.abspath(path))
    for name in glob.glob(f"{glob.escape(folder)}/.{process}.*part*"):
        with contextlib.suppress(OSError):
            os.remove(name)


def _flush_to_disk(path: str) -> None:
    """Raises OSError where a disk is full: Blender's writers of EXR and TGA are content with half a file then."""
    size = os.path.getsize(path)
    with open(path, "r+b") as file:
        file.seek(size)
        file.write(bytes(_MORE))
        file.flush()
        os.fsync(file.fileno())
        file.truncate(size)


@contextlib.contextmanager
def replacing(path: str, what: str) -> Iterator[str]:
    """A file beside ``path`` to write to; it takes the place of ``path`` at the end of the block if it was written.

    Raises CommandError naming ``path`` when that cannot be. ``what`` is what the file is to the user.
    """
    temporary = temporary_path(path)
    try:
        yield temporary
        if os.path.exists(temporary):
            _flush_to_disk(temporary)  # before it has its name: a machine that fails then leaves the old file or this
            os.replace(temporary, path)
    except OSError as error:
        raise CommandError(f"{what} '{path}' could not be written: {error.strerror}") from error
    finally:
        with contextlib.suppress(OSError):
            os.remove(temporary)


def check_writable(path: str, what: str) -> None:
    """Makes the folder of a file. Raises CommandError if the file cannot be written, before time is spent on it."""
    if os.path.isdir(path):
        raise CommandError(f"{what} '{path}' is a folder; give the name of a file")
    folder = os.path.dirname(os.path.abspath(path))
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise CommandError(f"{what} '{path}': the folder cannot be made: {error.strerror}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise CommandError(f"{what} '{path}' cannot be written: no permission to write into the folder '{folder}'")


def write_json(path: str, content: dict[str, Any]) -> None:
    """Writes one JSON object."""
    with replacing(path, "statistics") as temporary, open(temporary, "w", encoding="utf-8") as file:
        json.dump(content, file, indent=1)
        file.write("\n")
