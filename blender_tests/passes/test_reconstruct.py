# SPDX-License-Identifier: GPL-3.0-or-later
"""Light shared between pixels: noise goes, gradients and edges stay, and with more passes so does everything else."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.passes.frame import Frame, Gather
from addon.passes.reconstruct import ReconstructPass
from addon.pipeline import Pipeline
from addon.scene import SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline

SIZE = (64, 48)


def shared(ready: Pipeline, light: np.ndarray, *, index: int = 0, glossy: bool = False) -> np.ndarray:
    """``light`` ((H, W, 4) float32; w: nearness) as pixels share it in pass ``index``."""
    surface, features = ready.picture.surface.pictures, ready.features
    assert surface is not None and features is not None
    camera, settings = ready.picture.camera, ready.picture.settings
    frame = Frame(index, index, Gather(index, index), camera, (0.5, 0.5), surface, features, settings)
    height, width = light.shape[:2]
    source = ready.gpu.texture("light", (width, height), 4, "f4")
    source.write(np.ascontiguousarray(light, np.float32).tobytes())
    sharing = ReconstructPass(ready.gpu, glossy=glossy)
    try:
        for _ in sharing.run(frame, source, index):
            pass
        assert sharing.shared is not None
        return np.frombuffer(sharing.shared.read(), np.float32).reshape(height, width, 4)[..., :3].copy()
    finally:
        sharing.release()
        ready.gpu.free(source)


def wall(material: object = None) -> SceneData:
    """A plane that fills the picture, seen straight on."""
    return scenes.scene(
        (scenes.plane(10.0), material or scenes.diffuse(0.5)),
        camera=scenes.camera((0.0, 0.0, 3.0), width=4.0), world=scenes.world(1.0), pixel_filter_width=0.0,
    )  # fmt: skip


def steps() -> SceneData:
    """Two planes side by side, one nearer to the eye."""
    return scenes.scene(
        (scenes.plane(10.0), scenes.diffuse(0.5)),
        (scenes.plane(10.0), scenes.diffuse(0.5), scenes.at(5.0, 0.0, 0.5)),
        camera=scenes.camera((0.0, 0.0, 3.0), width=4.0), world=scenes.world(1.0), pixel_filter_width=0.0,
    )  # fmt: skip


def picture(value: np.ndarray | float, nearness: float) -> np.ndarray:
    light = np.full((SIZE[1], SIZE[0], 4), nearness, np.float32)
    light[..., :3] = np.broadcast_to(value, (SIZE[1], SIZE[0], 3))
    return light


def test_noise_goes_where_nothing_is_near(gpu: GpuContext) -> None:
    """Five levels of nine pixels: the variance falls to less than a hundredth, and the mean stays."""
    noise = np.random.default_rng(1).random((SIZE[1], SIZE[0], 3)).astype(np.float32)
    with pipeline(gpu, wall(), scenes.settings(16), SIZE, samples=1) as ready:
        found = shared(ready, picture(noise, 0.0))
    assert found[16:-16, 16:-16].var() < 0.01 * noise.var()
    assert found.mean() == pytest.approx(noise.mean(), rel=0.01)


def test_gradients_stay(gpu: GpuContext) -> None:
    """A ramp is what it was, up to the border: pixels on opposite sides weigh the same."""
    ramp = np.broadcast_to(np.linspace(0.0, 1.0, SIZE[0], dtype=np.float32)[None, :, None], (SIZE[1], SIZE[0], 3))
    with pipeline(gpu, wall(), scenes.settings(16), SIZE, samples=1) as ready:
        np.testing.assert_allclose(shared(ready, picture(ramp, 0.0)), ramp, atol=1e-5)


def test_small_pictures_keep_their_light(gpu: GpuContext) -> None:
    """A peak in the middle of 8 x 8 pixels, near to walls: what it would give, pixels at the edges would not take."""
    y, x = np.mgrid[:8, :8] - 3.5
    light = np.full((8, 8, 4), 1.0, np.float32)
    light[..., :3] = np.exp(-0.25 * (x * x + y * y))[..., None]
    with pipeline(gpu, wall(), scenes.settings(16), (8, 8), samples=1) as ready:
        found = shared(ready, light)
    assert found.mean() == pytest.approx(light[..., :3].mean(), rel=0.03)


def test_edges_stay(gpu: GpuContext) -> None:
    """Nothing crosses a step in depth."""
    with pipeline(gpu, steps(), scenes.settings(16), SIZE, samples=1) as ready:
        pictures = ready.picture.surface.pictures
        assert pictures is not None
        depth = np.frombuffer(pictures.position.read(), np.float32).reshape(SIZE[1], SIZE[0], 4)[..., 2]
        upper = depth > depth.mean()
        assert 0.3 < upper.mean() < 0.7
        light = np.where(upper[..., None], 1.0, 0.0)
        np.testing.assert_allclose(shared(ready, picture(light, 0.0)), np.broadcast_to(light, (*upper.shape, 3)))


def test_sharing_ends_where_surfaces_are_near_and_passes_many(gpu: GpuContext) -> None:
    """The share of the noise that is left grows with nearness and with the number of passes, up to all of it."""
    noise = np.random.default_rng(2).random((SIZE[1], SIZE[0], 3)).astype(np.float32)
    with pipeline(gpu, wall(), scenes.settings(16), SIZE, samples=1) as ready:

        def left(nearness: float, index: int) -> float:
            return float(shared(ready, picture(noise, nearness), index=index).var() / noise.var())

        assert left(0.0, 0) < 0.5 * left(10.0, 0) < 0.5
        assert left(10.0, 0) < left(10.0, 100) < left(10.0, 10**6)
        assert left(10.0, 10**6) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("roughness", "aperture", "is_shared"), [(1.0, 1.0, True), (0.1, 1.0, False), (1.0, 0.01, False)]
)
def test_reflections_are_shared_within_their_lobe(
    roughness: float, aperture: float, is_shared: bool, gpu: GpuContext
) -> None:
    """A rough surface shares what it mirrors of things two cells away; a polished one does not, nor one that the
    settings polish. All keep the mean."""
    noise = np.random.default_rng(3).random((SIZE[1], SIZE[0], 3)).astype(np.float32)
    metal = scenes.principled((0.9, 0.5, 0.2), Metallic=1.0, Roughness=roughness)
    with pipeline(gpu, wall(metal), scenes.settings(16, specular_aperture=aperture), SIZE, samples=1) as ready:
        found = shared(ready, picture(noise, 0.5), glossy=True, index=10**3)
    left = found.var(axis=(0, 1)).mean() / noise.var(axis=(0, 1)).mean()
    assert left < 0.5 if is_shared else left > 0.9
    assert found.mean() == pytest.approx(noise.mean(), rel=0.01)


def test_a_noisy_room_comes_nearer_to_the_truth(gpu: GpuContext) -> None:
    """One pass of the Cornell box with sharing errs less than a third as much as without; brightness stays."""
    made = scenes.cornell()
    output = "diffuse_indirect"
    settings = scenes.settings(24, use_reconstruction=False)
    with pipeline(gpu, made, settings, SIZE, samples=128, outputs=(output,)) as ready:
        truth = ready.film.read(output)

    def error(samples: int, **more: bool) -> tuple[float, float]:
        with pipeline(gpu, made, scenes.settings(24, **more), SIZE, samples=samples, outputs=(output,)) as once:
            found = once.film.read(output)
        return float(np.mean((found - truth) ** 2)), float(found.mean() / truth.mean())

    assert error(1)[0] < error(1, use_reconstruction=False)[0] / 3.0
    assert error(16)[1] == pytest.approx(1.0, abs=0.01)
