# SPDX-License-Identifier: GPL-3.0-or-later
"""What is asked most is read as textures or as images: the same bits."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.gpu.loader import is_software
from addon.scene import SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline
from blender_tests.passes.test_history import frames, metallic, moved, room, settings


def instances() -> SceneData:
    """Spheres that share their triangles, one turned over, and a floor."""
    ball, white = scenes.sphere(0.3, rings=64), scenes.diffuse(0.7)
    placed = [
        (ball, white, scenes.at(x, y, 0.4, scale)) for x, y, scale in ((-0.5, 0, 1), (0.4, 0.2, -1), (0, -0.6, 0.5))
    ]
    return scenes.scene((scenes.plane(3.0), white), *placed, world=scenes.world(1.0), camera=scenes.camera())


@pytest.mark.parametrize("make", [scenes.cornell, instances])
def test_images_and_textures_give_the_same_bits(make: object, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    if not gpu.reads_images:
        pytest.skip("too few image units, or textures are as good there")
    pictures = []
    for reads_images in (True, False):
        monkeypatch.setattr(gpu, "reads_images", reads_images)
        monkeypatch.setattr(gpu, "_kernels", {})
        with pipeline(gpu, make(), scenes.settings(24), size=(24, 16), samples=2) as ready:  # type: ignore[operator]
            pictures.append(ready.film.read("combined"))
    assert pictures[0][..., :3].mean() > 0.01
    np.testing.assert_array_equal(*pictures)


def test_light_of_neighbours_and_of_earlier_frames_has_the_same_bits(
    gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures of surfaces, of light that pixels share, and of what frames leave behind; matte and glossy."""
    if not gpu.reads_images:
        pytest.skip("too few image units, or textures are as good there")
    first = metallic(room(), 0.3)
    shown = [moved(first, eye) for eye in (0.0, 0.02)]
    pictures = []
    for reads_images in (True, False):
        monkeypatch.setattr(gpu, "reads_images", reads_images)
        monkeypatch.setattr(gpu, "_kernels", {})
        pictures.append(np.array(list(frames(gpu, shown, settings(use_reconstruction=True, samples=3)))))
        used = [(name, dict(defines)) for name, defines, _ in gpu._kernels]
        for glossy in (False, True):
            assert any(name == "reconstruct" and of["GLOSSY"] == glossy for name, of in used)
            assert any(name == "history" and of["GLOSSY"] == glossy and of["TAKES_OVER"] for name, of in used)
    assert pictures[0].mean() > 0.01 and (pictures[0][0] != pictures[0][1]).any()
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(
    ("renderer", "expected"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True),
        ("zink Vulkan 1.3(llvmpipe (LLVM 15.0.6, 256 bits) (MESA_LLVMPIPE))", True),
        ("NVIDIA H100 80GB HBM3/PCIe/SSE2", False),
        ("AMD Radeon RX 6800 (radeonsi, navi21, LLVM 15.0.6)", False),
    ],
)
def test_names_of_drivers_that_draw_on_the_cpu(renderer: str, expected: bool) -> None:
    assert is_software(renderer) == expected
