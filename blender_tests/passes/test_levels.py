# SPDX-License-Identifier: GPL-3.0-or-later
"""Nested levels: rays across their borders against every triangle, and each triangle in the cells that it enters."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.grid import VoxelGrid
from addon.levels import nested
from addon.scene import LightKind, SceneData
from addon.settings import Settings
from blender_tests.passes import reference, scenes
from blender_tests.passes.run import VoxelData, pipeline, prepare, radiance, read_voxels, sample, voxelized
from blender_tests.passes.test_trace import assert_blocked, shoot, unit

#: Grid space, cells of the finest level: what is covered is lopsided, so that holes lie at borders too.
BOX = np.array([[-70.0, -60.0, -9.0], [50.0, 90.0, 40.0]])


def grid() -> VoxelGrid:
    """World space is grid space."""
    return nested(BOX, np.zeros(3), 32, 1.0)


def soup(kind: str, rng: np.random.Generator) -> np.ndarray:
    """(N, 3, 3) float32 in BOX: as many around the middle as far from it."""
    count = 160
    middle = rng.uniform(BOX[0] + 1.0, BOX[1] - 1.0, (count, 1, 3))
    middle *= rng.choice([1.0, 0.5, 0.25, 0.1], (count, 1, 1))
    size = 3.0 + 0.1 * np.abs(middle).max(axis=2, keepdims=True)
    made = middle + rng.normal(size=(count, 3, 3)) * (40.0 if kind == "huge" else size)
    made = np.clip(made, BOX[0] + 0.01, BOX[1] - 0.01)
    if kind == "on borders":  # of levels, where these are planes
        for k in range(count):
            made[k, :, k % 3] = (-16.0, 16.0, -32.0, 32.0, 0.0)[k // 3 % 5] if k % 3 < 2 else (-8.0, 16.0, 32.0)[k % 2]
    area = np.linalg.norm(np.cross(made[:, 1] - made[:, 0], made[:, 2] - made[:, 0]), axis=1)
    return made[area > 1e-3].astype(np.float32)


def rays_of(kind: str, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    origins = rng.uniform(BOX[0], BOX[1], (count, 3)) * rng.choice([1.0, 0.4, 0.1], (count, 1))
    directions = unit(rng.normal(size=(count, 3)))
    if kind == "along axes":
        directions = np.eye(3)[rng.integers(0, 3, count)] * rng.choice([-1.0, 1.0], (count, 1))
    if kind == "from borders":
        axis = rng.integers(0, 3, count)
        origins[np.arange(count), axis] = rng.choice([-32.0, -16.0, -8.0, 0.0, 16.0, 32.0], count)
    if kind == "along borders":
        axis = rng.integers(0, 3, count)
        origins[np.arange(count), axis] = rng.choice([-32.0, -16.0, -8.0, 16.0, 32.0], count)
        directions[np.arange(count), axis] = 0.0
        directions = unit(directions)
    if kind == "from outside":
        origins = unit(rng.normal(size=(count, 3))) * rng.uniform(150.0, 400.0, (count, 1))
        directions = unit(rng.uniform(BOX[0], BOX[1], (count, 3)) * 0.5 - origins)
    return origins.astype(np.float32).astype(np.float64), directions.astype(np.float32).astype(np.float64)


def place_in_stack(made: VoxelGrid, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of cells of the stack (N, 3): their lowest corners in grid space, and their sides (N, 1)."""
    layers = np.array([level.layer for level in made.levels])
    which = np.searchsorted(layers, cells[:, 2], side="right") - 1
    first = np.array([level.first for level in made.levels])[which]
    side = 2.0 ** which[:, None]
    return (cells - np.eye(3)[2] * layers[which, None] + first) * side, side


@pytest.mark.parametrize("rays", ["random", "along axes", "from borders", "along borders", "from outside"])
@pytest.mark.parametrize("kind", ["ordinary", "huge", "on borders"])
def test_hits_agree_with_every_triangle_tried(kind: str, rays: str, gpu: GpuContext) -> None:
    rng = np.random.default_rng(5)
    triangles = soup(kind, rng)
    origins, directions = rays_of(rays, 3000, rng)
    distances, margins = reference.trace(triangles.astype(np.float64), origins, directions)
    nearest = distances.min(axis=1)
    expected = np.where(np.isfinite(nearest), distances.argmin(axis=1), -1)
    # Rounding decides where a ray passes an edge closely, starts on a surface or grazes it.
    a, b, c = (triangles[:, k].astype(np.float64) for k in range(3))
    normals = unit(np.cross(b - a, c - a))
    along = np.abs(directions @ normals.T)
    grazing = (along < 1e-3) & (along > 1e-9)
    on_plane = np.abs(np.einsum("rtk,tk->rt", a[None] - origins[:, None], normals)) < 1e-2
    doubtful = ((np.abs(margins) < 1e-3) | grazing | on_plane).any(axis=1)
    second = np.partition(distances, 1, axis=1)[:, 1]
    tie = np.isfinite(second) & (second < nearest + 1e-2)
    clear = ~doubtful
    assert clear.mean() > 0.05 and (expected[clear] >= 0).sum() > 50

    made = grid()
    assert len(made.levels) >= 4
    with voxelized(gpu, scenes.scene((scenes.soup(triangles), scenes.diffuse())), made) as found:
        distance, triangle, _, cell = shoot(gpu, found, origins, directions)
        hit = clear & (expected >= 0)
        np.testing.assert_array_equal(triangle[clear & ~tie], expected[clear & ~tie])
        np.testing.assert_allclose(distance[hit], nearest[hit], rtol=1e-5, atol=3e-3)
        corner, side = place_in_stack(made, cell[hit])
        inside = (origins[hit] + directions[hit] * nearest[hit, None] - corner) / side
        assert (inside > -5e-3).all() and (inside < 1.005).all()

        limit = rng.uniform(0.5, 60.0, len(origins))
        decided = clear & (np.abs(nearest - limit) > 1e-2)
        assert_blocked(gpu, found, origins[decided], directions[decided], limit[decided], nearest[decided])


def test_triangles_are_listed_where_they_are(gpu: GpuContext) -> None:
    """Points all over each triangle lie in cells of the finest level there, which list it; cells lie in no hole."""
    triangles = soup("ordinary", np.random.default_rng(7))
    made = grid()
    with voxelized(gpu, scenes.scene((scenes.soup(triangles), scenes.diffuse())), made) as found:
        corner, side = place_in_stack(made, found.cells)
        levels = np.log2(side[:, 0]).astype(int)
        assert set(levels) == set(range(len(made.levels)))
        for k, level in enumerate(made.levels[:-1]):
            low, high = np.array(level.first) * 2.0**k, np.array(level.end) * 2.0**k
            coarser = levels > k
            apart = (corner + side <= low) | (corner >= high)
            assert apart[coarser].any(axis=1).all()
        places = {tuple(row): index for index, row in enumerate(np.column_stack([corner, side]).tolist())}
        lists = np.split(found.triangles, np.cumsum(found.records[:, 1])[:-1])
        # And faces in their cells, but for slivers of so little area that sums round their places.
        low, size = corner[found.faces["cell"]], side[found.faces["cell"]]
        place = (found.faces["position"] - low) / size
        assert ((place > -1e-3) & (place < 1.001)).all(axis=1).mean() > 0.99
        points = reference.sample_triangles(triangles.astype(np.float64), 60, np.random.default_rng(1))
        for index, of_triangle in enumerate(points):
            for point in of_triangle:
                for k, level in enumerate(made.levels):
                    cell = np.floor(point / 2.0**k)
                    if (cell >= level.first).all() and (cell < level.end).all():
                        break
                inside = point / 2.0**k - cell
                if inside.min() > 1e-3 and inside.max() < 0.999:
                    assert index in lists[places[(*(cell * 2.0**k).tolist(), 2.0**k)]]


def nested_settings(side: int = 32, detail: float = 0.05, **values: Any) -> Settings:
    return Settings(
        voxel_auto=False, voxel_resolution=side, voxel_levels="ON", voxel_detail=detail, debug_checks=True, **values
    )


def voxels_of(ready: Any) -> VoxelData:
    return read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)


def sides_of_faces(found: VoxelData, made: VoxelGrid) -> np.ndarray:
    """(faces,) sides of their cells, in the finest ones'."""
    return place_in_stack(made, found.face_cells)[1][:, 0]


@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_furnace_across_levels(albedo: float, gpu: GpuContext) -> None:
    """A closed box that emits 1 - r and reflects r shines with radiance 1 everywhere, at the borders of levels too: on
    faces, and in the picture of a wall that crosses them."""
    eye = (0.4, 0.3, 0.2)
    made = scenes.scene(
        (scenes.box((-4.0, -3.0, -0.4), (5.0, 3.7, 1.3), inside_out=True), scenes.glowing(albedo, 1.0 - albedo)),
        camera=scenes.camera(eye, (1.0, 3.7, 0.0), angle=2.2, aspect=2.0),
    )
    with pipeline(gpu, made, nested_settings(bounces=300), (96, 48), samples=16) as ready:
        found = voxels_of(ready)
        at = ready.grid
        assert at is not None and len(at.levels) >= 4
        place = found.faces["position"] * at.cell_size + at.origin
        inside = np.einsum("fk,fk->f", found.faces["normal"], eye - place) > 0
        assert set(sides_of_faces(found, at)[inside]) == {2.0**k for k in range(len(at.levels))}
        np.testing.assert_allclose(radiance(ready)[inside], albedo, atol=3e-3)
        picture = ready.film.read_mean("combined")[..., :3]
        assert abs(picture.mean() - 1.0) < 2e-3
        columns = picture[8:40].mean(axis=(0, 2))  # the wall, and the corners beside it
        np.testing.assert_allclose(columns, 1.0, atol=5e-3)


def corridor(**more: Any) -> SceneData:
    """A long room along x, open nowhere, with a lamp in its middle."""
    lamp = scenes.light(LightKind.POINT, 3.0, (0.3, 0.0, 0.5), radius=0.05)
    return scenes.scene(
        (scenes.box((-6.1, -1.0, -1.1), (6.3, 1.2, 1.3), inside_out=True), scenes.diffuse(0.7)), lights=[lamp], **more
    )


def test_indirect_light_is_continuous_along_a_wall(gpu: GpuContext) -> None:
    """Light of a lamp that walls pass on, along a floor that crosses borders of levels, as in a grid of one level."""
    from_above = scenes.camera((0.0, 0.0, 1.2), (0.0, 0.0, -1.1), width=6.0, aspect=12.0, near=0.01)
    made = corridor(camera=from_above, pixel_filter_width=0.0)
    profiles = []
    for settings in (nested_settings(), scenes.settings(248)):
        chosen = settings.with_values(use_direct=False, bounce_rays=64, samples=32)
        means = []
        for seed in range(2):
            with pipeline(gpu, made, chosen.with_values(seed=seed), (120, 10)) as ready:
                means.append(ready.film.read_mean("combined")[..., :3].mean(axis=(0, 2)))
                levels = ready.grid.levels if ready.grid else ()
                if levels:
                    assert sum(level.end[0] * 2**k * 0.05 < 2.8 for k, level in enumerate(levels)) >= 2, (
                        "in the picture"
                    )
        profiles.append(np.mean(means, axis=0))
    levels, single = profiles
    assert single.max() > 2.0 * single.min()
    np.testing.assert_allclose(levels.mean(), single.mean(), rtol=0.01)
    np.testing.assert_allclose(levels, single, rtol=0.05)
    ratio = levels / single
    steps = np.abs(ratio[4:] - ratio[:-4])  # what jumps within 20 cm
    assert steps.max() < 0.05, "no border shows"


def test_the_same_scene_gives_the_same_bits_whatever_came_before(gpu: GpuContext) -> None:
    """Twice from the start; and where somebody moves or paints an object, or moves the camera, as if from the start."""
    ball = scenes.sphere(0.2, 8)

    def scene(x: float, eye: tuple[float, float, float], albedo: float = 0.5) -> SceneData:
        made = corridor(camera=scenes.camera(eye, (eye[0], 1.2, -0.5)))
        return dataclasses.replace(
            scenes.scene(
                (room.meshes[0], room.materials[0]),
                (ball, greys[albedo], scenes.at(x, 0.6, -0.4)),
                (ball, greys[albedo], scenes.at(2.5, 0.2, 0.1, 2.0)),
                lights=room.lights,
            ),
            camera=made.camera,
        )

    room, greys = corridor(), {albedo: scenes.diffuse(albedo) for albedo in (0.5, 0.2)}
    settings, size = nested_settings(samples=2), (24, 24)

    def fresh(made: SceneData) -> tuple[Any, bytes]:
        with pipeline(gpu, made, settings, size) as ready:
            return ready.grid, ready.film.read("combined").tobytes()

    near, beside, away = (0.0, 0.0, 0.3), (0.05, 0.02, 0.3), (3.5, 0.0, 0.3)
    first, moved = scene(0.2, near), scene(0.3, near)
    painted = dataclasses.replace(moved, materials=scene(0.3, near, 0.2).materials)
    at, picture = fresh(first)
    assert fresh(first) == (at, picture)
    with pipeline(gpu, first, settings, size, samples=0, is_live=True) as live:
        for made, stays in (
            (moved, True), (painted, True), (scene(0.3, beside, 0.2), True),
            (scene(0.3, away, 0.2), False),
        ):  # fmt: skip
            before = live.grid
            prepare(live, made, settings, size)
            sample(live, 2)
            assert (live.grid == before) == stays
            expected = fresh(made)
            assert (live.grid, live.film.read("combined").tobytes()) == expected
    # Frames of an animation do not depend on those before.
    walk = [scene(0.3, (0.4 * k, 0.0, 0.3)) for k in (0, 3)]
    grids = []
    with pipeline(gpu, walk[0], settings, size, samples=0) as ready:
        for made in walk:
            prepare(ready, made, settings, size)
            sample(ready, 2)
            assert (ready.grid, ready.film.read("combined").tobytes()) == fresh(made)
            grids.append(ready.grid)
    assert grids[0] != grids[1]


def test_levels_that_do_not_fit_become_smaller(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver that refuses long lists of links: half as many voxels along each side, and a warning."""
    made, original = corridor(), GpuContext.list_texture

    def refusing(self: GpuContext, name: str, count: int, *arguments: Any) -> Any:
        if name == "links" and count > 300_000:
            raise MemoryError("links are too many")
        return original(self, name, count, *arguments)

    with pipeline(gpu, made, nested_settings(64, bounce_rays=64), samples=0) as ready:
        assert ready.grid is not None and ready.grid.levels[0].size[0] == 64 and not ready.warnings
    monkeypatch.setattr(GpuContext, "list_texture", refusing)
    with pipeline(gpu, made, nested_settings(64, bounce_rays=64), samples=0) as ready:
        assert ready.grid is not None and ready.grid.levels[0].size[0] == 32
        assert [text for text in ready.warnings if "32 are used along the sides of levels" in text]


def test_everything_else_is_rendered_in_levels_too(gpu: GpuContext) -> None:
    """Transparency, glass, gloss, smooth shading, small emitters, instances, lights of all kinds, a bright world."""
    ball = scenes.sphere(0.2, 12)
    lights = [
        scenes.light(LightKind.POINT, 1.0, (0.3, 0.0, 1.0)),
        scenes.light(LightKind.SUN, 2.0, direction=(0.3, 0.1, -1.0), angle=0.1),
        scenes.light(LightKind.AREA, 5.0, (0.0, 0.5, 1.2), size=(0.2, 0.4)),
    ]
    shiny = scenes.principled(0.6, Roughness=0.2, Metallic=1.0)
    glass = scenes.principled(0.9, Roughness=0.0, Transmission_Weight=1.0)
    sheer = scenes.principled(0.5, Alpha=0.5)
    objects: list[Any] = [(scenes.plane(30.0, -1.0), scenes.diffuse(0.5))]
    objects += [(ball, surface, scenes.at(0.5 * k - 1.0, 0.4)) for k, surface in enumerate((shiny, glass, sheer))]
    objects += [(ball, scenes.emission(4.0), scenes.at(0.6, 0.2, 0.4, 0.2))]
    objects += [(ball, scenes.diffuse(0.8), scenes.at(float(x), 4.0, z)) for x in range(-12, 12) for z in (0.0, 0.6)]
    made = scenes.scene(
        *objects, lights=lights, world=scenes.world(0.3), camera=scenes.camera((0.0, -1.6, 0.3), (0.0, 0.4, 0.0))
    )
    views = ("voxels", "voxel_radiance", "voxel_emission", "shadow", "ambient_occlusion")
    with pipeline(gpu, made, nested_settings(samples=2), (32, 32), outputs=views) as ready:
        picture = ready.film.read_mean("combined")
        assert ready.features is not None and ready.features.has_levels and ready.features.has_instances
        assert len(ready.statistics()["levels"]) > 4
        assert picture[..., :3].min() > 0.0 and np.isfinite(picture).all()
        assert all(np.isfinite(ready.film.read_mean(name)).all() for name in views)
        seen = ready.film.read_mean("voxels")[..., 3]
        assert 0.3 < seen.mean() <= 1.0
        alone = ready.film.read_mean("combined").mean()
    with pipeline(gpu, made, scenes.settings(256, samples=2), (32, 32)) as ready:
        assert ready.film.read_mean("combined").mean() == pytest.approx(alone, rel=0.04)
        assert not ready.statistics()["levels"]
