# SPDX-License-Identifier: GPL-3.0-or-later
"""Edited scenes: what depends on the edit is made again, and everything has the bits of a fresh start."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.pipeline import Pipeline
from addon.scene import LightKind, SceneData
from addon.settings import Settings
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, prepare, radiance, read_list, read_voxels, sample

SETTINGS = scenes.settings(40, bounces=8)
SIZE = (24, 18)


def room(**more: Any) -> SceneData:
    """A room with a lamp, a sun through its open side, a box on the floor, a ball and a thin sheet."""
    parts = [
        (scenes.box((-2, -2, -1), (2, 2, 1), inside_out=True), scenes.diffuse((0.7, 0.6, 0.5))),
        (scenes.box((-0.4, -0.4, -1.0), (0.2, 0.3, -0.3)), scenes.diffuse((0.2, 0.7, 0.3))),
        (scenes.sphere(0.3, 12), scenes.principled((0.8, 0.3, 0.2), Roughness=0.4)),
        (scenes.plane(0.7), scenes.diffuse(0.5)),
    ]
    lights = (scenes.light(LightKind.POINT, 3.0, (0.9, -1.2, 0.7), radius=0.1),)
    made = scenes.scene(*parts, lights=lights, camera=scenes.camera((0.5, -1.8, 0.2)), **more)
    places = [np.eye(4), np.eye(4), scenes.at(0.9, 0.4, -0.4), scenes.at(-1.1, 0.8, 0.1)]
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
    voxels, geometry = made._voxelize.voxels, made._geometry.geometry
    assert voxels is not None and geometry is not None
    found = read_voxels(voxels, geometry)
    links = made._links.links
    assert links is not None
    count = voxels.faces.count
    kept = {
        "triangles": read_list(geometry.triangles, 3 * geometry.triangle_count, np.uint32).tobytes(),
        "bricks": voxels.bricks.read(),
        "pairs": found.pairs.tobytes(),
        "records": found.records.tobytes(),
        "faces": found.faces.tobytes(),
        "order": read_list(voxels.faces.order, count, np.uint32).tobytes(),
        "links": read_list(links, count * made._links.count // 4, np.uint32).tobytes(),
        "light": radiance(made).tobytes(),
    }
    if voxels.cell_opacities is not None:
        cells = np.repeat(np.arange(len(found.records)), found.records[:, 1])
        opacities = read_list(voxels.cell_opacities, voxels.pair_count, np.uint8)[:, 0]
        kept["opacities"] = opacities[np.lexsort((found.triangles, cells))].tobytes()
    if made._links.straight is not None:
        kept["straight"] = read_list(made._links.straight, count, np.uint32).tobytes()
    return kept | {name: made.film.read(name).tobytes() for name in made.film.names}


def fresh(gpu: GpuContext, made: SceneData, settings: Settings = SETTINGS) -> dict[str, bytes]:
    with pipeline(gpu, made, settings, SIZE, samples=1) as ready:
        return bits(ready)


def assert_same(found: dict[str, bytes], wanted: dict[str, bytes]) -> None:
    assert found.keys() == wanted.keys()
    assert [name for name in wanted if found[name] != wanted[name]] == []


EDITS = {
    "moved": {2: scenes.at(0.7, 0.5, -0.3)},
    "moved far": {2: scenes.at(-1.4, -1.3, 0.5)},
    "into another": {2: scenes.at(-0.1, 0.0, -0.5)},
    "at a wall": {2: scenes.at(1.69, 0.2, 0.1)},
    "turned": {3: turned(0.7, -1.1, 0.8, 0.1)},
    "scaled": {1: turned(0.0, 0.1, 0.2, 0.1, 0.8)},
    "two": {2: scenes.at(0.7, 0.1, 0.3), 3: scenes.at(0.3, 0.8, -0.7)},
}


@pytest.mark.parametrize("edit", EDITS)
def test_a_moved_object_leaves_the_bits_of_a_fresh_start(edit: str, gpu: GpuContext) -> None:
    made = room()
    moved = placed(made, EDITS[edit])
    with pipeline(gpu, made, SETTINGS, SIZE, samples=1, is_live=True) as ready:
        prepare(ready, moved, SETTINGS, SIZE)
        sample(ready, 1)
        assert_same(bits(ready), fresh(gpu, moved))
