# SPDX-License-Identifier: GPL-3.0-or-later
"""Views that explain a picture show what voxels hold and what keeps light from pixels, and cost nothing otherwise."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.passes.view import PIXEL_VIEWS, VOXEL_VIEWS
from addon.scene import LightKind, SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline

SIZE = (32, 32)


def from_above(*objects: tuple, width: float = 4.0, **more: object) -> SceneData:
    """Seen straight down, so that a pixel's place is known; ``width``: metres that the picture shows."""
    camera = scenes.camera((0.0, 0.0, 3.0), width=width)
    return scenes.scene(*objects, camera=camera, pixel_filter_width=0.0, **more)


def shown(gpu: GpuContext, scene: SceneData, name: str, size: tuple[int, int] = SIZE, **settings: object) -> np.ndarray:
    """(H, W, 4) the view after two passes."""
    with pipeline(gpu, scene, scenes.settings(16, **settings), size, samples=2, outputs=(name,)) as ready:
        return ready.film.read_mean(name)


def middle(picture: np.ndarray) -> np.ndarray:
    """The mean over what lies well inside a plane of half the picture's width."""
    return picture[12:20, 12:20].reshape(-1, 4).mean(axis=0)


def test_voxels_are_where_surfaces_are(gpu: GpuContext) -> None:
    picture = shown(gpu, from_above((scenes.plane(2.0), scenes.diffuse())), "voxels")
    covered = picture[..., 3]
    assert (covered[10:22, 10:22] == 1.0).all() and (covered[:6] == 0.0).all() and (covered[:, 26:] == 0.0).all()
    assert (picture[covered > 0.0][:, :3] > 0.05).all()


def test_blocks_are_larger(gpu: GpuContext) -> None:
    """Small boxes far apart: blocks of 2^level cells hold what finer ones hold, and some more."""
    box = scenes.box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))
    scene = from_above((box, scenes.diffuse(), scenes.at(0.7, 0.7)), (box, scenes.diffuse(), scenes.at(-0.7, -0.7)))
    covered = [shown(gpu, scene, "voxels", viewport_level=level)[..., 3] > 0.5 for level in range(5)]
    for finer, coarser in itertools.pairwise(covered):
        assert (coarser | ~finer).all()
    areas = [picture.sum() for picture in covered]
    assert areas[0] < areas[2] < areas[3] < areas[4]


def test_faces_hold_what_surfaces_are(gpu: GpuContext) -> None:
    scene = from_above((scenes.plane(2.0), scenes.diffuse((0.2, 0.4, 0.6))), world=scenes.world(1.0))
    np.testing.assert_allclose(middle(shown(gpu, scene, "voxel_albedo")), [0.2, 0.4, 0.6, 1.0], atol=0.01)
    np.testing.assert_allclose(middle(shown(gpu, scene, "voxel_normal")), [0.5, 0.5, 1.0, 1.0], atol=0.01)
    np.testing.assert_allclose(middle(shown(gpu, scene, "voxel_radiance")), [0.2, 0.4, 0.6, 1.0], atol=0.01)
    np.testing.assert_allclose(middle(shown(gpu, scene, "voxel_opacity")), [1.0, 1.0, 1.0, 1.0], atol=0.01)
    assert (middle(shown(gpu, scene, "voxel_emission")) == [0.0, 0.0, 0.0, 1.0]).all()


def test_emission_of_voxels(gpu: GpuContext) -> None:
    scene = from_above((scenes.plane(2.0), scenes.glowing(0.5, (0.5, 2.0, 3.0))))
    np.testing.assert_allclose(middle(shown(gpu, scene, "voxel_emission")), [0.5, 2.0, 3.0, 1.0], rtol=0.01)


def test_large_voxels_have_edges(gpu: GpuContext) -> None:
    scene = from_above((scenes.plane(2.0), scenes.diffuse(0.8)), width=0.5, world=scenes.world(1.0))
    values = shown(gpu, scene, "voxel_albedo", (64, 64))[..., 0]
    assert values.min() < 0.5 and (np.abs(values - 0.8) < 0.01).mean() > 0.5, "dark lines on flat faces"


def test_shadows_and_what_is_turned_away(gpu: GpuContext) -> None:
    """A sun from above: no light comes under a roof, all of it beside it."""
    scene = from_above(
        (scenes.plane(2.0), scenes.diffuse()), (scenes.plane(0.8, 2.0), scenes.diffuse(), scenes.at(z=2.0)),
        lights=[scenes.light(LightKind.SUN, 1.0, direction=(0.3, 0.0, -1.0))],
    )  # fmt: skip
    picture = shown(gpu, scene, "shadow")
    beside = picture[4:28, 9:23]
    assert 0.05 < (beside[..., 0] == 0.0).mean() < 0.5 and (beside[..., 0] == 1.0).mean() > 0.3
    below = scenes.light(LightKind.SUN, 1.0, direction=(0.0, 0.0, 1.0))
    dark = from_above((scenes.plane(2.0), scenes.diffuse()), lights=[below])
    assert (middle(shown(gpu, dark, "shadow")) == [0.0, 0.0, 0.0, 1.0]).all()


def test_occlusion_is_what_is_near(gpu: GpuContext) -> None:
    """A plane at distance d over another covers it wholly; where it is farther than is asked for, not at all."""
    roof = (scenes.plane(8.0), scenes.diffuse(), scenes.at(z=4.0))
    scene = from_above((scenes.plane(2.0), scenes.diffuse()), roof)
    assert middle(shown(gpu, scene, "ambient_occlusion", ao_distance=3.0))[0] == 1.0
    assert middle(shown(gpu, scene, "ambient_occlusion", ao_distance=40.0))[0] < 0.6


def test_parts_of_light_make_the_picture(gpu: GpuContext) -> None:
    with pipeline(gpu, scenes.cornell(), scenes.settings(16), SIZE, samples=2,
                  outputs=("direct", "indirect")) as ready:  # fmt: skip
        parts = ready.film.read("direct") + ready.film.read("indirect")
        np.testing.assert_allclose(parts, ready.film.read("combined")[..., :3], rtol=1e-4, atol=1e-5)
        assert ready.film.read("indirect").mean() > 0.01


def test_passes_are_counted(gpu: GpuContext) -> None:
    """Of those asked for; quiet tiles have had fewer where there is a threshold."""
    half = shown(gpu, scenes.cornell(), "sample_count", samples=4)
    assert (half[..., :3] == 0.5).all()
    settings = scenes.settings(16, samples=64, noise_threshold=0.05)
    with pipeline(gpu, scenes.cornell(), settings, SIZE, outputs=("sample_count",)) as ready:
        found = np.unique(ready.film.read("sample_count"))
        assert len(found) > 1 and found.max() <= 1.0
        assert ready.film.read("sample_count").mean() * 64 == pytest.approx(ready.film.mean_samples, abs=1.0)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Names of the shaders that are asked for."""
    names: set[str] = set()
    original = GpuContext.kernel

    def kernel(self: GpuContext, name: str, *arguments: Any) -> Any:
        names.add(name)
        return original(self, name, *arguments)

    monkeypatch.setattr(GpuContext, "kernel", kernel)
    return names


def test_views_cost_nothing_when_they_are_off(gpu: GpuContext, asked: set[str]) -> None:
    with pipeline(gpu, scenes.cornell(), scenes.settings(16), SIZE, samples=1):
        pass
    assert "compose" in asked and not {"voxel_view", "pixel_view"} & asked


def test_voxels_need_nothing_at_pixels(gpu: GpuContext, asked: set[str]) -> None:
    for name in VOXEL_VIEWS:
        with pipeline(gpu, scenes.cornell(), scenes.settings(16), SIZE, samples=1, outputs=(name,)) as ready:
            assert ready.film.names == [name]
    assert "voxel_view" in asked and not {"surface", "direct", "gather", "reflect", "compose"} & asked


@pytest.mark.parametrize("mode", ["RAYS", "CONES", "OCCLUSION"])
def test_rays_of_a_pixel(mode: str, gpu: GpuContext) -> None:
    """They start on the surface that is seen there, go up from it, and end on the roof or in the sky."""
    roof = (scenes.plane(8.0), scenes.diffuse(0.5), scenes.at(z=4.0))
    scene = from_above((scenes.plane(2.0), scenes.diffuse()), roof, world=scenes.world((0.0, 0.0, 1.0)))
    with pipeline(gpu, scene, scenes.settings(32, gather_mode=mode, ao_distance=10.0), SIZE, samples=1) as ready:
        rays = ready.rays_at((0.625, 0.5))
        beside = ready.rays_at((0.01, 0.01))
    assert rays is not None and beside is not None and len(beside.ends) == 0
    assert len(rays.ends) == (6 if mode == "CONES" else 48)
    place = 4.0 * (20.5 / 32 - 0.5)
    assert abs(np.hypot(*rays.start[:2]) - np.hypot(place, 0.0625)) < 1e-3 and 0.0 <= rays.start[2] < 0.1
    assert (rays.ends[:, 2] > rays.start[2]).all()
    np.testing.assert_allclose(rays.ends[rays.meets][:, 2], 4.0, atol=0.01)
    assert rays.meets.sum() >= 1
    if mode == "RAYS":
        sky = rays.radiance[~rays.meets]
        assert len(sky) and np.allclose(sky, [0.0, 0.0, 1.0])


@pytest.mark.parametrize("name", (*VOXEL_VIEWS, *PIXEL_VIEWS))
def test_a_scene_without_anything_has_views(name: str, gpu: GpuContext) -> None:
    assert (shown(gpu, scenes.scene(), name) == 0.0).all()
