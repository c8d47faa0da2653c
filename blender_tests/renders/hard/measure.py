# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders a case with the pipeline, here or moved, and measures its picture."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from addon.gpu.context import GpuContext
from addon.host.extract.scene import SceneReader
from addon.pipeline import Pipeline
from addon.settings import Settings
from blender_tests.pictures import Picture
from blender_tests.scenes import build

from .case import Case

#: Parts of a picture that are compared each: columns, rows.
PARTS = (3, 2)

MOVES = {
    "translation": Matrix.Translation((37.5, -21.25, 11.125)),
    "rotation": Matrix.Rotation(math.radians(17.0), 4, (0.36, 0.48, 0.8)),
    "scale": Matrix.Scale(3.0, 4),
}


def set_up(case: Case, variant: str = "") -> Any:
    """Blender's current scene becomes the case's, moved as ``variant`` says."""
    scene = build.empty_scene()
    case.build()
    scene.render.resolution_x, scene.render.resolution_y = case.size
    bpy.context.view_layer.update()
    place = Matrix.Translation(case.offset) @ Matrix.Scale(case.scale, 4)
    move(scene, place @ MOVES.get(variant, Matrix.Identity(4)))
    return scene


def move(scene: Any, matrix: Matrix) -> None:
    """Moves, turns and scales a whole scene; lamps get brighter with the square of its scale, so it looks the same."""
    scale = matrix.median_scale
    mover = build.add_object("Mover", None)
    mover.matrix_world = matrix
    for thing in list(scene.objects):
        if thing is mover or thing.parent is not None:
            continue
        if thing.type not in ("LIGHT", "CAMERA"):
            thing.parent = mover
            continue
        place, turn, own = (matrix @ thing.matrix_world).decompose()
        thing.matrix_world = Matrix.LocRotScale(place, turn, own / scale)
        if thing.type == "CAMERA":
            thing.data.clip_start, thing.data.clip_end = thing.data.clip_start * scale, thing.data.clip_end * scale
            thing.data.ortho_scale *= scale
        elif thing.data.type != "SUN":
            thing.data.energy *= scale**2
            for name in ("size", "size_y") if thing.data.type == "AREA" else ("shadow_soft_size",):
                setattr(thing.data, name, getattr(thing.data, name) * scale)
    bpy.context.view_layer.update()


def conelight(gpu: GpuContext, case: Case, variant: str = "", **settings: Any) -> Picture:
    """(H, W, 3) linear, row 0 at the top."""
    set_up(case, variant)
    return render_scene(gpu, case, **settings)


def render_scene(gpu: GpuContext, case: Case, **settings: Any) -> Picture:
    """The current scene, as :func:`conelight`."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    scene = SceneReader().read(depsgraph, case.size)
    values = {"voxel_auto": False, "voxel_resolution": case.voxels, "samples": case.samples, **case.settings}
    pipeline = Pipeline(gpu)
    try:
        run(pipeline.prepare(scene, Settings().with_values(**{**values, **settings}), case.size))
        for _ in range(case.samples):
            run(pipeline.sample())
        return pipeline.film.read("combined")[::-1, :, :3].copy()
    finally:
        pipeline.release()


def run(steps: Iterator[Any]) -> None:
    for _ in steps:
        pass


def blender_engine(case: Case, engine: Callable[[], Picture]) -> Picture:
    set_up(case)
    return engine()[..., :3]


def parts(picture: Picture) -> np.ndarray:
    """(1 + parts,) mean of the colours of the whole picture, then of each part."""
    columns, rows = PARTS
    tiles = [
        tile.mean(dtype=np.float64)
        for row in np.array_split(picture, min(rows, picture.shape[0]), axis=0)
        for tile in np.array_split(row, min(columns, picture.shape[1]), axis=1)
    ]
    return np.array([picture.mean(dtype=np.float64), *tiles])


def deviation(found: float, other: float, answer: float | None = None) -> float:
    """How far ``found`` is from ``other``, as a share of it; of 1 W/(m2 sr) where it, or the ``answer``, is 0."""
    return float((found - other) / (1.0 if answer == 0.0 else other or 1.0))


def worst_part(found: np.ndarray, answer: np.ndarray) -> float:
    """Largest deviation of a part, as a share of the whole picture's answer."""
    return float(np.abs(found[1:] - answer[1:]).max() / (answer[0] or 1.0))


def fingerprint(scene: Any) -> str:
    """Says whether a scene is still the one that a stored answer is of: what its builder wrote into Blender."""
    facts: list[Any] = [scene.render.resolution_x, scene.render.resolution_y]
    for thing in sorted(scene.objects, key=lambda thing: thing.name):
        facts.append([thing.name, thing.type, [_rounded(row) for row in thing.matrix_world]])
        data = thing.data
        if thing.type == "MESH":
            points = np.empty(3 * len(data.vertices), np.float32)
            data.vertices.foreach_get("co", points)
            corners = np.empty(len(data.loops), np.int32)
            data.loops.foreach_get("vertex_index", corners)
            facts.append([hashlib.sha256(points.tobytes() + corners.tobytes()).hexdigest(), len(data.polygons)])
            facts.append([material.name for material in data.materials])
        elif thing.type == "LIGHT":
            names = ("energy", "shadow_soft_size", "angle", "size", "size_y", "spot_size", "spot_blend", "shape")
            facts.append([data.type, *_rounded(data.color), *(_plain(getattr(data, name, 0)) for name in names)])
        elif thing.type == "CAMERA":
            facts.append([data.type, *_rounded((data.lens, data.ortho_scale, data.clip_start, data.clip_end))])
    trees = [(material.name, material.node_tree) for material in bpy.data.materials]
    trees += [("world", scene.world.node_tree)] if scene.world else []
    for name, tree in sorted(trees, key=lambda entry: entry[0]):
        for node in list(tree.nodes):
            facts.append([name, node.bl_idname, _set_values(tree, node)])
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16]


def _set_values(tree: Any, node: Any) -> list[Any]:
    """Inputs that are not as they come: each Blender's nodes have some that others lack."""
    fresh = tree.nodes.new(node.bl_idname)
    try:
        ready = {i.identifier: _plain(i.default_value) for i in fresh.inputs if hasattr(i, "default_value")}
        values = {i.identifier: _plain(i.default_value) for i in node.inputs if i.identifier in ready}
        return sorted([name, value] for name, value in values.items() if value != ready[name])
    finally:
        tree.nodes.remove(fresh)


def _plain(value: Any) -> Any:
    if isinstance(value, (str, bool, int)):
        return value
    return _rounded(value) if hasattr(value, "__len__") else _rounded([value])[0]


def _rounded(values: Any) -> list[float]:
    return [float(f"{float(value):.5g}") for value in values]

