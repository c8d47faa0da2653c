# SPDX-License-Identifier: GPL-3.0-or-later
"""The table by which directions of the world are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu import interface
from addon.passes.world_table import concentration, direction_table, luminances, solid_angles, surplus

RNG = np.random.default_rng(3)


def test_texels_cover_the_sphere() -> None:
    assert float((solid_angles(7, 12) * np.ones((7, 12))).sum()) == pytest.approx(4.0 * np.pi)


def test_luminance_is_the_mean_of_what_the_sampler_reads() -> None:
    """Against the bilinear picture read at many points of a texel."""
    values = RNG.random((5, 6))
    found = luminances(np.repeat(values[..., None], 3, axis=2))
    around = np.pad(np.pad(values, ((1, 1), (0, 0)), mode="edge"), ((0, 0), (1, 1)), mode="wrap")
    at = (np.arange(100) + 0.5) / 100 - 0.5
    weight = np.stack([np.maximum(0, -at), 1 - np.abs(at), np.maximum(0, at)])
    for row in range(5):
        for column in range(6):
            mean = (weight.T @ around[row : row + 3, column : column + 3] @ weight).mean()
            assert found[row, column] == pytest.approx(mean, rel=1e-3)


def test_concentration() -> None:
    """1 for an even world, 2 for an even half of one, sphere over solid angle for a small patch, 0 for none."""
    half = np.zeros((64, 128))
    half[32:] = 5.0
    patch = np.zeros((64, 128))
    patch[50, 7] = 3.0
    assert concentration(np.full((64, 128), 7.0)) == pytest.approx(1.0)
    assert concentration(half) == pytest.approx(2.0)
    assert concentration(patch) == pytest.approx(4.0 * np.pi / solid_angles(64, 128)[50, 0])
    assert concentration(np.zeros((4, 8))) == 0.0


def test_surplus() -> None:
    """What is above the mean over the sphere: nothing of an even world."""
    half = np.zeros((64, 128))
    half[32:] = 5.0
    np.testing.assert_allclose(surplus(half), half / 2.0)
    assert surplus(np.ones((64, 128))).max() < 1e-12


def test_chances_follow_light() -> None:
    """Density times solid angle is the share of the light; sums are whole, end at the unit; dark texels have none."""
    light = RNG.random((16, 32)) ** 8
    light[3] = 0.0
    light[5, 10:20] = 0.0
    light[9, 4] = 500.0
    table, density = direction_table(light)
    angles = solid_angles(16, 32)
    share = light * angles / (light * angles).sum()
    np.testing.assert_allclose(density * angles, share, atol=1e-5)
    assert float((density * angles).sum()) == pytest.approx(1.0, abs=1e-6)
    assert (density[light == 0.0] == 0.0).all() and (density[light > 0.0] > 0.0).all()
    assert (table == np.rint(table)).all() and table[-1, -1] == interface.EMITTER_UNITS
    assert (table[[0, 9, 15], 31] == interface.EMITTER_UNITS).all() and (np.diff(table[:, 32]) >= 0.0).all()
