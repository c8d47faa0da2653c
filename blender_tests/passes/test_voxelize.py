# SPDX-License-Identifier: GPL-3.0-or-later
"""Voxelization of random triangles against float64: no area lost, no cell missed, none invented, no order seen."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from addon.gpu import interface
from addon.gpu.context import GpuContext
from addon.grid import VoxelGrid
from addon.passes.voxelize import VoxelizePass
from addon.scene import RayVisibility
from blender_tests.passes import reference, scenes
from blender_tests.passes.run import VoxelData, unit_grid, voxelized

SIZE = 24
KINDS = ("ordinary", "tiny", "huge", "sliver", "on planes", "level", "long sliver")


def triangles_in_grid(kind: str, count: int = 60) -> np.ndarray:
    """(N, 3, 3) float32 inside a grid of SIZE cells."""
    rng = np.random.default_rng(11)
    centre = rng.uniform(4.0, SIZE - 4.0, (count, 1, 3))
    size = {
        "ordinary": 3.0,
        "tiny": 0.03,
        "huge": 30.0,
        "sliver": 3.0,
        "on planes": 3.0,
        "level": 3.0,
        "long sliver": 8.0,
    }
    made = centre + rng.normal(size=(count, 3, 3)) * size[kind]
    if kind in ("sliver", "long sliver"):
        across = rng.normal(size=(count, 3)) * (1e-2 if kind == "sliver" else 1e-3)
        made[:, 2] = made[:, 0] + (made[:, 1] - made[:, 0]) * rng.random((count, 1)) + across
    if kind == "on planes":
        made = np.round(made)
    if kind == "level":
        for k in range(count):
            made[k, :, k % 3] = round(centre[k, 0, k % 3])
    made = np.clip(made, 0.01, SIZE - 0.01) if kind not in ("on planes", "level") else np.clip(made, 0, SIZE - 1)
    area = np.linalg.norm(np.cross(made[:, 1] - made[:, 0], made[:, 2] - made[:, 0]), axis=1)
    return made[area > 1e-6].astype(np.float32)


def both_sides(triangles: np.ndarray) -> np.ndarray:
    """Each triangle and its back, so that every facing has surfaces of its own."""
    return np.concatenate([triangles, triangles[:, ::-1]])


def part_area(triangle: np.ndarray, cell: np.ndarray) -> float:
    """Largest projected area of the part of a triangle inside a cell."""
    part = reference.clip_to_cube(triangle.astype(np.float64) - cell)
    return max(abs(reference.projected_moments(np.roll(part, k, axis=1))[0]) for k in range(3))


def area_vectors(triangles: np.ndarray) -> np.ndarray:
    t = triangles.astype(np.float64)
    return 0.5 * np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])


@pytest.mark.parametrize("kind", KINDS)
def test_faces_hold_the_area(kind: str, gpu: GpuContext) -> None:
    """Sum of the weights of a facing = area of the triangles whose normal is nearest to it, in sides of cells."""
    triangles = triangles_in_grid(kind)
    with voxelized(gpu, scenes.scene((scenes.soup(both_sides(triangles)), scenes.diffuse())), unit_grid(SIZE)) as found:
        vectors = area_vectors(triangles)
        x, y, z = np.abs(area_vectors(triangles).astype(np.float32)).T
        nearest = np.where(x > y, np.where(x > z, 0, 2), np.where(y > z, 1, 2))  # dominant_axis(), ties included
        areas = np.linalg.norm(vectors, axis=1)
        expected = [areas[nearest == axis].sum() for axis in range(3)]
        for facing in range(6):
            total = found.faces["weight"][found.faces["facing"] == facing].sum(dtype=np.float64)
            rounding = 3.0 * np.sqrt(len(found.triangles)) / interface.FIXED_ONE  # each part by half a unit, at random
            assert total == pytest.approx(expected[facing // 2], rel=1e-3, abs=rounding)


@pytest.mark.parametrize("kind", KINDS)
def test_no_cell_is_missed_and_none_invented(kind: str, gpu: GpuContext) -> None:
    triangles = triangles_in_grid(kind)
    with voxelized(gpu, scenes.scene((scenes.soup(triangles), scenes.diffuse())), unit_grid(SIZE)) as found:
        points = reference.sample_triangles(triangles, 3000, np.random.default_rng(5))
        number = np.broadcast_to(np.arange(len(triangles))[:, None], points.shape[:2])
        cells = np.floor(points).astype(np.int64)
        # On a plane between two cells rounding decides which of them a point belongs to.
        clear = (np.abs(points - np.round(points)) > 2e-5 * SIZE).all(axis=2)
        hit = np.unique(np.concatenate([cells[clear], number[clear][:, None]], axis=1), axis=0)
        listed = {tuple(row) for row in found.pairs}
        # Parts as small as the rounding of an area near 1 may be lost: no ray finds them.
        missed = [
            tuple(row) for row in hit if tuple(row) not in listed and part_area(triangles[row[3]], row[:3]) > 3e-7
        ]
        assert not missed, f"{len(missed)} of {len(hit)} pairs are missing: {missed[:5]}"
        if kind not in ("on planes", "level"):
            assert len(hit) > 0.5 * len(listed)

        pairs = found.pairs
        touching = reference.overlaps(triangles[pairs[:, 3]], pairs[:, :3].astype(np.float64), 1e-3)
        assert touching.all(), f"{(~touching).sum()} of {len(pairs)} pairs do not touch: {pairs[~touching][:5]}"
        assert len(listed) == len(pairs), "a cell lists a triangle twice"


def same_faces(a: VoxelData, b: VoxelData) -> bool:
    return (
        a.faces.tobytes() == b.faces.tobytes() and np.array_equal(a.masks, b.masks) and np.array_equal(a.pairs, b.pairs)
    )


def test_two_runs_give_the_same_bits(gpu: GpuContext) -> None:
    made = scenes.scene((scenes.soup(triangles_in_grid("ordinary")), scenes.glowing(0.4, 3.0)))
    with voxelized(gpu, made, unit_grid(SIZE)) as first, voxelized(gpu, made, unit_grid(SIZE)) as second:
        assert same_faces(first, second)


@pytest.mark.parametrize("shape", ["soup", "sphere", "box"])
def test_order_of_work_does_not_show(shape: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same work items in another order: the order of threads on another driver. In the middle of cells the
    triangles of sphere and box meet at one point, and are equally near."""
    shapes = {
        "soup": scenes.soup(triangles_in_grid("ordinary", 200)),
        "sphere": scenes.sphere(4.5, 12),
        "box": scenes.box((-4.5, -4.5, -4.5), (4.5, 4.5, 4.5)),
    }
    place = np.eye(4) if shape == "soup" else scenes.at(12.5, 12.5, 12.5)
    made = scenes.scene((shapes[shape], scenes.glowing((0.4, 0.5, 0.6), 3.3), place))
    with voxelized(gpu, made, unit_grid(SIZE)) as first:
        original = VoxelizePass._work

        def shuffled(self: VoxelizePass, *arguments: Any) -> Any:
            starts, estimate, work = original(self, *arguments)
            assert len(starts) == 2  # one batch
            items = np.frombuffer(work.read(), np.uint32).reshape(-1, 2).copy()
            np.random.default_rng(1).shuffle(items[: starts[-1]])
            work.write(items.tobytes())
            return starts, estimate, work

        monkeypatch.setattr(VoxelizePass, "_work", shuffled)
        with voxelized(gpu, made, unit_grid(SIZE)) as second:
            assert not np.array_equal(first.triangles, second.triangles)  # it was another order indeed
            assert same_faces(first, second)


@pytest.mark.parametrize("kind", KINDS)
def test_a_low_estimate_of_pairs_does_not_show(kind: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """The estimate suffices for triangles here and there; where it does not, pairs are listed again."""
    made = scenes.scene((scenes.soup(triangles_in_grid(kind, 200)), scenes.diffuse(0.4)))
    original_work, original_list = VoxelizePass._work, VoxelizePass._list_pairs
    capacities = []

    def low(self: VoxelizePass, *arguments: Any) -> Any:
        starts, _, work = original_work(self, *arguments)
        return starts, 7, work

    def listed(self: VoxelizePass, *arguments: Any) -> Any:
        capacities.append(arguments[-1])
        return original_list(self, *arguments)

    monkeypatch.setattr(VoxelizePass, "_list_pairs", listed)
    with voxelized(gpu, made, unit_grid(SIZE)) as first:
        count = first.voxels.pair_count
        assert len(capacities) == 1 and count <= capacities[0] < 2 * count
        monkeypatch.setattr(VoxelizePass, "_work", low)
        with voxelized(gpu, made, unit_grid(SIZE)) as second:
            assert capacities[1:] == [7, count]
            assert same_faces(first, second)


def test_materials_keep_to_their_surfaces(gpu: GpuContext) -> None:
    """Pairs are listed batch by batch: surfaces of several programs, and each face has its own material."""
    surfaces = (scenes.diffuse((0.8, 0.1, 0.1)), scenes.glowing(0.5, 3.0), scenes.emission((2.0, 1.0, 0.0)))
    floors = [(scenes.plane(20.0, height), surface) for height, surface in zip((2.5, 9.5, 17.5), surfaces, strict=True)]
    with voxelized(gpu, scenes.scene(*floors), unit_grid(SIZE)) as found:
        for layer, color in ((2, (0.8, 0.1, 0.1)), (9, 0.5), (17, 0.0)):
            faces = found.faces[(found.face_cells[:, 2] == layer) & (found.faces["weight"] > 0.9)]
            assert len(faces) > 2 * 15**2 / 4
            np.testing.assert_allclose(faces["reflectance"], np.broadcast_to(color, (len(faces), 3)), atol=1e-3)


def test_order_of_triangles_hardly_shows(gpu: GpuContext) -> None:
    """Triangles in another order: the same cells and lists. Sums differ by their unit (1/65536) at most for each
    triangle, as its number decides which way they are rounded; hardly a cell is cut elsewhere for that."""
    triangles = triangles_in_grid("ordinary")
    order = np.random.default_rng(2).permutation(len(triangles))
    surface = scenes.diffuse()
    with (
        voxelized(gpu, scenes.scene((scenes.soup(triangles), surface)), unit_grid(SIZE)) as first,
        voxelized(gpu, scenes.scene((scenes.soup(triangles[order]), surface)), unit_grid(SIZE)) as second,
    ):
        assert np.array_equal(first.masks, second.masks)
        renamed = second.pairs
        renamed[:, 3] = order[renamed[:, 3]]
        assert np.array_equal(first.pairs, renamed[np.lexsort(renamed.T[::-1])])
        # Which triangle of its list cuts a cell aslant is another number in another order.
        words = [found.records[:, 3] for found in (first, second)]
        words = [np.where(word & interface.CUT_IS_ASLANT, word & ~0x1FFC000, word) for word in words]
        same = words[0] == words[1]
        assert same.mean() > 0.98
        faces = [found.faces[same[found.faces["cell"]]] for found in (first, second)]
        weights = faces[0]["weight"], faces[1]["weight"]
        unit = (first.records[faces[0]["cell"], 1] + 0.5) / interface.FIXED_ONE
        unit += 2 * np.sqrt(weights[0] * interface.MAX_FACE_WEIGHT) / 65535  # a step of the stored root
        # A side with next to nothing on it may have been rounded to nothing, and then is the back of the other side.
        alike = np.minimum(*weights) > 3 * unit
        assert alike.mean() > 0.9
        assert (np.abs(weights[0] - weights[1]) <= unit)[alike].all()


def test_a_grid_smaller_than_the_scene_cuts_it(gpu: GpuContext) -> None:
    """Whatever sticks out is left out; what is inside keeps its area."""
    with voxelized(gpu, scenes.scene((scenes.plane(100.0, 3.25), scenes.diffuse())), unit_grid(8)) as found:
        assert {tuple(cell) for cell in found.cells} == {(x, y, 3) for x in range(8) for y in range(8)}
        up = found.faces[found.faces["facing"] == 4]
        np.testing.assert_allclose(up["weight"], 1.0, atol=1e-4)


def test_a_plane_has_two_sides(gpu: GpuContext) -> None:
    """A sheet that faces +z: both its faces have its albedo and place, and opposite normals."""
    grid = VoxelGrid((-2.0, -2.0, -2.0), 0.5, (8, 8, 8))
    with voxelized(gpu, scenes.scene((scenes.plane(2.0, 0.2), scenes.diffuse((0.2, 0.5, 0.8)))), grid) as found:
        assert sorted(set(found.faces["facing"])) == [4, 5]
        for facing, sign in ((4, 1.0), (5, -1.0)):
            faces = found.faces[found.faces["facing"] == facing]
            assert faces["weight"].sum() == pytest.approx(4.0 / 0.25, rel=1e-4)
            np.testing.assert_allclose(
                faces["reflectance"], np.broadcast_to([0.2, 0.5, 0.8], (len(faces), 3)), atol=1e-3
            )
            np.testing.assert_allclose(faces["position"][:, 2], 2.2 / 0.5, atol=1e-4)
            np.testing.assert_allclose(faces["normal"], np.broadcast_to([0, 0, sign], (len(faces), 3)), atol=1e-6)


def test_two_sheets_in_one_cell_keep_their_colours(gpu: GpuContext) -> None:
    """A thin wall: what faces up is white, what faces down is black."""
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    white, black = scenes.diffuse(0.9), scenes.diffuse(0.1)
    wall = scenes.plane(3.0)
    with voxelized(
        gpu, scenes.scene((wall, white, scenes.at(4, 4, 3.6)), (wall, black, scenes.at(4, 4, 3.4) @ down)), unit_grid(8)
    ) as found:
        for facing, albedo, height in ((4, 0.9, 3.6), (5, 0.1, 3.4)):
            faces = found.faces[found.faces["facing"] == facing]
            np.testing.assert_allclose(faces["reflectance"], albedo, atol=1e-3)
            np.testing.assert_allclose(faces["position"][:, 2], height, atol=1e-3)


def test_slivers_are_not_black(gpu: GpuContext) -> None:
    """Too little area to count, each alone in its cell: on average they have the colour of their material."""
    place = np.stack(np.meshgrid(*[np.arange(1, 15)] * 2, [1, 4, 7, 10, 13]), axis=-1).reshape(-1, 3) + 0.5
    corners = np.array([[0.0, 0.0, 0.0], [2e-3, 0.0, 0.0], [0.0, 2e-3, 0.0]])  # 2e-6 of the side of a cell
    made = scenes.scene((scenes.soup(place[:, None] + corners), scenes.diffuse((0.8, 0.5, 0.2))))
    with voxelized(gpu, made, unit_grid(16)) as found:
        up = found.faces["facing"] == 4
        assert up.sum() == len(place)
        np.testing.assert_allclose(found.faces["reflectance"][up].mean(axis=0), [0.8, 0.5, 0.2], atol=0.07)


def test_cells_that_are_not_cut_are_made_as_others_are(monkeypatch: pytest.MonkeyPatch, gpu: GpuContext) -> None:
    """The program that makes most faces, and the one for cells that are cut or list many triangles: the same bits."""
    shapes = [scenes.soup([[[1, 1, 1], [1, 23, 1], [23, 23, 23]]]),  # through edges of the grid
              scenes.soup([[[1.3, 0.2, 1.0], [23.0, 0.5, 5.0], [0.5, 9.0, 22.0]]]),
              scenes.sphere(9.0), scenes.soup(np.random.default_rng(1).uniform(1.0, 23.0, (60, 3, 3)))]  # fmt: skip
    for shape in shapes:
        place = scenes.at(12.1, 11.9, 12.2) if shape.name == "sphere" else np.eye(4)
        made = scenes.scene((shape, scenes.diffuse((0.8, 0.5, 0.2)), place))
        found = []
        for bits in (interface.CUT_BITS, 0xFFFFFFFF):  # with these no cell is plain
            monkeypatch.setattr(interface, "CUT_BITS", bits)
            with voxelized(gpu, made, unit_grid(24)) as data:
                faces = data.voxels.faces
                textures = [faces.place, faces.reflectance, *([faces.shading] if faces.shading else [])]
                found.append([texture.read() for texture in textures])
        assert found[0] == found[1]


def test_walls_between_two_axes_have_their_colour(gpu: GpuContext) -> None:
    """At 45 degrees to the grid rounding decides which axis a triangle faces: once, for all that is made of it."""
    rng = np.random.default_rng(1)
    place = np.stack(np.meshgrid(*[np.arange(1, 31)] * 3), axis=-1).reshape(-1, 1, 3)
    along = rng.uniform(-0.3, 0.3, (len(place), 3, 2))
    corners = place + rng.uniform(0.4, 0.6, place.shape) + along[..., [0, 0, 1]]
    albedo = [0.8, 0.5, 0.2]
    with voxelized(gpu, scenes.scene((scenes.soup(corners), scenes.diffuse(albedo))), unit_grid(32)) as found:
        faces = found.faces[found.faces["weight"] > 4e-3]  # of less, sums are rounded by more
        assert len(faces) > 20000
        np.testing.assert_allclose(faces["reflectance"], np.broadcast_to(albedo, (len(faces), 3)), atol=0.02)
        normals = np.broadcast_to([np.sqrt(0.5), np.sqrt(0.5), 0.0], (len(faces), 3))
        np.testing.assert_allclose(np.abs(faces["normal"]), normals, atol=0.02)


def test_instances_are_transformed(gpu: GpuContext) -> None:
    """Scaled, mirrored and far-away placements of one mesh: area by the scale, facings by the mirror."""
    shape = scenes.plane(2.0)
    mirrored = scenes.at(4.0, 4.0, 6.1, (1.0, 1.0, -1.0))
    made = scenes.scene(
        (shape, scenes.diffuse(0.9), scenes.at(4.0, 4.0, 2.1, 1.5)), (shape, scenes.diffuse(0.2), mirrored)
    )
    with voxelized(gpu, made, unit_grid(8)) as found:
        z = found.face_cells[:, 2]
        assert found.faces["weight"][(z == 2) & (found.faces["facing"] == 4)].sum() == pytest.approx(9.0, rel=1e-4)
        assert found.faces["weight"][(z == 6) & (found.faces["facing"] == 4)].sum() == pytest.approx(4.0, rel=1e-4)
        np.testing.assert_allclose(found.faces["reflectance"][z == 2], 0.9, atol=1e-3)
        np.testing.assert_allclose(found.faces["reflectance"][z == 6], 0.2, atol=1e-3)


def test_far_from_the_origin_nothing_is_lost(gpu: GpuContext) -> None:
    """Ten thousand kilometres away: the grid's origin is subtracted in float64."""
    far = np.array([1.0e7, -3.0e6, 2.0e6])
    shape = scenes.soup(triangles_in_grid("ordinary"))
    grid = dataclasses.replace(unit_grid(SIZE), origin=tuple(far))
    surface = scenes.diffuse()
    with (
        voxelized(gpu, scenes.scene((shape, surface)), unit_grid(SIZE)) as near,
        voxelized(gpu, scenes.scene((shape, surface, scenes.at(*far))), grid) as moved,
    ):
        assert np.array_equal(near.masks, moved.masks)
        np.testing.assert_allclose(near.faces["weight"], moved.faces["weight"], atol=1e-4)


def test_objects_that_no_ray_sees_are_left_out(gpu: GpuContext) -> None:
    made = scenes.scene(
        (scenes.plane(4.0, 2.5), scenes.diffuse()),
        (scenes.plane(4.0, 5.5), scenes.diffuse(), np.eye(4), RayVisibility(0)),
    )
    with voxelized(gpu, made, unit_grid(8)) as found:
        assert set(found.cells[:, 2]) == {2}


def test_odd_meshes_leave_no_trace(gpu: GpuContext) -> None:
    """Triangles without area, with NaN or infinite corners: nothing is hit, nothing is occupied."""
    bad = np.array([
        [[1, 1, 1], [1, 1, 1], [1, 1, 1]], [[1, 1, 1], [3, 3, 3], [5, 5, 5]],
        [[np.nan, 1, 1], [2, 2, 1], [3, 1, 1]], [[1, 1, 1], [np.inf, 2, 1], [3, 1, 1]],
        [[1e38, 1, 1], [-1e38, 2, 1], [3, 1e38, 1]],
    ], np.float32)  # fmt: skip
    with np.errstate(all="ignore"):
        shape = scenes.soup(bad[:4])
    with voxelized(gpu, scenes.scene((shape, scenes.diffuse())), unit_grid(8)) as found:
        assert len(found.cells) == 0 and found.voxels.faces.count == 0
