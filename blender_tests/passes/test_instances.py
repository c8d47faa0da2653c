# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances that share the triangles of their mesh against instances that have their own in grid space."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from addon import sharing
from addon.gpu import interface
from addon.gpu.context import GpuContext
from addon.passes import geometry
from addon.scene import InstanceData, LightKind, MeshData, RayVisibility, SceneData
from addon.settings import Settings
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, prepare, radiance, read_list, sample, unit_grid, voxelized
from blender_tests.passes.test_trace import shoot, unit

SHARED, SEPARATE = 0, 1 << 60  # bytes that sharing has to save


def turned(rng: np.random.Generator, *, mirrored: bool = False) -> np.ndarray:
    """A random rotation with stretch, by which normals and areas change, (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.6, 1.5, 3)
    if (np.linalg.det(matrix) < 0) != mirrored:
        matrix[:3, 0] *= -1.0
    return matrix


def cards() -> MeshData:
    """Some squares one over the other, of two material slots."""
    squares = [scenes.plane(0.7, 0.3 * k) for k in range(4)]
    made = scenes.soup(np.concatenate([square.positions[square.triangle_vertices] for square in squares]))
    made.triangle_slots[4:] = 1
    uv = np.concatenate([square.uv_layers["UVMap"] for square in squares])
    return dataclasses.replace(made, uv_layers={"UVMap": uv}, active_uv="UVMap")


def crowd(**more: object) -> SceneData:
    """Over a floor that is there once: smooth, mirrored, flat, glowing, glossy, partly transparent, held-out instances,
    some of which only some rays see."""
    rng = np.random.default_rng(5)
    checks = material(
        node("C", "TexCoord"), node("T", "TexChecker", Vector="C.UV", Scale=3.0),
        node("E", "Emission", Color="T.Color", Strength=2.0), surface="E.Emission", name="checks",
    )  # fmt: skip
    materials = (
        scenes.diffuse(0.8), scenes.diffuse((0.8, 0.2, 0.1)), scenes.principled(0.6, Roughness=0.1),
        scenes.principled((0.1, 0.6, 0.1), Alpha=0.5), checks,
    )  # fmt: skip
    made = [InstanceData("floor", 1, scenes.at(z=-0.4), (0,))]
    for number in range(24):
        matrix = turned(rng, mirrored=number % 3 == 0)
        matrix[:3, 2] *= 0.0 if number in (4, 16) else 1.0
        matrix[:3, 3] = rng.uniform((-2.0, -2.0, 0.2), (2.0, 2.0, 1.5))
        is_card = number % 2 == 1
        seen = RayVisibility.ALL if number % 5 else RayVisibility.CAMERA | RayVisibility.SHADOW
        slots = (1 + number % 4, 1 + (number + 1) % 4) if is_card else (1 + number % 3,)
        made.append(InstanceData(f"{number}", 2 if is_card else 0, matrix, slots, seen, number == 7, number, 0.3))
    lamp = scenes.light(LightKind.POINT, 20.0, (1.0, -1.0, 4.0), radius=0.2)
    base = scenes.scene(lights=[lamp], world=scenes.world(0.3), camera=scenes.camera((0.0, -5.0, 3.0)))
    meshes = (scenes.sphere(0.35, 8), scenes.plane(6.0), cards())
    return dataclasses.replace(base, meshes=meshes, instances=tuple(made), materials=materials, **more)


def pictures(gpu: GpuContext, made: SceneData, settings: Settings) -> dict[str, np.ndarray]:
    outputs = ("combined", "normal", "depth", "diffuse_color")
    with pipeline(gpu, made, settings, (48, 40), outputs=outputs) as ready:
        voxels, made_geometry = ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry
        assert voxels is not None and made_geometry is not None
        found = {name: ready.film.read(name) for name in outputs}
        found["shared"] = np.array(made_geometry.has_instances)
        found["places"] = read_list(voxels.faces.place, voxels.faces.count, np.uint32)
        found["bricks"] = np.frombuffer(voxels.bricks.read(), np.uint32)
        found["lists"] = np.array([voxels.pair_count, voxels.faces.count])
        return found


@pytest.mark.parametrize("glossy", [False, True], ids=["matte", "glossy"])
def test_pictures_are_the_same(glossy: bool, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells, lists and the points that faces stand for to the last bit; pictures but for rounding."""
    made = crowd()
    if not glossy:
        plain = tuple(scenes.diffuse(0.2 + 0.15 * k) for k in range(len(made.materials)))
        made = dataclasses.replace(made, materials=plain)
    settings = scenes.settings(40, samples=2)
    monkeypatch.setattr(sharing, "LEAST_SAVED", SEPARATE)
    separate = pictures(gpu, made, settings)
    monkeypatch.setattr(sharing, "LEAST_SAVED", SHARED)
    shared = pictures(gpu, made, settings)
    assert shared.pop("shared") and not separate.pop("shared")
    assert shared["combined"][..., :3].std() > 0.05
    for name in ("bricks", "lists", "places", "diffuse_color"):
        np.testing.assert_array_equal(shared[name], separate[name], err_msg=name)
    for name in ("combined", "normal", "depth"):
        a, b = (np.nan_to_num(which[name], posinf=0.0) for which in (shared, separate))
        off = np.abs(a - b) > 1e-5 * (np.abs(b) + 0.1)
        # A ray that rounding sends past an edge shows somewhere, and there alone.
        assert off.mean() < 2e-3, (name, off.mean(), np.abs(a - b).max())


@pytest.mark.parametrize("any_hit", [False, True])
def test_rays_hit_the_same(any_hit: bool, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Number, distance and normal of what rays meet, partly transparent surfaces and kinds of rays included."""
    made = crowd()
    world = np.eye(4) * 4.0
    world[:, 3] = (12.0, 12.0, 3.0, 1.0)
    placed = [dataclasses.replace(one, world_from_object=world @ one.world_from_object) for one in made.instances]
    made = dataclasses.replace(made, instances=tuple(placed))
    rng = np.random.default_rng(2)
    origins = rng.uniform((1.0, 1.0, 2.0), (23.0, 23.0, 14.0), (20000, 3))
    directions = unit(rng.normal(size=origins.shape))
    found = {}
    for saved in (SHARED, SEPARATE):
        monkeypatch.setattr(sharing, "LEAST_SAVED", saved)
        with voxelized(gpu, made, unit_grid((24, 24, 16))) as data:
            found[saved] = shoot(gpu, data, origins, directions, any_hit=any_hit, mask=RayVisibility.DIFFUSE)
    (distance, triangle, normal, cell), separate = found[SHARED], found[SEPARATE]
    floor, hits = 2, separate[1] >= 0
    assert 0.3 < hits.mean() < 0.95 and (separate[1] >= floor).mean() > 0.1
    assert ((triangle >= 0) != hits).sum() <= 2  # rounding at an edge
    if not any_hit:  # which one is found first depends on the order of a cell's list
        same = triangle == separate[1]
        assert (~same).sum() <= 4
        np.testing.assert_allclose(distance[same & hits], separate[0][same & hits], rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(normal[same], separate[2][same], atol=1e-6)
        assert (cell[same] == separate[3][same]).all(axis=1).mean() > 0.999


def test_closed_boxes_let_nothing_out(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was voxelized is what rays are tested against, to the last bit: none slips between cells."""
    monkeypatch.setattr(sharing, "LEAST_SAVED", SHARED)
    rng = np.random.default_rng(11)
    shape, made, origins = scenes.sphere(1.0, 6), [], []
    for x in (7.0, 21.0, 35.0):
        matrix = turned(rng)
        matrix[:3, :3] *= 4.0
        matrix[:3, 3] = (x, 8.0, 8.0)
        made.append((shape, scenes.diffuse(), matrix))
        origins.append(matrix[:3, 3] + rng.uniform(-0.3, 0.3, (20000, 3)))
    start = np.concatenate(origins)
    with voxelized(gpu, scenes.scene(*made), unit_grid((44, 16, 16))) as found:
        triangle = shoot(gpu, found, start, unit(rng.normal(size=start.shape)))[1]
        assert (triangle < 0).sum() <= 3
        owner = np.repeat(np.arange(3), 20000)
        hit = triangle >= 0
        np.testing.assert_array_equal(triangle[hit] // len(shape.triangle_vertices), owner[hit])


def test_a_copy_adds_no_vertex_memory(gpu: GpuContext) -> None:
    """A mesh of 50 000 triangles once, twice, and a hundred times."""
    shape, surface = scenes.sphere(1.0, 160), scenes.diffuse()

    def memory(copies: int) -> dict[str, int]:
        made = scenes.scene(*((shape, surface, scenes.at(3.0 * k)) for k in range(copies)))
        with voxelized(gpu, made, unit_grid((16, 16, 16))) as found:
            assert found.geometry.has_instances == (copies > 1)
            return dict(gpu.memory)

    once, twice, many = (memory(copies) for copies in (1, 2, 100))
    row = interface.TRIANGLES_PER_ROW * interface.TRIANGLE_BYTES  # in which the texture grows
    for name in ("corners", "attributes", "vertex positions", "vertex indices"):
        assert once[name] == twice[name] == many[name], name
    assert once["triangles"] <= twice["triangles"] <= many["triangles"] <= once["triangles"] + row


def test_few_bytes_are_not_shared(gpu: GpuContext) -> None:
    """Instances of a small mesh cost no transformation of each triangle that a ray looks at."""
    shape, surface = scenes.box(), scenes.diffuse()
    boxes = scenes.scene(*((shape, surface, scenes.at(3.0 * k)) for k in range(50)))
    assert not sharing.shares_triangles(boxes) and not sharing.shares_triangles(scenes.scene())
    with voxelized(gpu, boxes, unit_grid(16)) as found:
        assert found.geometry.defines == {"HAS_INSTANCES": False, "LEVELS": 0}
        assert not found.voxels.trace_defines["HAS_INSTANCES"]
        assert found.voxels.cell_triangles.components == 1


@pytest.mark.parametrize("width", [None, 3.0], ids=["perspective", "orthographic"])
def test_only_what_may_be_in_view_is_drawn(
    width: float | None, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Instances all around the camera, stretched, the picture's edges full of them: the same as drawing all."""
    rng = np.random.default_rng(8)
    shape, surface = scenes.sphere(0.3, 5), scenes.diffuse()
    objects = []
    for _ in range(300):
        matrix = turned(rng)
        matrix[:3, 0] *= 4.0
        matrix[:3, 3] = rng.uniform(-6.0, 6.0, 3)
        objects.append((shape, surface, matrix))
    view = scenes.camera((0.0, 0.0, 0.0), (1.0, 2.0, 0.3), width=width)
    made = scenes.scene(*objects, world=scenes.world(1.0), camera=view)
    found = {}
    for least in (10, 1000):
        monkeypatch.setattr(geometry, "LEAST_CULLED", least)
        with pipeline(gpu, made, scenes.settings(16, bounces=0), (40, 40), samples=1) as ready:
            assert ready.voxel_light.geometry.geometry is not None and ready.picture.surface.pictures is not None
            draw = ready.voxel_light.geometry.geometry.meshes[0]
            shown = draw.show(ready.picture.camera.raster_matrix((0.5, 0.5)))
            found[least] = shown, ready.picture.surface.pictures.seen.read()
    assert 10 < found[10][0] < 200 and found[1000][0] == 300
    assert found[10][1] == found[1000][1]
    seen = np.frombuffer(found[10][1], np.uint32).reshape(40, 40)
    edges = np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]])
    assert (edges > 0).mean() > 0.3 and (seen == 0).mean() > 0.05


def crowded_room() -> SceneData:
    """Balls of two meshes with as many triangles, and a box, in a room."""
    ball, surface = scenes.sphere(0.3, 8), scenes.diffuse((0.7, 0.4, 0.3))
    flat = dataclasses.replace(ball, positions=ball.positions * np.float32([1.0, 1.0, 0.5]))
    return scenes.scene(
        (scenes.box((-2, -2, -1), (2, 2, 1), inside_out=True), scenes.diffuse(0.6)),
        (flat, surface, scenes.at(-1.0, 0.5, -0.4)), (ball, surface, scenes.at(0.2, 0.6, -0.6)),
        (ball, surface, scenes.at(1.0, 0.4, 0.1)), (scenes.box((-0.4, -1.0, -1.0), (0.2, -0.3, -0.3)), surface),
        lights=(scenes.light(LightKind.POINT, 3.0, (0.9, -1.2, 0.7), radius=0.1),),
        camera=scenes.camera((0.5, -1.8, 0.2)),
    )  # fmt: skip


@pytest.mark.parametrize("edit", ["moved", "another mesh", "seen by other rays"])
def test_edits_leave_the_bits_of_a_fresh_start(edit: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where an instance takes over another mesh, the meshes after one that nobody uses any more lie elsewhere."""
    monkeypatch.setattr(sharing, "LEAST_SAVED", SHARED)
    made = crowded_room()
    changes = {
        "moved": {"world_from_object": scenes.at(-0.7, 0.2, -0.1)},
        "another mesh": {"mesh": made.instances[2].mesh},
        "seen by other rays": {"visibility": RayVisibility.CAMERA | RayVisibility.DIFFUSE},
    }
    instances = list(made.instances)
    instances[1] = dataclasses.replace(instances[1], **changes[edit])
    edited = dataclasses.replace(made, instances=tuple(instances))
    settings = scenes.settings(40, bounces=4)
    found = []
    for start in (made, edited):
        with pipeline(gpu, start, settings, (24, 18), samples=1, is_live=True) as ready:
            if start is made:
                before = ready.film.read("combined").tobytes()
            prepare(ready, edited, settings, (24, 18))
            sample(ready, 1)
            found.append((ready.film.read("combined").tobytes(), radiance(ready).tobytes()))
            assert found[-1][0] != before
    assert found[0] == found[1]
