# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's images -> :class:`ImageSet`."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ...materials.graph import AlphaMode, ImageData, ImageEncoding, ImageSet
from .keep import kept

#: Sources of images that are one picture for each frame.
_FRAMES = ("SEQUENCE", "MOVIE")

#: Colour spaces of byte images by Blender's names.
_ENCODINGS = {
    "sRGB": ImageEncoding.SRGB,
    "Filmic sRGB": ImageEncoding.SRGB,
    "AgX Base sRGB": ImageEncoding.SRGB,
    "Khronos PBR Neutral sRGB": ImageEncoding.SRGB,
    "Gamma 2.2 Encoded Rec.709": ImageEncoding.SRGB,
    "Non-Color": ImageEncoding.DATA,
    "Raw": ImageEncoding.DATA,
    "Linear Rec.709": ImageEncoding.LINEAR,
    "Linear": ImageEncoding.LINEAR,
    "scene_linear": ImageEncoding.LINEAR,
}

_ALPHA_MODES = {
    "STRAIGHT": AlphaMode.STRAIGHT,
    "PREMUL": AlphaMode.PREMULTIPLIED,
    "CHANNEL_PACKED": AlphaMode.CHANNEL_PACKED,
    "NONE": AlphaMode.NONE,
}


#: Pixels of one image: 16384 x 16384, which take 4 GiB while they are read.
MOST_PIXELS = 1 << 28


@dataclass(frozen=True)
class _Entry:
    images: ImageSet
    state: tuple[Any, ...]
    warnings: list[str]
    is_current: bool = True


class ImageReader:
    """Reads images once each, and again when they may have changed."""

    def __init__(self) -> None:
        self._entries: dict[int, _Entry] = {}
        self._warnings: list[str] = []  # about the image that is being read

    def refresh(self, changed: frozenset[int] | None) -> bool:
        """To be called before each reading of a scene. Returns whether any image has to be read again.

        ``changed``: session_uids of the images that are known to have changed; None: nothing is known.
        """
        there = {image.session_uid: image for image in bpy.data.images}
        # One that was to be read again and was not is not in use any more.
        self._entries = {uid: entry for uid, entry in self._entries.items() if uid in there and entry.is_current}
        for uid, entry in self._entries.items():
            image = there[uid]
            if changed is None or uid in changed or _may_change_unseen(image) or entry.state != _state(image):
                self._entries[uid] = replace(entry, is_current=False)
        return not all(entry.is_current for entry in self._entries.values())

    def read(self, image: bpy.types.Image, warnings: list[str]) -> ImageSet:
        """All tiles of an image. Never raises: what cannot be read has no tiles and says why in ``problem``.

        The same object as before where nothing is different. Adds to ``warnings`` what the user should know.
        """
        key = image.session_uid
        entry = self._entries.get(key)
        if entry is None or not entry.is_current:
            self._warnings = []
            try:
                images = self._read(image)
            except Exception as error:
                problem = f"could not read image '{image.name}' ({type(error).__name__}: {error}); it is magenta"
                images = ImageSet(image.name, {}, problem=problem)
            entry = _Entry(kept(images, entry.images if entry else None), _state(image), self._warnings)
            self._entries[key] = entry
        warnings += entry.warnings
        return entry.images

    def _read(self, image: bpy.types.Image) -> ImageSet:
        if image.source in _FRAMES:
            kind = image.source.lower()
            self._warnings.append(f"image '{image.name}' is a {kind}; the frame that is loaded is shown")
        encoding = self._encoding(image)
        if image.source == "TILED":
            return self._read_tiles(image, encoding)
        width, height = image.size
        if width * height > MOST_PIXELS:
            what = f"uses image '{image.name}' of {width} x {height} pixels, of which {MOST_PIXELS} at most can be read"
            return ImageSet(image.name, {}, problem=f"{what}; it is magenta. Scale it down")
        data = _image_data(image, encoding)
        if data is None:
            return ImageSet(image.name, {}, problem=_missing(image))
        return ImageSet(image.name, {1001: data})

    def _encoding(self, image: bpy.types.Image) -> ImageEncoding:
        name = image.colorspace_settings.name
        if image.is_float:  # Blender has converted to scene linear when it loaded the file
            return ImageEncoding.DATA if _ENCODINGS.get(name) is ImageEncoding.DATA else ImageEncoding.LINEAR
        if name not in _ENCODINGS:
            self._warnings.append(f"image '{image.name}': colour space '{name}' is not supported; it is read as sRGB")
        return _ENCODINGS.get(name, ImageEncoding.SRGB)

    def _read_tiles(self, image: bpy.types.Image, encoding: ImageEncoding) -> ImageSet:
        """Blender gives Python the pixels of the first tile only: the others are read as images of their own."""
        tiles: dict[int, ImageData] = {}
        first = image.tiles[0].number if len(image.tiles) else 1001
        lost = []
        for number in [tile.number for tile in image.tiles]:
            data = _image_data(image, encoding) if number == first else _tile_data(image, number, encoding)
            if data is None:
                lost.append(str(number))
            else:
                tiles[number] = data
        if lost and tiles:
            what = f"tiles {', '.join(lost)} could not be read from '{_path(image)}'; they are magenta"
            self._warnings.append(f"image '{image.name}': {what}")
        return ImageSet(image.name, tiles, True, None if tiles else _missing(image))


def _may_change_unseen(image: bpy.types.Image) -> bool:
    """Whether an image may show something else without any sign of it: another frame, or pixels that a script sets."""
    return image.source in _FRAMES or bool(image.is_dirty)


def _state(image: bpy.types.Image) -> tuple[Any, ...]:
    """What an image that nobody reports as changed looks like from outside."""
    path = _path(image)
    try:
        written = os.stat(path).st_mtime_ns
    except (OSError, ValueError):
        written = 0
    return (
        image.name, image.source, path, written, len(image.packed_files), tuple(tile.number for tile in image.tiles),
        tuple(image.size), image.channels, image.is_float, image.alpha_mode, image.colorspace_settings.name,
    )  # fmt: skip


def _path(image: bpy.types.Image) -> str:
    return bpy.path.abspath(image.filepath, library=image.library)


def _missing(image: bpy.types.Image) -> str:
    path = _path(image)
    if not path:
        return f"uses image '{image.name}', which has no pixels; it is magenta"
    what = "cannot be read" if os.path.exists(path) else "is missing"
    return f"uses image '{image.name}', but its file '{path}' {what}; it is magenta. Find it by File > External Data"


def _image_data(image: bpy.types.Image, encoding: ImageEncoding) -> ImageData | None:
    """The pixels of an image (of a tiled one: of its first tile). None: there are none."""
    width, height = image.size
    channels = image.channels
    if width <= 0 or height <= 0 or channels <= 0:
        return None
    values = np.empty(width * height * channels, dtype=np.float32)
    if len(image.pixels) != values.size:
        return None
    image.pixels.foreach_get(values)
    pixels = _rgba(values.reshape(height, width, channels))
    alpha_mode = _ALPHA_MODES.get(image.alpha_mode, AlphaMode.STRAIGHT)
    stored: np.ndarray[Any, Any] = np.nan_to_num(pixels, nan=0.0, posinf=65504.0, neginf=-65504.0)
    if not image.is_float:
        stored = (np.clip(pixels, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
    opaque = 255 if stored.dtype == np.uint8 else 1.0
    if alpha_mode is AlphaMode.NONE:
        stored[..., 3] = opaque
    elif bool((stored[..., 3] >= opaque).all()):
        alpha_mode = AlphaMode.NONE  # full everywhere: nothing needs to ask for it
    return ImageData(image.name, stored, encoding, alpha_mode)


def _rgba(pixels: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """(H, W, 4) of (H, W, 1..4): grey, grey and alpha, RGB, RGBA."""
    height, width, channels = pixels.shape
    if channels == 4:
        return pixels
    full = np.ones((height, width, 4), dtype=np.float32)
    full[..., :3] = pixels[..., :3] if channels == 3 else pixels[..., :1]
    if channels == 2:
        full[..., 3] = pixels[..., 1]
    return full


def _tile_data(image: bpy.types.Image, number: int, encoding: ImageEncoding) -> ImageData | None:
    """One tile of a UDIM set, through a copy of the image that points at the tile's own file."""
    column, row = (number - 1001) % 10, (number - 1001) // 10
    path = _path(image).replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}")
    packed = [file for file in image.packed_files if str(number) in os.path.basename(file.filepath)]
    copy = None
    try:
        if packed:
            data = packed[0].packed_file.data
            copy = bpy.data.images.new(image.name, 1, 1)
            copy.pack(data=data, data_len=len(data))
            copy.source = "FILE"
        elif os.path.exists(path):
            copy = bpy.data.images.load(path, check_existing=False)
        else:
            return None
        copy.colorspace_settings.name = image.colorspace_settings.name
        copy.alpha_mode = image.alpha_mode
        return _image_data(copy, encoding)
    finally:
        if copy is not None:
            bpy.data.images.remove(copy)
