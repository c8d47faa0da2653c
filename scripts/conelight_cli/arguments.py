# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of ``scripts/render``.

Standard library only, and written for old Pythons, because it runs before the set-up.
"""

from __future__ import annotations

import argparse
import os
import re
from typing import NamedTuple, Optional, Sequence, Tuple

#: Extension -> what Blender calls the format of a picture.
PICTURE_FORMATS = {
    ".exr": "OPEN_EXR",
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".webp": "WEBP",
    ".bmp": "BMP",
    ".tga": "TARGA",
    ".hdr": "HDR",
}
SCENE_EXTENSIONS = (".blend", ".usd", ".usda", ".usdc", ".usdz", ".glb", ".gltf", ".obj")
ENGINES = ("conelight", "cycles", "eevee")
PRESET_NAMES = ("draft", "balanced", "final")


class Arguments(NamedTuple):
    """A checked command line."""

    scene: str
    output: str  # extension included; a frame number still to be put in where ``frames`` is given
    engine: str
    preset: Optional[str]
    resolution: Optional[Tuple[int, int]]
    samples: Optional[int]
    voxels: Optional[int]
    camera: Optional[str]
    frames: Optional[Tuple[int, int]]
    view_layer: Optional[str]
    passes: bool
    assignments: Tuple[Tuple[str, str], ...]
    stats: Optional[str]
    time_limit: Optional[float]
    skip_existing: bool
    enable_autoexec: bool
    list_settings: bool


def resolution(text: str) -> tuple[int, int]:
    match = re.match(r"^(\d+)[xX](\d+)$", text)
    if match is None or not all(4 <= int(side) <= 65536 for side in match.groups()):
        raise argparse.ArgumentTypeError(f"'{text}' is not WIDTHxHEIGHT in pixels (from 4 to 65536), such as 640x360")
    return int(match.group(1)), int(match.group(2))


def _frames(text: str) -> tuple[int, int]:
    match = re.match(r"^(\d+)(?:-(\d+))?$", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not FIRST-LAST, such as 1-24")
    first, last = int(match.group(1)), int(match.group(2) or match.group(1))
    if first > last or last > 1048574:
        raise argparse.ArgumentTypeError(f"'{text}': the last frame comes before the first, or is above 1048574")
    return first, last


def _count(text: str) -> int:
    if not re.match(r"^\d+$", text) or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least 1")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds <= 1e6:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds above 0, at most 1e6")
    return seconds


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=VALUE, such as bounces=4")
    return name.strip(), value.strip()


def parser() -> argparse.ArgumentParser:
    """The options, with their help."""
    made = argparse.ArgumentParser(
        prog="render",
        description="Renders a scene file with Conelight, in background.",
        epilog="Messages go to stderr. The exit status is 0 only if a picture was written, 2 for a wrong command line.",
        allow_abbrev=False,
    )
    add = made.add_argument
    add("scene", metavar="SCENE", nargs="?", help=" ".join(SCENE_EXTENSIONS))
    add("-o", "--output", metavar="OUT", help="picture to write: " + " ".join(PICTURE_FORMATS) +
        " (default: SCENE's name .png in the current folder). EXR holds linear values; "
        "the others go through the scene's view transform. With --frames: name_####.ext")
    add("--engine", choices=ENGINES, default="conelight",
        help="cycles and eevee are for comparison (default: %(default)s)")
    add("--preset", choices=PRESET_NAMES,
        help="starting point of all settings (default: balanced, with what a .blend stores)")
    add("--resolution", metavar="WxH", type=resolution, help="size in pixels (default: the scene's)")
    add("--samples", metavar="N", type=_count, help="passes averaged into the picture")
    add("--voxels", metavar="N", type=_count, help="voxels along the longest side (default: automatic)")
    add("--camera", metavar="NAME", help="camera object (default: the scene's; everything is framed if it has none)")
    add("--frames", metavar="A-B", type=_frames, help="frames to render, one file each")
    add("--view-layer", metavar="NAME", help="render this view layer only")
    add("--passes", action="store_true", help="write all passes into one multilayer EXR; OUT must be .exr")
    add("--set", metavar="NAME=VALUE", type=_assignment, action="append", default=[], dest="assignments",
        help="any setting of --list-settings; may be repeated")
    add("--stats", metavar="FILE.json", help="write times, memory and what was used, as one JSON object")
    add("--time-limit", metavar="SECONDS", type=_seconds, help="stop after this time with the passes done so far")
    add("--skip-existing", action="store_true", help="with --frames: leave out frames whose file is there already")
    add("--enable-autoexec", action="store_true",
        help="trust SCENE: scripts and drivers in it run, and it may write where it says (default: neither)")
    add("--list-settings", action="store_true", help="list all settings with default, range and cost, and stop")
    return made


def parse(texts: Sequence[str]) -> Arguments:
    """A checked command line. Ends the process with status 2 and a sentence when it is wrong, as argparse does."""
    made = parser()
    values = made.parse_args(list(texts))
    if values.list_settings:
        values.scene = values.scene or ""
        values.output = values.output or ""
    elif not values.scene:
        made.error("no SCENE given")
    else:
        _check_files(made, values)
    values.assignments = tuple(values.assignments)
    return Arguments(**vars(values))


def _check_files(made: argparse.ArgumentParser, values: argparse.Namespace) -> None:
    stem, extension = os.path.splitext(os.path.basename(values.scene))
    if extension.lower() not in SCENE_EXTENSIONS:
        made.error(f"scene file '{values.scene}': unknown extension '{extension}'; known: {' '.join(SCENE_EXTENSIONS)}")
    if values.output is None:
        values.output = stem + (".exr" if values.passes else ".png")
    extension = os.path.splitext(values.output)[1].lower()
    if extension not in PICTURE_FORMATS:
        made.error(f"output '{values.output}': unknown extension '{extension}'; known: {' '.join(PICTURE_FORMATS)}")
    if values.passes and extension != ".exr":
        made.error(f"output '{values.output}': --passes needs a file that ends in .exr")
    if values.skip_existing and values.frames is None:
        made.error("--skip-existing needs --frames")


def frame_path(output: str, frame: int) -> str:
    """File of one frame: ``name_####.ext``, or ``#`` signs in the name replaced.

    >>> frame_path("out/shot.png", 7), frame_path("shot_###.exr", 7)
    ('out/shot_0007.png', 'shot_007.exr')
    """
    folder, name = os.path.split(output)
    stem, extension = os.path.splitext(name)
    match = re.search("#+", stem)
    if match:
        stem = stem[: match.start()] + str(frame).zfill(len(match.group())) + stem[match.end():]
    else:
        stem = f"{stem}_{frame:04d}"
    return os.path.join(folder, stem + extension)
