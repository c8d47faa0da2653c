# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive passes: quiet tiles stop, noisy ones go on, and the picture stays the mean of the passes each tile had."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.passes.converge import FIRST_LOOK
from addon.scene import LightKind, SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline

SIZE = (64, 48)


def half_quiet() -> SceneData:
    """Left of the middle the sky alone; right of it a floor below a wide lamp, whose penumbra is noise."""
    return scenes.scene(
        (scenes.plane(4.0), scenes.diffuse(0.8), scenes.at(4.0)),
        (scenes.box(), scenes.diffuse(0.8), scenes.at(1.5, 0.0, 0.5, 0.4)),
        lights=[scenes.light(LightKind.AREA, 20.0, (2.0, 0.0, 2.5), size=(2.0, 2.0))],
        camera=scenes.camera((0.0, 0.0, 5.0), width=4.0), world=scenes.world(0.5), pixel_filter_width=0.5,
    )  # fmt: skip


def test_quiet_tiles_stop_first(gpu: GpuContext) -> None:
    settings = scenes.settings(16, noise_threshold=0.02)
    with pipeline(gpu, half_quiet(), settings, SIZE, samples=24) as ready:
        convergence = ready.film._convergence
        assert convergence is not None and not ready.film.is_converged
        weights = convergence._counts
        assert weights[:, :3].max() == FIRST_LOOK  # sky
        assert weights[:, 4:].max() == 24
        assert FIRST_LOOK < ready.film.mean_samples < 24
        picture = ready.film.read("combined")
        np.testing.assert_allclose(picture[:, :24, :3], 0.5, rtol=1e-5)
        np.testing.assert_allclose(picture[..., 3], 1.0, rtol=1e-5)


def test_it_ends_and_is_as_good_as_it_says(gpu: GpuContext) -> None:
    """Done before the limit; the mean of what is shown is that of many passes, and the error about the threshold's."""
    with pipeline(gpu, half_quiet(), scenes.settings(16), SIZE, samples=256) as ready:
        truth = ready.film.read("combined")[..., :3]
    errors = []
    for threshold in (0.2, 0.08):
        settings = scenes.settings(16, noise_threshold=threshold)
        with pipeline(gpu, half_quiet(), settings, SIZE, samples=0) as ready:
            for _ in range(200):
                for _ in ready.sample():
                    pass
                if ready.film.is_converged:
                    break
            assert ready.film.is_converged and ready.film.samples < 200
            found = ready.film.read("combined")[..., :3]
        errors.append(np.sqrt(np.mean(np.abs(found - truth).sum(-1) ** 2 / truth.sum(-1))))
        assert errors[-1] < 2.0 * threshold
        assert found.mean() == pytest.approx(truth.mean(), rel=0.01)
    assert errors[1] < errors[0]


def test_noise_is_not_hidden_by_light_taken_over(gpu: GpuContext) -> None:
    """Where all noise is that of gathers, it reads as high as it is, though passes were to take over light."""
    scene = scenes.scene(
        (scenes.box((-2.0, -2.0, 0.0), (2.0, 2.0, 3.0), inside_out=True), scenes.diffuse(0.8)),
        (scenes.plane(1.5), scenes.emission(4.0), scenes.at(0.0, 0.0, 0.1)),
        camera=scenes.camera((0.0, -1.9, 1.5), (0.0, 1.0, 1.5), aspect=4 / 3),
    )  # fmt: skip
    plain = {"use_reconstruction": False, "rays": 1}
    with pipeline(gpu, scene, scenes.settings(16, **plain), SIZE, samples=512) as ready:
        truth = ready.film.read("combined")[..., :3]
    for interval in (1, 4):
        settings = scenes.settings(16, noise_threshold=1e-6, gather_interval=interval, **plain)
        with pipeline(gpu, scene, settings, SIZE, samples=16) as ready:
            convergence = ready.film._convergence
            assert convergence is not None
            found, read = ready.film.read("combined")[..., :3], convergence.noise.mean()
        noise = np.sqrt(np.mean(np.abs(found - truth).sum(-1) ** 2) / truth.sum(-1).mean())
        assert 0.5 < read / noise < 2.0, interval


def test_without_a_threshold_there_is_no_cost(gpu: GpuContext) -> None:
    with pipeline(gpu, half_quiet(), scenes.settings(16), SIZE, samples=1) as ready:
        plain = ready.statistics()["memory"]["film"]
        assert ready.film.active_tiles is None and not ready.film.is_converged
    with pipeline(gpu, half_quiet(), scenes.settings(16, noise_threshold=0.01), SIZE, samples=1) as ready:
        assert ready.statistics()["memory"]["film"] > plain
