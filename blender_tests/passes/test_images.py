# SPDX-License-Identifier: GPL-3.0-or-later
"""Images with alpha, seen from afar."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.materials.graph import AlphaMode, ImageData, ImageEncoding, ImageSet
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline


@pytest.mark.parametrize("mode", [AlphaMode.STRAIGHT, AlphaMode.PREMULTIPLIED])
def test_clear_pixels_of_an_image_have_no_colour(mode: AlphaMode, gpu: GpuContext) -> None:
    """Opaque red ones and clear ones of whatever colour, many to a pixel: half opaque, and red (sRGB 188: .5029)."""
    pixels = np.zeros((16, 16, 4), np.uint8)
    pixels[:, :8] = (188, 0, 0, 255)
    pixels[:, 8:] = (0, 255, 0, 0) if mode is AlphaMode.STRAIGHT else 0
    image = ImageSet("leaf", {1001: ImageData("leaf", pixels, ImageEncoding.SRGB, mode)})
    leaf = material(
        node("T", "TexImage", image=image), node("C", "BsdfTransparent"),
        node("E", "Emission", Color="T.Color", Strength=1.0),
        node("M", "MixShader", Fac="T.Alpha", Shader="C.BSDF", Shader_001="E.E"), surface="M.S", name="leaf",
    )  # fmt: skip
    made = scenes.scene(
        (scenes.plane(2.0), leaf), camera=scenes.camera((0.0, 0.0, 3.0), width=2.0), film_transparent=True,
        pixel_filter_width=0.0,
    )  # fmt: skip
    with pipeline(gpu, made, scenes.settings(16), (1, 1), samples=512) as ready:
        found = ready.film.read("combined").mean((0, 1))
    assert found[3] == pytest.approx(0.5, abs=0.06)
    np.testing.assert_allclose(found[:3] / found[3], [0.5029, 0.0, 0.0], atol=0.005)
