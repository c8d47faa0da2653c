# SPDX-License-Identifier: GPL-3.0-or-later
"""The GGX lobe: its sampled directions, its value and its albedo agree, and a white one loses no light."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.materials.operations import specular_scale_bias
from blender_tests.passes.run import map_list, test_kernel

COUNT = 1 << 15


def strata(count: int) -> np.ndarray:
    """(N, 2) points of the R2 sequence."""
    return (np.arange(count)[:, None] * np.array([0.7548776662466927, 0.5698402909980532]) + 0.5) % 1.0


def lobe(gpu: GpuContext, cosine: float, roughness: float) -> np.ndarray:
    inputs = np.concatenate([np.full((COUNT, 1), cosine), np.full((COUNT, 1), roughness), strata(COUNT)], axis=1)
    return map_list(gpu, test_kernel(gpu, "ggx"), inputs, 8)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("cosine", [0.2, 0.6, 1.0])
def test_sampled_and_integrated_albedo_agree(cosine: float, roughness: float, gpu: GpuContext) -> None:
    """Mean weight of sampled directions = integral of the lobe over the hemisphere = the fit that materials use."""
    found = lobe(gpu, cosine, roughness)
    sampled, fit = found[:, 3].mean(), found[0, 5]
    assert sampled == pytest.approx(fit, abs=0.012)
    if roughness >= 0.3:  # a narrower lobe needs more uniform directions than this
        assert found[:, 4].mean() == pytest.approx(sampled, rel=0.02)
    assert sampled <= 1.0 + 1e-5
    assert sum(specular_scale_bias(cosine, roughness)) == pytest.approx(fit, abs=1e-4)


@pytest.mark.parametrize("roughness", [0.3, 0.7])
def test_sampled_directions_follow_the_lobe(roughness: float, gpu: GpuContext) -> None:
    """Histogram of sampled cosines, weighted, against the lobe's integral over rings."""
    found = lobe(gpu, 0.7, roughness)
    z = found[:, 2]
    edges = np.linspace(0.0, 1.0, 9)
    sampled = np.histogram(z, edges, weights=found[:, 3])[0] / COUNT
    integrated = np.histogram(strata(COUNT)[:, 0], edges, weights=found[:, 4])[0] / COUNT
    np.testing.assert_allclose(sampled, integrated, atol=0.01)
    np.testing.assert_allclose(np.linalg.norm(found[:, :3], axis=1), 1.0, atol=1e-4)


@pytest.mark.parametrize("roughness", [0.3, 0.7])
def test_density_of_sampled_directions(roughness: float, gpu: GpuContext) -> None:
    """In each ring of cosines the density integrates to the share of directions that were sent there."""
    for cosine in (0.3, 0.9):
        found = lobe(gpu, cosine, roughness)
        edges = np.linspace(0.0, 1.0, 5)
        sent = np.histogram(found[:, 2], edges)[0] / COUNT
        integrated = np.histogram(strata(COUNT)[:, 0], edges, weights=found[:, 6])[0] / COUNT
        np.testing.assert_allclose(integrated, sent, atol=0.01)
