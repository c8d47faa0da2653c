# SPDX-License-Identifier: GPL-3.0-or-later
"""Voxel faces share the indirect light that links bring them: less noise, and nothing through walls."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.passes.share_faces import SharePass
from addon.passes.voxelize import Voxels
from addon.scene import LightKind, SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, radiance, read_voxels


def room(*, divided_by: float = 0.0) -> SceneData:
    """A closed room with a lamp in one half; a wall of a thickness (m) may divide it."""
    white = scenes.diffuse(0.6)
    objects = [(scenes.box((-2.0, -1.0, -1.0), (2.0, 1.0, 1.0), inside_out=True), white)]
    if divided_by:
        half = 0.5 * divided_by
        objects.append((scenes.box((-half, -1.0, -1.0), (half, 1.0, 1.0)), white))
    return scenes.scene(*objects, lights=[scenes.light(LightKind.POINT, 10.0, (1.0, -0.3, 0.4))])


def faces(gpu: GpuContext, scene: SceneData, resolution: int, rays: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) places of faces, m, and (N,) what leaves them."""
    with pipeline(gpu, scene, scenes.settings(resolution, bounce_rays=rays), samples=0) as ready:
        voxels, geometry, grid = ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry, ready.grid
        assert voxels is not None and geometry is not None and grid is not None
        place = read_voxels(voxels, geometry).faces["position"] * grid.cell_size + np.asarray(grid.origin)
        return place, radiance(ready)[:, 0]


def unshared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Faces keep what their own links bring: none finds another to share with."""

    def nobody(self: SharePass, voxels: Voxels) -> moderngl.Texture:
        none = np.zeros(voxels.faces.count, np.uint32)
        self._partners = self.gpu.list_texture("partners of faces", len(none), 1, "u4", none)
        return self._partners

    monkeypatch.setattr(SharePass, "_find_partners", nobody)


def test_noise_falls(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Against very many links: half of the squared error that a face's own links leave, and the same mean."""
    _, right = faces(gpu, room(), 32, 256)
    _, shared = faces(gpu, room(), 32, 8)
    unshared(monkeypatch)
    _, own = faces(gpu, room(), 32, 8)
    assert np.mean((shared - right) ** 2) < 0.5 * np.mean((own - right) ** 2)
    assert shared.mean() == pytest.approx(own.mean(), rel=0.005)


@pytest.mark.parametrize("thickness", [0.01, 0.1])
def test_walls_are_not_passed(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch, thickness: float) -> None:
    """What little light links carry into a half without a lamp, where floors meet a thin wall, does not become more."""
    found = []
    for shares in (True, False):
        if not shares:
            unshared(monkeypatch)
        place, light = faces(gpu, room(divided_by=thickness), 32, 8)
        dark = place[:, 0] < -0.5 * thickness - 1e-4
        assert light[~dark].max() > 0.1 and dark.sum() > 500
        found.append((light[dark].mean(), light[dark].max()))
    assert found[0][0] < 1.01 * found[1][0] + 1e-6 and found[0][1] <= found[1][1]
