# SPDX-License-Identifier: GPL-3.0-or-later
"""Render passes: one table from the renderer's names to Blender's, and how pictures get into a render result.

Needs no import of Blender: what it works on is passed in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]


@dataclass(frozen=True)
class FilmPass:
    """One pass. ``channels`` has one letter for each channel; Blender shows them in files."""

    name: str  # in the renderer
    channels: str
    name_4: str  # in Blender 4.5
    name_5: str  # in Blender 5.0 and later
    flag: str | None  # property of a view layer that asks for the pass; None: always there
    panel: str  # where the flag is shown: "Data" or "Light"

    def blender_name(self, version: tuple[int, ...]) -> str:
        """The name in Blender ``version``: the one that Cycles uses there, so that compositor set-ups keep working."""
        return self.name_5 if version >= (5,) else self.name_4

    @property
    def kind(self) -> str:
        """The socket type that Blender's compositor gives the pass."""
        return {"Z": "VALUE", "XYZ": "VECTOR"}.get(self.channels, "COLOR")


PASSES: tuple[FilmPass, ...] = (
    FilmPass("combined", "RGBA", "Combined", "Combined", None, "Data"),
    FilmPass("depth", "Z", "Depth", "Depth", "use_pass_z", "Data"),
    FilmPass("position", "XYZ", "Position", "Position", "use_pass_position", "Data"),
    FilmPass("normal", "XYZ", "Normal", "Normal", "use_pass_normal", "Data"),
    FilmPass("diffuse_direct", "RGB", "DiffDir", "Diffuse Direct", "use_pass_diffuse_direct", "Light"),
    FilmPass("diffuse_indirect", "RGB", "DiffInd", "Diffuse Indirect", "use_pass_diffuse_indirect", "Light"),
    FilmPass("diffuse_color", "RGB", "DiffCol", "Diffuse Color", "use_pass_diffuse_color", "Light"),
    FilmPass("glossy_direct", "RGB", "GlossDir", "Glossy Direct", "use_pass_glossy_direct", "Light"),
    FilmPass("glossy_indirect", "RGB", "GlossInd", "Glossy Indirect", "use_pass_glossy_indirect", "Light"),
    FilmPass("glossy_color", "RGB", "GlossCol", "Glossy Color", "use_pass_glossy_color", "Light"),
    FilmPass("emission", "RGB", "Emit", "Emission", "use_pass_emit", "Light"),
    FilmPass("environment", "RGB", "Env", "Environment", "use_pass_environment", "Light"),
)


def wanted_passes(view_layer: Any) -> list[FilmPass]:
    """The passes that a ``bpy.types.ViewLayer`` asks for, in the order of the table."""
    return [film_pass for film_pass in PASSES if film_pass.flag is None or getattr(view_layer, film_pass.flag)]


def with_channels(pixels: FloatArray, count: int) -> FloatArray:
    """``pixels`` (H, W, C) with ``count`` channels: the first ones, or grey repeated, or opaque alpha appended."""
    have = pixels.shape[2]
    if have >= count:
        return pixels[:, :, :count]
    if have == 1:
        pixels = np.repeat(pixels, min(count, 3), axis=2)
        have = pixels.shape[2]
    padding = np.ones((*pixels.shape[:2], count - have), np.float32)
    return np.concatenate([pixels, padding], axis=2)


def write_passes(
    render_passes: Iterable[Any], available: Iterable[str], read: Callable[[str], FloatArray], version: tuple[int, ...]
) -> list[str]:
    """Fills Blender's render passes of one layer.

    ``render_passes``: ``bpy.types.RenderPass`` of the layer, for every view. ``read(name)`` gives (H, W, C) float32,
    row 0 at the bottom. Returns Blender's names of the passes that the renderer does not have; they stay as they are.
    Raises ValueError when a picture has another size than the pass.
    """
    by_blender_name = {film_pass.blender_name(version): film_pass for film_pass in PASSES}
    available = set(available)
    missing = []
    for render_pass in render_passes:
        film_pass = by_blender_name.get(render_pass.name)
        if film_pass is None or film_pass.name not in available:
            missing.append(render_pass.name)
            continue
        pixels = with_channels(read(film_pass.name), render_pass.channels)
        if pixels.size != len(render_pass.rect) * render_pass.channels:
            height, width = pixels.shape[:2]
            raise ValueError(
                f"pass {render_pass.name}: the picture of {width} x {height} pixels does not fit "
                f"the {len(render_pass.rect)} pixels of the render result"
            )
        # foreach_set is hundreds of times faster than an assignment to rect.
        render_pass.rect.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    return missing
