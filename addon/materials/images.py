# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour and alpha, as an Image Texture node gives them: settled in the pixels, so that filtering keeps them right.

Where a node's Alpha output is used too, pixels hold light times alpha, and what is looked up is divided by alpha: the
mean of colours must not hold what lies in clear pixels. Else they hold colour times alpha as Cycles makes it, on the
encoded numbers: an sRGB byte of 128 with half alpha becomes 64, not half the light.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from .graph import AlphaMode, ImageData, ImageEncoding

_Cache = weakref.WeakKeyDictionary[ImageData, ImageData]
_associated: _Cache = weakref.WeakKeyDictionary()
_weighed: _Cache = weakref.WeakKeyDictionary()


def divides_by_alpha(image: ImageData, is_alpha_used: bool) -> bool:
    """Whether colours looked up in the pixels of :func:`image_as_read` are to be divided by their alpha."""
    has_own = image.alpha_mode in (AlphaMode.STRAIGHT, AlphaMode.PREMULTIPLIED)
    return is_alpha_used and has_own and image.encoding is not ImageEncoding.DATA


def image_as_read(image: ImageData, is_alpha_used: bool) -> ImageData:
    """The pixels that a node reads: the same object for the same image, and ``image`` itself where nothing changes."""
    if divides_by_alpha(image, is_alpha_used):
        if image.alpha_mode is AlphaMode.PREMULTIPLIED and image.encoding is ImageEncoding.LINEAR:
            return image
        return _cached(_weighed, image, _times_alpha)
    if image.alpha_mode is AlphaMode.STRAIGHT and image.encoding is not ImageEncoding.DATA:
        return _cached(_associated, image, _multiplied)
    return image


def _cached(cache: _Cache, image: ImageData, make: Callable[[ImageData], ImageData]) -> ImageData:
    if image not in cache:
        cache[image] = make(image)
    return cache[image]


def _multiplied(image: ImageData) -> ImageData:
    pixels = image.pixels.copy()
    if pixels.dtype == np.uint8:
        color = pixels[..., :3].astype(np.uint16) * pixels[..., 3:]
        pixels[..., :3] = (color + 127) // 255
    else:
        pixels[..., :3] *= pixels[..., 3:]
    return ImageData(image.name, pixels, image.encoding, AlphaMode.PREMULTIPLIED)


def _times_alpha(image: ImageData) -> ImageData:
    """Light times alpha, encoded again. Bytes cannot be brighter than white: they are clipped."""
    full = 255.0 if image.pixels.dtype == np.uint8 else 1.0
    values = image.pixels.astype(np.float32) / full
    alpha = values[..., 3:]
    if image.alpha_mode is AlphaMode.PREMULTIPLIED:
        values[..., :3] /= np.where(alpha > 0.0, alpha, 1.0)
    if image.encoding is ImageEncoding.SRGB:
        values[..., :3] = _encoded(_decoded(values[..., :3]) * alpha)
    else:
        values[..., :3] *= alpha
    if image.pixels.dtype == np.uint8:
        values = np.clip(values * full + 0.5, 0.0, full)
    return ImageData(image.name, values.astype(image.pixels.dtype), image.encoding, AlphaMode.PREMULTIPLIED)


def _decoded(encoded: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Light of sRGB numbers (IEC 61966-2-1)."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4)


def _encoded(light: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """And back."""
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * np.maximum(light, 0.0) ** (1.0 / 2.4) - 0.055)
