# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes over long lists of triangles: rays meet what they meet without, and crowded cells have the sums of others."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from addon import sharing
from addon.gpu import interface
from addon.gpu.context import GpuContext
from addon.passes import long_lists
from addon.passes.long_lists import are_boxed, box_levels, box_room, curve_order, ranges
from addon.scene import LightKind, RayVisibility, SceneData
from addon.settings import Settings
from blender_tests.material_shader import material, node
from blender_tests.passes import reference, scenes
from blender_tests.passes.run import VoxelData, map_list, pipeline, prepare, sample, test_kernel, unit_grid, voxelized
from blender_tests.passes.test_edits import GRIDS, SETTINGS, assert_same, bits, placed
from blender_tests.passes.test_trace import unit

SIZE = 8
#: Triangles that one thread can ask one after the other.
BRUTE = 60000


@contextlib.contextmanager
def other_kernels(gpu: GpuContext) -> Iterator[None]:
    """Programs are compiled anew, with what interface.py says now."""
    usual, gpu._kernels = gpu._kernels, {}
    interface.prelude.cache_clear()
    try:
        yield
    finally:
        interface.prelude.cache_clear()
        for kernel in gpu._kernels.values():
            kernel.shader.release()
        gpu._kernels = usual


def confetti(count: int, rng: np.random.Generator, *, low: float = 0.05, high: float = 0.95) -> np.ndarray:
    """(count, 3, 3) corners of triangles about the size that lets a fifth of all rays through, in a cube."""
    centres = rng.uniform(low, high, (count, 1, 3))
    side = 1.2 * (high - low) / np.sqrt(count)
    return np.clip(centres + rng.normal(size=(count, 3, 3)) * side, low, high)


def crossing_rays(count: int, rng: np.random.Generator, target: np.ndarray, farthest: float = 2000.0) -> np.ndarray:
    """(count, 8) rays as shaders/tests/trace.comp.glsl wants them, most of which cross the cell at ``target``."""
    aims = target + rng.uniform(0.0, 1.0, (count, 3))
    is_far = np.arange(count) % 5 == 0
    distances = np.where(is_far, rng.uniform(0.5 * farthest, farthest, count), rng.uniform(0.1, 6.0, count))
    directions = unit(rng.normal(size=(count, 3)))
    along = np.arange(count) % 4 == 1
    directions[along] = (np.eye(3)[rng.integers(0, 3, count)] * rng.choice([-1.0, 1.0], (count, 1)))[along]
    rays = np.zeros((count, 8), np.float32)
    rays[:, :3], rays[:, 3], rays[:, 4:7] = aims - directions * distances[:, None], 1e30, directions
    return rays


def shot(gpu: GpuContext, found: VoxelData, rays: np.ndarray, *, boxes: bool, **ray: float) -> np.ndarray:
    """(R, 12) bits of what the test shader says of each ray."""
    rays = rays.copy()
    rays[:, 3] = ray.get("limit", rays[:, 3])
    rays[:, 7] = ray.get("any_hit", 0.0)
    kernel = test_kernel(gpu, "trace", found.voxels.trace_defines | {"HAS_BOXES": boxes})
    found.voxels.bind(kernel)
    return map_list(gpu, kernel, rays, 12, ray_mask=int(RayVisibility.ALL)).view(np.uint32)


@pytest.fixture
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    """Boxes wherever a list is long."""
    monkeypatch.setattr(long_lists, "LEAST_SHARE", 0.0)


# Numbers --------------------------------------------------------------------------------------------------------


def test_there_is_room_for_all_boxes() -> None:
    """Wherever a list begins, its boxes end where those of the next one may begin."""
    for count in [*range(interface.LONG_LIST + 1, 3000), 65536, 99_999, 1_000_000]:
        boxes = sum(box_levels(count))
        assert all(box_room(first + count) - box_room(first) >= boxes for first in range(16)), count


def test_boxes_are_where_long_lists_have_most_entries() -> None:
    few, many = np.full(100, 5), np.full(10, 100)
    assert not are_boxed(np.zeros(0, np.uint32)) and not are_boxed(few)
    assert are_boxed(np.concatenate([few, many])) and not are_boxed(np.concatenate([few, many[:2]]))
    assert are_boxed(np.append(np.full(10**6, 30), long_lists.LONGEST + 1))


def test_entries_are_ordered_cell_by_cell() -> None:
    rng = np.random.default_rng(2)
    counts = np.array([40, 1, 300, 77])
    cells, keys = np.repeat([3, 8, 9, 70], counts), rng.integers(0, 1 << 30, counts.sum()).astype(np.uint32)
    keys[50:90] = keys[50]
    np.testing.assert_array_equal(curve_order(keys, cells), np.lexsort((keys, cells)))
    np.testing.assert_array_equal(ranges(np.array([7, 2]), np.array([3, 2])), [7, 8, 9, 2, 3])


# Rays -----------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("kind", ["own", "shared", "alpha"])
@pytest.mark.parametrize("count", [1, interface.LONG_LIST + 1, 1000, 20_000])
def test_rays_meet_what_they_meet_without(
    count: int, kind: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit for bit: the nearest, any, and with a limit; from far away, along axes, from inside."""
    rng = np.random.default_rng(count)
    monkeypatch.setattr(sharing, "LEAST_SAVED", 0 if kind == "shared" else 1 << 60)
    surface = scenes.principled(0.8, Alpha=0.4) if kind == "alpha" else scenes.diffuse()
    shape = scenes.soup(confetti(count, rng))
    turned = np.diag([1.0, -1.0, 1.0, 1.0])
    turned[:3, 3] = (3.0, 6.0, 5.0)  # cell (3, 5, 5)
    # The second reaches into cells around (1, 2, 3).
    made = scenes.scene((shape, surface, turned), (shape, surface, scenes.at(0.6, 1.7, 2.9)))
    with voxelized(gpu, made, unit_grid(SIZE)) as found:
        assert found.geometry.has_instances == (kind == "shared")
        assert found.voxels.has_boxes == (count > interface.LONG_LIST)
        assert (found.records[:, 1] == count).any()
        rays = np.concatenate([crossing_rays(2000, rng, np.array(cell)) for cell in ((3, 5, 5), (1, 2, 3))])
        if not found.voxels.has_boxes:
            return  # that programs without boxes are right is for test_trace.py
        for options in ({}, {"limit": 3.0}):
            with_boxes = shot(gpu, found, rays, boxes=True, **options)
            np.testing.assert_array_equal(with_boxes, shot(gpu, found, rays, boxes=False, **options))
            is_met = shot(gpu, found, rays, boxes=True, any_hit=1.0, **options)[:, 1] != 0
            np.testing.assert_array_equal(is_met, with_boxes[:, 1] != 0)
            assert 0.03 < (with_boxes[:, 1] != 0).mean() < 0.95


def test_a_hundred_thousand_triangles_in_a_cell(gpu: GpuContext) -> None:
    """More than one thread can ask: against every one of them in float64."""
    rng = np.random.default_rng(4)
    corners = confetti(100_000, rng).astype(np.float32) + np.float32((2, 5, 4))
    rays = crossing_rays(300, rng, np.array((2, 5, 4)), 10.0)
    nearest = np.full(len(rays), np.inf)
    doubtful = np.zeros(len(rays), bool)
    for part in np.array_split(corners.astype(np.float64), 25):
        distances, margins = reference.trace(part, rays[:, :3].astype(np.float64), rays[:, 4:7].astype(np.float64))
        nearest = np.minimum(nearest, distances.min(axis=1))
        doubtful |= (np.abs(margins) < 5e-3).any(axis=1)
    with voxelized(gpu, scenes.scene((scenes.soup(corners), scenes.diffuse())), unit_grid(SIZE)) as found:
        assert found.voxels.has_boxes and found.records[:, 1].max() > BRUTE
        distance = shot(gpu, found, rays, boxes=True)[:, 0].view(np.float32)
    met = np.isfinite(nearest)
    assert met.mean() > 0.5 and doubtful.mean() < 0.3
    assert (distance[~met & ~doubtful] == np.float32(1e30)).all()
    np.testing.assert_allclose(distance[met & ~doubtful], nearest[met & ~doubtful], atol=1e-4)


@pytest.mark.usefixtures("always")
def test_boxes_hold_their_triangles(gpu: GpuContext) -> None:
    """Read back: each run's box holds what of its triangles lies in the cell, each larger box the ones in it."""
    rng = np.random.default_rng(6)
    corners = confetti(700, rng, low=-0.3, high=1.2).astype(np.float32) + np.float32((2, 1, 5))
    with voxelized(gpu, scenes.scene((scenes.soup(corners), scenes.diffuse())), unit_grid(SIZE)) as found:
        texels = np.frombuffer(found.voxels.cells.read(), np.uint32).reshape(-1, 4)
    margin = 1.0 / 32.0
    runs = 0
    for cell, (first, count, _, _) in zip(found.cells, found.records, strict=True):
        if count <= interface.LONG_LIST:
            continue
        start = len(found.records) + box_room(first)
        boxes = texels[start : start + sum(box_levels(count))].astype(np.int64)
        low, high = (boxes[:, :3] & 0xFFFF), boxes[:, :3] >> 16
        for place, word in enumerate(boxes[:, 3].tolist()):
            if word < 1 << 31:  # it holds those after it
                held = slice(place + 1, place + word)
                assert (low[held] >= low[place]).all() and (high[held] <= high[place]).all()
                continue
            run = word & 0x7FFFFFFF
            members = corners[found.triangles[first + 8 * run : min(first + 8 * run + 8, first + count)]] - cell
            scale = 65535 / (1 + 2 * margin)
            inside = np.clip(members, -margin, 1 + margin)
            assert (inside.min(axis=(0, 1)) + margin >= low[place] / scale - 1e-6).all()
            assert (inside.max(axis=(0, 1)) + margin <= high[place] / scale + 1e-6).all()
            runs += 1
        assert boxes[0, 3] == len(boxes)
    assert runs > 80


# Voxels and pictures --------------------------------------------------------------------------------------------


def messy_room(pebble_triangles: int = interface.CROWD + 1) -> SceneData:
    """A room with a dense ball, some leaves, and a pebble inside one cell."""
    rng = np.random.default_rng(8)
    pebble = confetti(pebble_triangles, rng, low=-0.04, high=0.04)
    leaves = confetti(900, rng, low=-0.5, high=0.5)
    leaf = material(
        node("C", "TexCoord"), node("T", "TexChecker", Vector="C.Generated", Scale=9.0),
        node("P", "BsdfPrincipled", Base_Color=(0.1, 0.6, 0.1, 1.0), Alpha="T.Fac"), surface="P.BSDF",
    )  # fmt: skip
    return scenes.scene(
        (scenes.box((-2, -2, -1), (2, 2, 1), inside_out=True), scenes.diffuse((0.7, 0.6, 0.5))),
        (scenes.sphere(0.3, 40), scenes.principled((0.8, 0.3, 0.2), Roughness=0.4), scenes.at(0.9, 0.4, -0.4)),
        (scenes.soup(pebble), scenes.diffuse((0.2, 0.7, 0.3)), scenes.at(-0.590, -0.161, -0.805)),
        (scenes.soup(leaves), leaf, scenes.at(-1.1, 0.8, 0.1)),
        lights=[scenes.light(LightKind.POINT, 3.0, (0.9, -1.2, 0.7), radius=0.1)],
        camera=scenes.camera((0.5, -1.8, 0.2)),
    )


PICTURE = (24, 18)


def made_bits(gpu: GpuContext, made: SceneData, settings: Settings, *, has_boxes: bool) -> dict[str, bytes]:
    with pipeline(gpu, made, settings, PICTURE, samples=2) as ready:
        voxels = ready.voxel_light.voxelize.voxels
        assert voxels is not None and voxels.has_boxes == has_boxes
        return bits(ready)


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("grid", GRIDS)
def test_pictures_do_not_depend_on_boxes_nor_on_crowds(
    grid: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor do voxels, links and light: all bits are those of threads that ask and sum up everything themselves."""
    made = messy_room(400)
    crowds = {"none": 1 << 30, "all long ones": interface.LONG_LIST}
    monkeypatch.setattr(interface, "ASLANT_LIST", interface.LONG_LIST)  # crowded cells are cut along axes
    found = {}
    for name, crowd in crowds.items():
        monkeypatch.setattr(interface, "CROWD", crowd)
        with other_kernels(gpu):
            found[name] = made_bits(gpu, made, GRIDS[grid], has_boxes=True)
    monkeypatch.setattr(interface, "CROWD", 1 << 30)
    monkeypatch.setattr(long_lists, "LEAST_SHARE", 1.0)
    monkeypatch.setattr(long_lists, "LONGEST", 1 << 30)
    with other_kernels(gpu):
        wanted = made_bits(gpu, made, GRIDS[grid], has_boxes=False)
    assert_same(found["none"], wanted)
    assert_same(found["all long ones"], wanted)


@pytest.mark.usefixtures("always")
def test_lists_are_worked_on_in_steps(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of lists next to each other with short ones between them, or of one: the same order, the same boxes."""
    wanted = made_bits(gpu, messy_room(), SETTINGS, has_boxes=True)
    for entries in (200, 1):
        monkeypatch.setattr(long_lists, "ENTRIES_PER_STEP", entries)
        assert_same(made_bits(gpu, messy_room(), SETTINGS, has_boxes=True), wanted)


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("edit", ["leaves", "pebble", "pebble out of sight"])
def test_an_edit_leaves_the_bits_of_a_fresh_start(edit: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where only some lists are made again, and where boxes come or go with an edit."""
    made = messy_room()
    if edit == "pebble out of sight":  # then no list of the room is crowded
        monkeypatch.setattr(long_lists, "LEAST_SHARE", 1.0)
        monkeypatch.setattr(long_lists, "LONGEST", interface.CROWD)
        made = dataclasses.replace(made, instances=made.instances[:3])
    moved = placed(made, {
        "leaves": {3: scenes.at(-0.9, 0.7, 0.2)},
        "pebble": {2: scenes.at(0.376, -1.020, -0.483)},
        "pebble out of sight": {2: scenes.at(0.376, -1.020, -0.483, scale=9.0)},
    }[edit])  # fmt: skip
    with pipeline(gpu, made, SETTINGS, PICTURE, samples=1, is_live=True) as ready:
        for there, back in ((moved, False), (made, True)):
            prepare(ready, there, SETTINGS, PICTURE)
            sample(ready, 1)
            voxels = ready.voxel_light.voxelize.voxels
            assert voxels is not None and 0 < ready.redone["cells"] < 0.7 * voxels.cell_count
            assert voxels.has_boxes == (edit != "pebble out of sight" or back)
            with pipeline(gpu, there, SETTINGS, PICTURE, samples=1) as fresh:
                assert_same(bits(ready), bits(fresh))


def test_scenes_without_long_lists_have_no_boxes(gpu: GpuContext) -> None:
    """No byte, no define: the list of cells holds records alone."""
    with voxelized(gpu, scenes.cornell(), unit_grid(SIZE)) as found:
        voxels = found.voxels
        assert not voxels.has_boxes and not voxels.trace_defines["HAS_BOXES"]
        assert voxels.cells.height == -(-voxels.cell_count // interface.LIST_WIDTH)
