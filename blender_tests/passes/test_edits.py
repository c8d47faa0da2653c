# SPDX-License-Identifier: GPL-3.0-or-later
"""Edited scenes: what depends on the edit is made again, and everything has the bits of a fresh start."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from addon import sharing
from addon.edit import Edit, around_bricks, bricks_beside, bricks_in, united
from addon.gpu.context import GpuContext
from addon.gpu.interface import BRICK, CHANGED_BOXES, NONE_INDEX
from addon.levels import nested
from addon.materials.graph import ImageData, ImageEncoding, ImageSet, MaterialData
from addon.passes.bounce import BouncePass
from addon.pipeline import Pipeline
from addon.scene import LightData, LightKind, RayVisibility, SceneData
from addon.settings import Settings
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, prepare, radiance, read_list, read_voxels, sample, unit_grid

SETTINGS = scenes.settings(40, bounces=8, bounce_rays=4)  # the more a face has, the more faces an edit concerns
# So few links that there are not more of them where faces are fewer: then an edit would trace all of them again.
NESTED = SETTINGS.with_values(voxel_levels="ON", voxel_resolution=32, voxel_detail=0.05, bounce_rays=1)
GRIDS = {"one grid": SETTINGS, "levels": NESTED}
SIZE = (24, 18)


LAMP = scenes.light(LightKind.POINT, 3.0, (0.9, -1.2, 0.7), radius=0.1)


def room(
    *,
    lights: tuple[LightData, ...] = (LAMP,),
    ball: MaterialData | None = None,
    sheet: MaterialData | None = None,
    **more: Any,
) -> SceneData:
    """A room with a lamp, a box on the floor, a ball, and a thin sheet twice. With a world one side is open."""
    walls = scenes.box((-2, -2, -1), (2, 2, 1), inside_out=True)
    if more.get("world"):
        walls = scenes.mesh(walls.positions, walls.triangle_vertices[1:], "walls")
    parts = [
        (walls, scenes.diffuse((0.7, 0.6, 0.5))),
        (scenes.box((-0.4, -0.4, -1.0), (0.2, 0.3, -0.3)), scenes.diffuse((0.2, 0.7, 0.3))),
        (scenes.sphere(0.3, 12), ball or scenes.principled((0.8, 0.3, 0.2), Roughness=0.4)),
        (scenes.plane(0.7), sheet or scenes.diffuse(0.5)),
    ]
    made = scenes.scene(*parts, lights=lights, camera=scenes.camera((0.5, -1.8, 0.2)), **more)
    again = dataclasses.replace(made.instances[3], name="again", random=0.7)
    made = dataclasses.replace(made, instances=(*made.instances, again))
    places = [np.eye(4), np.eye(4), scenes.at(0.9, 0.4, -0.4), scenes.at(-1.1, 0.8, 0.1), scenes.at(-1.2, -1.0, -0.6)]
    return placed(made, dict(enumerate(places)))


def placed(made: SceneData, places: dict[int, np.ndarray]) -> SceneData:
    instances = list(made.instances)
    for index, matrix in places.items():
        instances[index] = dataclasses.replace(instances[index], world_from_object=matrix)
    return dataclasses.replace(made, instances=tuple(instances))


def turned(angle: float, x: float, y: float, z: float, scale: float = 1.0) -> np.ndarray:
    matrix = scenes.at(x, y, z)
    c, s = np.cos(angle) * scale, np.sin(angle) * scale
    matrix[:3, :3] = [[c, -s, 0], [s * 0.8, c * 0.8, -0.6 * scale], [s * 0.6, c * 0.6, 0.8 * scale]]
    return matrix


def bits(made: Pipeline) -> dict[str, bytes]:
    """All that was made, as far as it does not depend on the order of a cell's list."""
    voxels, geometry = made.voxel_light.voxelize.voxels, made.voxel_light.geometry.geometry
    assert voxels is not None and geometry is not None
    found = read_voxels(voxels, geometry)
    links = made.voxel_light.links.links
    assert links is not None
    count = voxels.faces.count
    kept = {
        "triangles": read_list(geometry.triangles, 3 * geometry.triangle_count, np.uint32).tobytes(),
        "bricks": voxels.bricks.read(),
        "pairs": found.pairs.tobytes(),
        "records": found.ordered_records.tobytes(),
        "faces": found.faces.tobytes(),
        "order": read_list(voxels.faces.order, count, np.uint32).tobytes(),
        "links": read_list(links, count * made.voxel_light.links.count // 4, np.uint32).tobytes(),
        "light": radiance(made).tobytes(),
    }
    if voxels.cell_opacities is not None:
        cells = np.repeat(np.arange(len(found.records)), found.records[:, 1])
        word = np.uint32 if voxels.cell_opacities.components == 2 else np.uint8
        opacities = read_list(voxels.cell_opacities, voxels.pair_count, word)
        kept["opacities"] = opacities[np.lexsort((found.triangles, cells))].tobytes()
    if made.voxel_light.links.straight is not None:
        kept["straight"] = read_list(made.voxel_light.links.straight, count, np.uint32).tobytes()
    return kept | {name: made.film.read(name).tobytes() for name in made.film.names}


def fresh(gpu: GpuContext, made: SceneData, settings: Settings = SETTINGS) -> dict[str, bytes]:
    with pipeline(gpu, made, settings, SIZE, samples=1) as ready:
        return bits(ready)


def assert_same(found: dict[str, bytes], wanted: dict[str, bytes]) -> None:
    assert found.keys() == wanted.keys()
    assert [name for name in wanted if found[name] != wanted[name]] == []


def shares(ready: Pipeline) -> dict[str, float]:
    """Of cells and faces: how many were made again."""
    voxels = ready.voxel_light.voxelize.voxels
    assert voxels is not None
    totals = {"cells": voxels.cell_count, "linked_faces": voxels.faces.count, "lit_faces": voxels.faces.count}
    return {name: count / totals[name] for name, count in ready.redone.items()}


EDITS = {
    "moved": {2: scenes.at(0.7, 0.5, -0.3)},
    "moved far": {2: scenes.at(-1.4, -1.3, 0.5)},
    "into another": {2: scenes.at(-0.1, 0.0, -0.5)},
    "at a wall": {2: scenes.at(1.69, 0.2, 0.1)},
    "turned": {3: turned(0.7, -1.1, 0.8, 0.1)},
    "scaled": {1: turned(0.0, 0.1, 0.2, 0.1, 0.8)},
    "mirrored": {3: np.diag([-1.0, 1.0, 1.0, 1.0]) @ scenes.at(1.1, 0.8, 0.1)},
    "two": {2: scenes.at(0.7, 0.1, 0.3), 3: scenes.at(0.3, 0.8, -0.7)},
    "an instance": {4: scenes.at(-0.8, -0.9, -0.4)},
    "out of sight": {2: scenes.at(0.3, -0.05, -0.6)},
}


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("edit", EDITS)
def test_a_moved_object_leaves_the_bits_of_a_fresh_start(edit: str, grid: str, gpu: GpuContext) -> None:
    settings = GRIDS[grid]
    made = room()
    moved = placed(made, EDITS[edit])
    with pipeline(gpu, made, settings, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, moved, settings, SIZE)
        sample(ready, 1)
        most = 0.7 if grid == "one grid" else 0.97  # by wide cells the room is small
        assert all(0.0 < share < most for share in shares(ready).values()), shares(ready)
        assert_same(bits(ready), fresh(gpu, moved, settings))


def many_lights(count: int) -> tuple[LightData, ...]:
    rng = np.random.default_rng(3)
    places = rng.uniform((-1.8, -1.8, 0.2), (1.8, 1.8, 0.9), (count, 3))
    return tuple(scenes.light(LightKind.POINT, 0.3, tuple(place), radius=0.02) for place in places)


VARIANTS = {
    "world": {"world": scenes.world((0.4, 0.5, 0.7))},
    "sun": {
        "lights": (scenes.light(LightKind.SUN, 2.0, direction=(0.4, 0.9, -0.3), angle=0.1),),
        "world": scenes.world(0.1),
    },
    "spot": {
        "lights": (
            scenes.light(LightKind.SPOT, 5.0, (0.9, -0.9, 0.9), (0.0, 0.6, -1.0), spot_angle=1.2, radius=0.2),
        ),
    },
    "area": {"lights": (scenes.light(LightKind.AREA, 4.0, (0.0, 0.0, 0.95), size=(0.8, 0.3)), LAMP)},
    "many lights": {"lights": many_lights(20)},
    "transparent": {"ball": scenes.principled(0.8, Alpha=0.4)},
    "a moved emitter": {"ball": scenes.glowing(0.5, (4.0, 3.0, 2.0))},
    "a still emitter": {"sheet": scenes.emission(3.0)},
}  # fmt: skip


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_whatever_lights_the_scene(variant: str, grid: str, gpu: GpuContext) -> None:
    settings = GRIDS[grid]
    made = room(**VARIANTS[variant])
    first, second = placed(made, EDITS["moved"]), placed(made, EDITS["moved far"])
    with pipeline(gpu, made, settings, SIZE, samples=1, is_live=True) as ready:
        for moved in (first, second):  # one edit on the other
            prepare(ready, moved, settings, SIZE)
            sample(ready, 1)
            assert 0.0 < shares(ready)["cells"] < 0.5
        assert_same(bits(ready), fresh(gpu, second, settings))


def test_back_and_forth_is_where_it_began(gpu: GpuContext) -> None:
    made = room()
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        wanted = bits(ready)
        for moved in (placed(made, EDITS["two"]), made):
            prepare(ready, moved, SETTINGS, SIZE)
            sample(ready, 1)
        assert_same(bits(ready), wanted)


def other_materials(made: SceneData) -> SceneData:
    """The ball gets the material of the box."""
    instances = list(made.instances)
    instances[2] = dataclasses.replace(instances[2], materials=instances[1].materials)
    return dataclasses.replace(made, instances=tuple(instances))


def other_shape(made: SceneData) -> SceneData:
    """Vertices of the ball were moved."""
    meshes = list(made.meshes)
    ball = meshes[made.instances[2].mesh]
    positions = ball.positions * np.array([0.9, 0.5, 0.7], np.float32)
    meshes[made.instances[2].mesh] = dataclasses.replace(ball, positions=positions)
    return dataclasses.replace(made, meshes=tuple(meshes))


def unseen_by_light(made: SceneData) -> SceneData:
    instances = list(made.instances)
    visibility = RayVisibility.ALL & ~RayVisibility.SHADOW & ~RayVisibility.CAMERA
    instances[2] = dataclasses.replace(instances[2], visibility=visibility)
    return dataclasses.replace(made, instances=tuple(instances))


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("edit", [other_materials, other_shape, unseen_by_light])
def test_edits_that_move_nothing(edit: Any, grid: str, gpu: GpuContext) -> None:
    settings = GRIDS[grid]
    made = room()
    edited = edit(made)
    with pipeline(gpu, made, settings, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, edited, settings, SIZE)
        sample(ready, 1)
        most = 0.5 if grid == "one grid" else 0.97
        assert all(0.0 < share < most for share in shares(ready).values()), shares(ready)
        assert_same(bits(ready), fresh(gpu, edited, settings))


def repainted(made: SceneData, materials: dict[int, MaterialData]) -> SceneData:
    """``materials``: by instance."""
    new = list(made.materials)
    for index, data in materials.items():
        new[made.instances[index].materials[0]] = data
    return dataclasses.replace(made, materials=tuple(new))


PAINTS = {
    "a ball": {2: scenes.principled((0.2, 0.3, 0.9), Roughness=0.4)},
    "walls": {0: scenes.diffuse((0.3, 0.6, 0.7))},
    "another shader": {1: scenes.principled((0.9, 0.1, 0.1), Roughness=0.2, Metallic=1.0)},
    "all of them": {
        0: scenes.diffuse(0.4), 1: scenes.diffuse(0.1), 2: scenes.diffuse(0.9),
        3: scenes.principled(0.3, Roughness=0.9),
    },
}  # fmt: skip


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("is_live", [True, False])
@pytest.mark.parametrize("paint", PAINTS)
def test_other_colours_leave_what_rays_have_found(paint: str, is_live: bool, grid: str, gpu: GpuContext) -> None:
    settings = GRIDS[grid]
    made = room(world=scenes.world((0.4, 0.5, 0.7)))
    painted = repainted(made, PAINTS[paint])
    with pipeline(gpu, made, settings, SIZE, samples=1, is_live=is_live) as ready:
        prepare(ready, painted, settings, SIZE)
        passes = set(gpu.times)
        sample(ready, 1)
        assert {"materials", "voxelize", "bounce"} <= passes
        assert not {"geometry", "link", "neighbours", *(["inject"] if is_live else [])} & passes
        assert ready.redone["cells"] > 0 and ready.redone["linked_faces"] == 0
        if paint == "a ball":
            assert shares(ready)["cells"] < 0.3
        assert_same(bits(ready), fresh(gpu, painted, settings))
        gpu.times.clear()
        prepare(ready, dataclasses.replace(painted, exposure=2.0), settings, SIZE)
        assert not {"materials", "voxelize", "link", "inject", "bounce"} & set(gpu.times)


GLOWING = scenes.glowing(0.5, (4.0, 3.0, 2.0))
SHINY = scenes.principled((0.8, 0.3, 0.2), Roughness=0.4)


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize(
    ("before", "now"), [(SHINY, GLOWING), (GLOWING, SHINY), (GLOWING, scenes.glowing(0.2, (1.0, 1.0, 5.0)))]
)
def test_what_begins_or_ends_to_glow(before: MaterialData, now: MaterialData, grid: str, gpu: GpuContext) -> None:
    settings = GRIDS[grid]
    made = room(ball=before, sheet=scenes.emission(0.5))
    painted = repainted(made, {2: now})
    with pipeline(gpu, made, settings, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, painted, settings, SIZE)
        sample(ready, 1)
        assert "geometry" not in gpu.times and "neighbours" not in gpu.times
        assert shares(ready)["cells"] < 0.3 and 0.0 < shares(ready)["linked_faces"] < 0.9
        assert_same(bits(ready), fresh(gpu, painted, settings))


def test_a_first_glow(gpu: GpuContext) -> None:
    """Links brought no light before."""
    made = room()
    painted = repainted(made, {2: GLOWING})
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        for edited in (painted, made, painted):
            prepare(ready, edited, SETTINGS, SIZE)
        sample(ready, 1)
        assert_same(bits(ready), fresh(gpu, painted))


@pytest.mark.parametrize(
    ("before", "now"), [(SHINY, scenes.principled(0.8, Alpha=0.4)), (scenes.principled(0.8, Alpha=0.4), SHINY)]
)
def test_where_light_goes_through_is_more_than_a_look(before: MaterialData, now: MaterialData, gpu: GpuContext) -> None:
    made = room(ball=before)
    painted = repainted(made, {2: now})
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, painted, SETTINGS, SIZE)
        sample(ready, 1)
        assert set(shares(ready).values()) == {1.0}
        assert_same(bits(ready), fresh(gpu, painted))


def test_a_colour_and_a_place_at_once(gpu: GpuContext) -> None:
    made = room()
    edited = repainted(placed(made, EDITS["moved"]), PAINTS["another shader"])
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, edited, SETTINGS, SIZE)
        sample(ready, 1)
        assert all(0.0 < share < 0.9 for share in shares(ready).values()), shares(ready)
        assert_same(bits(ready), fresh(gpu, edited))


def test_colours_of_instances_that_share_triangles(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sharing, "LEAST_SAVED", 0)
    made = room()
    painted = repainted(made, {3: scenes.diffuse((0.9, 0.1, 0.2))})
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, painted, SETTINGS, SIZE)
        found, cells = radiance(ready).tobytes(), shares(ready)["cells"]
    assert 0.0 < cells < 0.3
    with pipeline(gpu, painted, SETTINGS, SIZE, samples=1) as ready:
        assert radiance(ready).tobytes() == found


def test_an_interrupted_colour_shows_nowhere(gpu: GpuContext) -> None:
    """Whatever comes next: the same colour, another, or a move."""
    made = room()
    first = repainted(made, PAINTS["a ball"])
    second = repainted(made, PAINTS["another shader"])
    wanted = {id(scene): fresh(gpu, scene) for scene in (first, second, made)}
    steps = 0
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        while True:
            steps += 1
            half = ready.prepare(first, SETTINGS, SIZE)
            count = sum(1 for _, _ in zip(half, range(steps), strict=False))
            half.close()
            following = (second, first, made)[steps % 3]
            prepare(ready, following, SETTINGS, SIZE)
            sample(ready, 1)
            assert_same(bits(ready), wanted[id(following)])
            if count < steps:
                break
            prepare(ready, made, SETTINGS, SIZE)


def test_images_of_other_materials_stay(gpu: GpuContext) -> None:
    made = room(sheet=textured())
    painted = repainted(made, PAINTS["a ball"])
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        before = ready.voxel_light.materials.set.textures  # type: ignore[union-attr]
        prepare(ready, painted, SETTINGS, SIZE)
        assert ready.voxel_light.materials.set.textures == before and len(before) == 1  # type: ignore[union-attr]
        prepare(ready, repainted(painted, {3: scenes.diffuse(0.5)}), SETTINGS, SIZE)
        assert not ready.voxel_light.materials.set.textures and "image textures" not in gpu.memory  # type: ignore[union-attr]


def textured() -> MaterialData:
    image = ImageData("grey", np.full((4, 4, 4), 128, np.uint8), ImageEncoding.SRGB)
    return material(
        node("I", "TexImage", ImageSet("grey", {1001: image})), node("D", "BsdfDiffuse", Color="I.Color"),
        surface="D.BSDF",
    )  # fmt: skip


def removed(made: SceneData) -> SceneData:
    return dataclasses.replace(made, instances=(*made.instances[:2], *made.instances[3:]))


def beyond(made: SceneData) -> SceneData:
    """Out of the room: the grid grows."""
    return placed(made, {2: scenes.at(2.5, 0.0, 0.0)})


@pytest.mark.parametrize("edit", [removed, beyond])
def test_other_numbers_and_another_grid_are_a_fresh_start(edit: Any, gpu: GpuContext) -> None:
    made = room()
    edited = edit(made)
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, edited, SETTINGS, SIZE)
        sample(ready, 1)
        assert set(shares(ready).values()) == {1.0}
        assert_same(bits(ready), fresh(gpu, edited))


def test_a_light_and_an_object_at_once(gpu: GpuContext) -> None:
    made = room()
    light = scenes.light(LightKind.POINT, 2.0, (-0.5, 1.2, 0.6), radius=0.1)
    edited = dataclasses.replace(placed(made, EDITS["moved"]), lights=(light,))
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, edited, SETTINGS, SIZE)
        sample(ready, 1)
        assert shares(ready)["lit_faces"] == 1.0 and shares(ready)["linked_faces"] < 0.7
        assert_same(bits(ready), fresh(gpu, edited))


def test_an_interrupted_edit_shows_nowhere(gpu: GpuContext) -> None:
    made = room()
    first, second = placed(made, EDITS["moved"]), placed(made, EDITS["turned"])
    wanted = fresh(gpu, second)
    steps = 0
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        while True:
            steps += 3
            half = ready.prepare(first, SETTINGS, SIZE)
            count = sum(1 for _, _ in zip(half, range(steps), strict=False))
            half.close()
            prepare(ready, second, SETTINGS, SIZE)
            sample(ready, 1)
            assert_same(bits(ready), wanted)
            if count < steps:
                break


def test_an_interrupted_edit_and_another_elsewhere(gpu: GpuContext) -> None:
    """What is not yet known of faces since the first is not forgotten with the second."""
    made = room()
    both = placed(placed(made, EDITS["scaled"]), EDITS["turned"])
    ways = [(placed(made, EDITS["scaled"]), both), (placed(both, {1: np.eye(4)}), made)]
    wanted = [fresh(gpu, end) for _, end in ways]
    steps, is_whole = 0, False
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        while not is_whole:
            steps += 3
            for (first, end), right in zip(ways, wanted, strict=True):
                half = ready.prepare(first, SETTINGS, SIZE)
                is_whole = sum(1 for _ in zip(half, range(steps), strict=False)) < steps
                half.close()
                prepare(ready, end, SETTINGS, SIZE)
                sample(ready, 1)
                assert_same(bits(ready), right)


def test_a_render_keeps_nothing_for_edits(gpu: GpuContext) -> None:
    """It takes over voxels and links all the same: frames of an animation are edits too."""
    made = room()
    moved = placed(made, EDITS["moved"])
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1) as ready:
        before = dict(gpu.memory)
        assert "face irradiance" not in before
        prepare(ready, moved, SETTINGS, SIZE)
        sample(ready, 1)
        assert gpu.memory.keys() == before.keys()
        assert shares(ready)["lit_faces"] == 1.0 and shares(ready)["cells"] < 0.3
        assert_same(bits(ready), fresh(gpu, moved))


def test_without_light_on_surfaces_lists_are_taken_over(gpu: GpuContext) -> None:
    settings = dataclasses.replace(SETTINGS, gather_mode="OCCLUSION")
    made = room(ball=scenes.principled(0.8, Alpha=0.4))
    moved = placed(made, EDITS["moved"])

    def found(ready: Pipeline) -> tuple[bytes, ...]:
        voxels = ready.voxel_light.voxelize.voxels
        assert voxels is not None and voxels.lit_faces is None and voxels.cell_opacities is not None
        records = read_list(voxels.cells, voxels.cell_count, np.uint32)
        triangles = read_list(voxels.cell_triangles, voxels.pair_count, np.uint32)[:, 0]
        order = np.lexsort((triangles, np.repeat(np.arange(len(records)), records[:, 1])))
        word = np.uint32 if voxels.cell_opacities.components == 2 else np.uint8
        opacities = read_list(voxels.cell_opacities, voxels.pair_count, word)
        return (
            voxels.bricks.read(), records.tobytes(), triangles[order].tobytes(), opacities[order].tobytes(),
            ready.film.read("combined").tobytes(),
        )  # fmt: skip

    with pipeline(gpu, made, settings, SIZE, samples=1) as ready:
        prepare(ready, moved, settings, SIZE)
        sample(ready, 1)
        assert 0 < ready.redone["cells"] < 0.3 * ready.voxel_light.voxelize.voxels.cell_count  # type: ignore[union-attr]
        after = found(ready)
    with pipeline(gpu, moved, settings, SIZE, samples=1) as ready:
        assert after == found(ready)


@pytest.mark.parametrize(("name", "lost"), [("ray_boxes", {"light"}), ("cell_boxes", {"links"})])
def test_boxes_decide_what_is_traced_again(
    name: str, lost: set[str], gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With boxes elsewhere what is taken over is wrong: the tests above would see it."""
    made = room()
    moved = placed(made, EDITS["moved far"])
    monkeypatch.setattr(Edit, name, property(lambda self: np.zeros((1, 2, 3))))
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, moved, SETTINGS, SIZE)
        sample(ready, 1)
        found, wanted = bits(ready), fresh(gpu, moved)
    assert lost <= {key for key in wanted if found[key] != wanted[key]}


def test_nothing_that_was_edited_does_nothing(gpu: GpuContext) -> None:
    made = room()
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        gpu.times.clear()
        prepare(ready, dataclasses.replace(made, exposure=2.0), SETTINGS, SIZE)
        assert not {"geometry", "voxelize", "link", "inject", "bounce"} & set(gpu.times)


def test_united_boxes_hold_all() -> None:
    rng = np.random.default_rng(1)
    low = rng.uniform(0.0, 100.0, (77, 3))
    boxes = np.stack([low, low + rng.uniform(0.0, 5.0, (77, 3))], axis=1)
    few = united(boxes, CHANGED_BOXES)
    assert len(few) <= CHANGED_BOXES
    inside = (boxes[:, None, 0] >= few[None, :, 0]).all(-1) & (boxes[:, None, 1] <= few[None, :, 1]).all(-1)
    assert inside.any(axis=1).all()
    assert np.prod(few[:, 1] - few[:, 0], axis=1).sum() < 0.5 * 105.0**3
    assert united(boxes[:0], 4).shape == (0, 2, 3) and np.array_equal(united(boxes[:3], 4), boxes[:3])
    beside = np.array([[[0, 0, 0], [4, 4, 4]], [[1, 0, 0], [5, 4, 4]]], float)
    assert united(beside, 4).tolist() == [[[0, 0, 0], [5, 4, 4]]]


def test_bricks_of_levels() -> None:
    """Those in a box and those that touch them, against places of all bricks."""
    grid = nested(np.array([[-70.0, -60.0, -9.0], [50.0, 90.0, 40.0]]), np.zeros(3), 32, 1.0)
    corners, sides = np.full((*grid.bricks[::-1], 3), np.inf), np.ones((*grid.bricks[::-1], 1))
    for k, level in enumerate(grid.levels):
        z, y, x = np.meshgrid(*(np.arange(size // BRICK) for size in level.size[::-1]), indexing="ij")
        corners[level.bricks] = (np.stack([x, y, z], axis=-1) * BRICK + level.first) * 2.0**k
        sides[level.bricks] = BRICK * 2.0**k
    for low, high in ([(2.0, 2.0, 2.0), (3.0, 3.0, 3.0)], [(14.5, -3.0, 1.0), (17.5, 5.0, 2.0)]):
        marks = bricks_in(np.array([[low, high]]), grid)
        assert (marks == ((corners < high) & (corners + sides > low)).all(axis=-1)).all()
        found, beside = bricks_beside(marks, grid), np.zeros_like(marks)
        for at in np.argwhere(marks):
            corner, side = corners[tuple(at)], sides[tuple(at)]
            near = (np.abs(np.log2(sides / side)) <= 1.0)[..., 0]
            beside |= ((corners <= corner + side) & (corners + sides >= corner)).all(axis=-1) & near
        assert found[beside].all() and found.sum() < 0.35 * np.isfinite(corners[..., 0]).sum()
        around = around_bricks(marks, grid)
        assert (corners[marks] >= around[0]).all() and ((corners + sides)[marks] <= around[1]).all()


def test_bricks_in_boxes() -> None:
    grid = unit_grid((16, 8, 12))
    marks = bricks_in(np.array([[[3.9, 0.0, 4.0], [4.1, 3.9, 4.0]], [[-5.0, 7.0, 11.9], [-1.0, 9.0, 30.0]]]), grid)
    assert {tuple(at[::-1]) for at in np.argwhere(marks).tolist()} == {(0, 0, 1), (1, 0, 1)}


# Drafts: the first picture of an edit, while it goes on ------------------------------------------------------------


def draft(ready: Pipeline, made: SceneData, settings: Settings = SETTINGS) -> np.ndarray:
    """Radiance of faces in a draft."""
    for _ in ready.prepare(made, settings, SIZE, is_draft=True):
        pass
    sample(ready, 1)
    return radiance(ready)


MANY = scenes.settings(40, bounces=256)


def test_a_draft_goes_on_from_the_light_before(gpu: GpuContext) -> None:
    made = room(world=scenes.world((0.4, 0.5, 0.7)))
    moved = placed(made, EDITS["moved"])
    with pipeline(gpu, made, MANY, SIZE, samples=1, is_live=True) as ready:
        whole = ready.voxel_light.bounce.bounces
        found = draft(ready, moved, MANY)
        few = ready.voxel_light.bounce.bounces
        again = draft(ready, moved, MANY)
        assert few == ready.voxel_light.bounce.bounces <= 4 < 8 <= whole
        assert np.array_equal(found, again), "which is there"
        prepare(ready, moved, MANY, SIZE)
        sample(ready, 1)
        exact = radiance(ready)
        assert ready.voxel_light.bounce.bounces >= 8
        assert abs(found.sum() / exact.sum() - 1.0) < 0.01, "no jump in brightness"
        assert np.abs(found - exact).sum() < 0.02 * exact.sum() and not np.array_equal(found, exact)
        assert_same(bits(ready), fresh(gpu, moved, MANY))


def test_a_small_edit_takes_one_bounce(gpu: GpuContext) -> None:
    """Light goes on from what it was, not from what faces made of it when they shared it: that changes all of them."""
    made = placed(room(), {2: turned(0.0, 0.9, 0.4, -0.4, 0.1)})
    moved = placed(made, {2: turned(0.0, 0.8, 0.4, -0.4, 0.1)})
    with pipeline(gpu, made, MANY, SIZE, samples=1, is_live=True) as ready:
        found = draft(ready, moved, MANY)
        assert ready.voxel_light.bounce.bounces == 1
        prepare(ready, moved, MANY, SIZE)
        exact = radiance(ready)
        assert np.abs(found - exact).sum() < 0.003 * exact.sum()


@pytest.mark.parametrize("bounces", [1, 2, 3])
def test_where_bounces_are_limited_a_draft_is_exact(bounces: int, gpu: GpuContext) -> None:
    """Light that went on from other light would have bounced more often."""
    made, settings = room(), MANY.with_values(bounces=bounces)
    with pipeline(gpu, made, settings, SIZE, samples=1, is_live=True) as ready:
        for step in range(1, 3):
            made = placed(made, {2: scenes.at(0.9 - 0.2 * step, 0.4, -0.4)})
            draft(ready, made, settings)
            assert_same(bits(ready), fresh(gpu, made, settings))


def test_drafts_of_bright_rooms_do_not_drift(gpu: GpuContext) -> None:
    """White walls: what one bounce changes by a little, all together change by ten times as much."""
    made = room(ball=scenes.diffuse(0.1))
    materials = tuple(scenes.diffuse(0.9) if k == 0 else one for k, one in enumerate(made.materials))
    made = dataclasses.replace(made, materials=materials)
    with pipeline(gpu, made, MANY, SIZE, samples=1, is_live=True) as ready:
        for step in range(1, 9):
            made = placed(made, {2: scenes.at(0.9 - 0.1 * step, 0.4, -0.4)})
            found = draft(ready, made, MANY)
        prepare(ready, made, MANY, SIZE)
        exact = radiance(ready)
        assert abs(found.sum() / exact.sum() - 1.0) < 0.01
        assert np.abs(found - exact).sum() < 0.02 * exact.sum()


def test_draft_after_draft(gpu: GpuContext) -> None:
    """As while an object is dragged: faces come and go, and never one is dark that is lit."""
    made = room()
    with pipeline(gpu, made, MANY, SIZE, samples=1, is_live=True) as ready:
        for step in range(1, 6):
            moved = placed(made, {2: scenes.at(0.9 - 0.15 * step, 0.4, -0.4 + 0.1 * step)})
            found = draft(ready, moved, MANY)
            with pipeline(gpu, moved, MANY, SIZE, samples=1) as other:
                exact = radiance(other)
            assert np.abs(found - exact).sum() < 0.05 * exact.sum()
            lit = exact.sum(axis=1) > 0.05 * exact.sum(axis=1).mean()
            assert (found[lit].sum(axis=1) > 0.3 * exact[lit].sum(axis=1)).all()
        prepare(ready, moved, MANY, SIZE)
        sample(ready, 1)
        assert_same(bits(ready), fresh(gpu, moved, MANY))


def test_light_follows_its_faces(gpu: GpuContext) -> None:
    bounce = BouncePass(gpu, keeps_light=True)
    stored = np.arange(1, 7001, dtype=np.uint32).reshape(-1, 2)
    bounce._unshared = gpu.buffer("bouncing light", stored)
    before = np.random.default_rng(1).permutation(3500).astype(np.uint32)[:2700]
    before[100:110] = NONE_INDEX
    bounce.renumber(before)
    assert bounce.has_light and bounce._unshared is not None
    found = np.frombuffer(bounce._unshared.read(), np.uint32).reshape(-1, 2)
    assert len(found) == len(before) and not found[100:110].any()
    assert np.array_equal(np.delete(found, range(100, 110), 0), stored[np.delete(before, range(100, 110))])
    bounce.renumber(None)
    assert not bounce.has_light


@pytest.mark.parametrize("edit", ["lamp", "paint", "lamp and place", "another grid", "bounces"])
def test_other_edits_have_no_draft(edit: str, gpu: GpuContext) -> None:
    """Light of a lamp that is out must not stay, and where all faces are new there is none."""
    made, settings = room(), MANY
    changed = placed(made, EDITS["moved"]) if "place" in edit else made
    if "lamp" in edit:
        changed = dataclasses.replace(changed, lights=(dataclasses.replace(LAMP, position=(-0.9, 0.5, 0.7)),))
    if edit == "paint":
        changed = repainted(made, PAINTS["a ball"])
    if edit == "another grid":
        changed = beyond(made)
    if edit == "bounces":
        settings = MANY.with_values(bounces=3)
    with pipeline(gpu, made, MANY, SIZE, samples=1, is_live=True) as ready:
        draft(ready, changed, settings)
        assert_same(bits(ready), fresh(gpu, changed, settings))


def test_what_interrupts_the_bounces_leaves_the_draft(gpu: GpuContext) -> None:
    made = room()
    first, second = placed(made, EDITS["moved"]), placed(made, EDITS["moved far"])
    with pipeline(gpu, made, MANY, SIZE, samples=1, is_live=True) as ready:
        drafted = draft(ready, first, MANY)
        bounce = ready.voxel_light.bounce
        assert bounce._unshared is not None
        unshared = bounce._unshared.read()
        steps = ready.prepare(first, MANY, SIZE)
        while next(steps).text != "Bouncing light":
            pass
        steps.close()
        assert np.array_equal(radiance(ready), drafted)
        assert bounce.has_light and bounce._unshared.read() == unshared
        found = draft(ready, second, MANY)
        with pipeline(gpu, second, MANY, SIZE, samples=1) as other:
            assert np.abs(found - radiance(other)).sum() < 0.1 * radiance(other).sum()
        prepare(ready, second, MANY, SIZE)
        sample(ready, 1)
        assert_same(bits(ready), fresh(gpu, second, MANY))
