# SPDX-License-Identifier: GPL-3.0-or-later
"""Guides: directions are drawn as densely as they say, the picture stays what it is, and has less noise."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from addon import voxel_light
from addon.features import Features
from addon.gpu import interface
from addon.gpu.context import GpuContext
from addon.scene import LightKind, SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import map_list, pipeline, test_kernel

SIDE = interface.GUIDE_SIDE
#: Facings of the axes' two directions: the axis, and its sign.
AXES = [(facing // 2, 1.0 - 2.0 * (facing % 2)) for facing in range(6)]


def tree(shares: np.ndarray) -> np.ndarray:
    """(GUIDE_TEXELS, 4) uint8 for (SIDE, SIDE) shares of bins, [y, x]."""
    levels = []
    while len(shares) > 1:
        half = len(shares) // 2
        fours = shares.reshape(half, 2, half, 2).transpose(0, 2, 1, 3).reshape(half * half, 4)
        levels.append(fours / np.maximum(fours.sum(axis=1, keepdims=True), 1e-9))
        shares = fours.sum(axis=1).reshape(half, half)
    return np.round(255.0 * np.concatenate(levels[::-1])).astype(np.uint8)


def shares_of(texels: np.ndarray) -> np.ndarray:
    """What ``tree`` has kept of the shares: (SIDE, SIDE)."""
    shares, first = np.ones((1, 1)), 0
    while len(shares) < SIDE:
        side = len(shares)
        fours = np.maximum(texels[first : first + side * side].astype(float), 1.0)
        fours /= fours.sum(axis=1, keepdims=True)
        parts = (shares.reshape(-1, 1) * fours).reshape(side, side, 2, 2)
        shares = parts.transpose(0, 2, 1, 3).reshape(2 * side, 2 * side)
        first += side * side
    return shares


def drawn(gpu: GpuContext, texels: np.ndarray, entry: int, rows: np.ndarray) -> np.ndarray:
    """(N, 3, 4): what the test shader says of rows (position, facing, u, v), for a grid of one brick."""
    guides = gpu.list_texture("guides", len(texels), 4, "f1", texels)
    numbers = gpu.texture_3d("numbers", (1, 1, 1), 1, "u4", np.array([entry], np.uint32))
    guides.use(interface.slot("TEX_GUIDES"))
    numbers.use(interface.slot("TEX_GUIDE_NUMBERS"))
    inputs = np.zeros((len(rows), 8), np.float32)
    inputs[:, :6] = rows
    found = map_list(gpu, test_kernel(gpu, "guide", {"LEVELS": 0}), inputs, 12, grid_size=(4, 4, 4)).reshape(-1, 3, 4)
    gpu.free(guides, numbers)
    return found


def grid_of_points(facing: int, side: int) -> np.ndarray:
    """(side^2, 6): the middle of the brick, and points of the unit square, row by row."""
    v, u = (np.mgrid[0:side, 0:side].reshape(2, -1) + 0.5) / side
    rows = np.full((side * side, 6), 1.5)
    rows[:, 3], rows[:, 4], rows[:, 5] = facing, u, v
    return rows


@pytest.mark.parametrize("facing", range(6))
def test_square_of_a_hemisphere(gpu: GpuContext, facing: int) -> None:
    """Each place has a direction above the facing, and goes back to itself; places spread evenly are spread by the
    cosine: the mean of the direction is 2/3 along the facing, that of its cosine squared 1/2."""
    found = drawn(gpu, tree(np.ones((SIDE, SIDE))), 1 << facing, grid_of_points(facing, 64))
    direction, there = found[:, 1, :3].astype(float), found[:, 2, :2]
    axis, sign = AXES[facing]
    cosine = sign * direction[:, axis]
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=1e-5)
    np.testing.assert_allclose(there, grid_of_points(facing, 64)[:, 4:], atol=1e-4)
    assert cosine.min() > 0.0
    expected = np.zeros(3)
    expected[axis] = sign * 2.0 / 3.0
    np.testing.assert_allclose(direction.mean(axis=0), expected, atol=2e-3)
    assert np.mean(cosine**2) == pytest.approx(0.5, abs=2e-3)


def test_directions_are_drawn_as_densely_as_said(gpu: GpuContext) -> None:
    """Where the guide's shares put them, and the density is theirs: mean cosine / density over what is drawn is that
    integral over the hemisphere."""
    rng = np.random.default_rng(3)
    texels = tree(rng.random((SIDE, SIDE)) ** 4 + 0.01)
    side = 128
    found = drawn(gpu, texels, 1 << 4, grid_of_points(4, side))  # faces up: directions are the frame's own
    shares = shares_of(texels)
    placed = drawn(gpu, texels, 1 << 4, grid_of_points(4, SIDE))[:, 2, 2].reshape(SIDE, SIDE)
    cosine = drawn(gpu, texels, 1 << 4, grid_of_points(4, SIDE))[:, 1, 2].reshape(SIDE, SIDE)
    np.testing.assert_allclose(placed, shares * SIDE**2 * cosine / np.pi, rtol=1e-4)

    direction, density = found[:, 0, :3].astype(float), found[:, 0, 3].astype(float)
    np.testing.assert_allclose(np.mean(direction[:, 2] / density), np.pi, rtol=2e-2)
    assert (found[:, 2, 3] == 0.0).all()  # nothing is drawn below
    # The pattern of what is drawn follows the shares: so many of the points lie in each bin.
    disk = direction[:, :2]
    radius, angle = np.hypot(*disk.T), np.arctan2(disk[:, 1], disk[:, 0])
    turn = angle / (np.pi / 4.0)
    turn = np.where(turn < -1.0, turn + 8.0, turn)
    quarter = np.select([turn < 1.0, turn < 3.0, turn < 5.0], [0, 1, 2], 3)
    x = np.choose(quarter, [np.ones_like(turn), 2.0 - turn, -np.ones_like(turn), turn - 6.0]) * radius
    y = np.choose(quarter, [turn, np.ones_like(turn), 4.0 - turn, -np.ones_like(turn)]) * radius
    bins = np.clip(((0.5 + 0.5 * np.stack([x, y])) * SIDE).astype(int), 0, SIDE - 1)
    counts = np.bincount(bins[0] + SIDE * bins[1], minlength=SIDE * SIDE).reshape(SIDE, SIDE)
    np.testing.assert_allclose(counts / side**2, shares, atol=3e-3)  # the points are 1 / 128 apart


def test_bricks_have_guides_for_their_facings(gpu: GpuContext) -> None:
    """The second of three guides is that of the second facing, and other facings have none."""
    shares = np.ones((3, SIDE, SIDE))
    shares[1, :, : SIDE // 2] = 0.0  # all to one side
    texels = np.concatenate([tree(each) for each in shares])
    has = 1 << 1 | 1 << 2 | 1 << 5
    for facing in range(6):
        found = drawn(gpu, texels, 0 << 6 | has, grid_of_points(facing, 16))
        assert (found[:, 1, 3] == float(has >> facing & 1)).all()
        if facing == 2:  # +y: x of the square is z
            assert np.mean(found[:, 0, 2] > 0.0) > 0.95
        elif has >> facing & 1:
            assert np.mean(found[:, 0, 2 if facing == 1 else 0] > 0.0) == pytest.approx(0.5, abs=0.02)


def test_empty_guides_are_none(gpu: GpuContext) -> None:
    texels = np.concatenate([tree(np.ones((SIDE, SIDE))), np.zeros_like(tree(np.ones((SIDE, SIDE))))])
    has = 1 << 0 | 1 << 3
    assert (drawn(gpu, texels, has, grid_of_points(0, 4))[:, 1, 3] == 1.0).all()
    assert (drawn(gpu, texels, has, grid_of_points(3, 4))[:, 1, 3] == 0.0).all()


# In a picture ---------------------------------------------------------------------------------------------------


def two_rooms(lamp: str) -> SceneData:
    """The camera looks into a room that gets its light through a hole from another, where the lamp is."""
    white = scenes.diffuse(0.7)
    slab = scenes.box((-0.02, -1.0, -1.0), (0.02, 0.7, 1.0))
    glow = (scenes.box((0.9, -0.6, 0.4), (1.1, -0.4, 0.6)), scenes.emission(50.0))
    return scenes.scene(
        (scenes.box((-2.0, -1.0, -1.0), (2.0, 1.0, 1.0), inside_out=True), white), (slab, white),
        *([glow] if lamp == "emitter" else []),
        lights=[scenes.light(LightKind.POINT, 10.0, (1.0, -0.5, 0.5))] if lamp == "light" else [],
        camera=scenes.camera((-0.3, -0.8, 0.0), (-2.0, 0.8, -0.3), angle=1.2),
    )  # fmt: skip


def indirect(
    gpu: GpuContext, monkeypatch: pytest.MonkeyPatch, scene: SceneData, samples: int, *, guided: bool
) -> np.ndarray:
    """(H, W, 3) of diffuse indirect light, in single passes that share nothing."""
    choose: Callable[..., Features] = Features.from_scene

    class Chosen:
        @staticmethod
        def from_scene(*arguments: object, **more: object) -> Features:
            features = choose(*arguments, **more)
            assert features.has_guides
            return features if guided else dataclasses.replace(features, has_guides=False)

    settings = scenes.settings(32, samples=samples, rays=2, use_reconstruction=False)
    with monkeypatch.context() as patch:
        patch.setattr(voxel_light, "Features", Chosen)
        with pipeline(gpu, scene, settings, (24, 18), outputs=("diffuse_indirect",)) as made:
            return made.film.read("diffuse_indirect")[..., :3].astype(np.float64)


@pytest.mark.parametrize("lamp", ["light", "emitter"])
def test_guides_change_noise_and_nothing_else(lamp: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same light in the end, with half of the squared error on the way."""
    scene = two_rooms(lamp)
    right = indirect(gpu, monkeypatch, scene, 768, guided=False)
    guided = indirect(gpu, monkeypatch, scene, 256, guided=True)
    assert guided.mean() == pytest.approx(right.mean(), rel=0.01)

    def error(picture: np.ndarray) -> float:
        return float(np.mean((picture - right) ** 2))

    few = [indirect(gpu, monkeypatch, scene, 8, guided=on) for on in (False, True)]
    assert error(few[1]) < 0.5 * error(few[0])


def test_even_light_needs_no_guide(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Under an even sky rays stay where they are, to the bit."""
    scene = scenes.scene((scenes.plane(2.0), scenes.diffuse(0.5)), world=scenes.world(1.0))
    pictures = [indirect(gpu, monkeypatch, scene, 4, guided=guided) for guided in (False, True)]
    np.testing.assert_array_equal(pictures[0], pictures[1])
