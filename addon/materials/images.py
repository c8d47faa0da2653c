# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour with or without alpha, as an Image Texture node gives it: settled in the pixels, before any filtering.

As Cycles does, on the encoded numbers: an sRGB byte of 128 with half alpha becomes 64, not half the light.
"""

from __future__ import annotations

import weakref

import numpy as np

from .graph import AlphaMode, ImageData, ImageEncoding

_associated: weakref.WeakKeyDictionary[ImageData, ImageData] = weakref.WeakKeyDictionary()
_unassociated: weakref.WeakKeyDictionary[ImageData, ImageData] = weakref.WeakKeyDictionary()


def image_as_read(image: ImageData, is_alpha_used: bool) -> ImageData:
    """The pixels that a node reads: colour without alpha where its Alpha output is used too, else colour times alpha.

    The same object for the same image, which is ``image`` itself where nothing changes.
    """
    if image.encoding is ImageEncoding.DATA:
        return image
    if image.alpha_mode is AlphaMode.STRAIGHT and not is_alpha_used:
        return _cached(_associated, image, False)
    if image.alpha_mode is AlphaMode.PREMULTIPLIED and is_alpha_used:
        return _cached(_unassociated, image, True)
    return image


def _cached(cache: weakref.WeakKeyDictionary[ImageData, ImageData], image: ImageData, divide: bool) -> ImageData:
    if image not in cache:
        cache[image] = _divided(image) if divide else _multiplied(image)
    return cache[image]


def _multiplied(image: ImageData) -> ImageData:
    pixels = image.pixels.copy()
    if pixels.dtype == np.uint8:
        color = pixels[..., :3].astype(np.uint16) * pixels[..., 3:]
        pixels[..., :3] = (color + 127) // 255
    else:
        pixels[..., :3] *= pixels[..., 3:]
    return ImageData(image.name, pixels, image.encoding, AlphaMode.PREMULTIPLIED)


def _divided(image: ImageData) -> ImageData:
    """Bytes cannot be brighter than white: they are clipped."""
    full = 255.0 if image.pixels.dtype == np.uint8 else 1.0
    values = image.pixels.astype(np.float32)
    alpha = np.where(values[..., 3:] > 0.0, values[..., 3:] / full, 1.0)
    values[..., :3] /= alpha
    if image.pixels.dtype == np.uint8:
        values = np.clip(values + 0.5, 0.0, 255.0)
    return ImageData(image.name, values.astype(image.pixels.dtype), image.encoding, AlphaMode.STRAIGHT)
