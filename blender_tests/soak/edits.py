# SPDX-License-Identifier: GPL-3.0-or-later
"""Random edits of a scene in a viewport, on a GL context of our own: each is worked on a little before the next."""

from __future__ import annotations

import dataclasses
import random

import numpy as np

from addon.gpu.context import GpuContext
from addon.pipeline import Pipeline
from addon.progressive import Progressive, Target
from addon.scene import LightKind, SceneData
from addon.settings import Settings
from blender_tests.passes import scenes

from .measure import Record, gl_objects, resident_bytes

#: Edits between two times when everything is let go of, and nothing may be left but compiled programs.
CHECK_INTERVAL = 25
COMPILED = ("Program", "Shader")

SURFACES = (
    scenes.diffuse(0.7), scenes.diffuse((0.6, 0.1, 0.1)), scenes.principled(0.6, Roughness=0.2), scenes.emission(),
)  # fmt: skip
SHAPES = (scenes.box((-0.3,) * 3, (0.3,) * 3), scenes.sphere(0.4, 6), scenes.sphere(0.4, 12), scenes.plane(0.6))
SIZES = ((16, 12), (24, 16))


def run(count: int, seed: int = 0) -> Record:
    """Makes ``count`` edits."""
    record, chance, gpu = Record(), random.Random(seed), GpuContext.standalone()
    pipeline, scene = Pipeline(gpu), scenes.cornell()
    settings = scenes.settings(16, bounces=2, samples=2, rays=1)
    shown = Progressive(pipeline)
    for number in range(1, count + 1):
        scene, settings = edited(scene, settings, chance)
        target = Target(scene, settings, chance.choice(SIZES))
        for _ in range(chance.choice((1, 2, 5, 100))):  # slices; with the last, until it is done
            shown.work(target, 1e-6)
        if shown.status(target).is_done:
            assert np.isfinite(pipeline.film.read("combined")).all()
        record.memory.append(resident_bytes())
        record.programs.append(gpu.program_count)
        if number % CHECK_INTERVAL == 0:
            shown.stop()
            pipeline.release()
            record.objects.append({kind: left for kind, left in gl_objects().items() if kind not in COMPILED})
            assert gpu.memory == {}, gpu.memory
    shown.stop()
    pipeline.release()
    gpu.release()
    return record


def edited(scene: SceneData, settings: Settings, chance: random.Random) -> tuple[SceneData, Settings]:
    """One edit: of the view, an object's place, material or mesh, a light, the world, or a setting."""
    kind = chance.choice(("view", "view", "place", "material", "mesh", "light", "world", "setting"))
    if kind == "view":
        place = [chance.uniform(-0.5, 0.5), -4.0 + chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5)]
        return dataclasses.replace(scene, camera=scenes.camera(place, (0.0, 0.0, 0.0), angle=0.75)), settings
    if kind == "place":
        *others, last = scene.instances
        moved = scenes.at(chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5), -0.6)
        return dataclasses.replace(
            scene, instances=(*others, dataclasses.replace(last, world_from_object=moved))
        ), settings
    if kind == "material":
        return dataclasses.replace(scene, materials=(*scene.materials[:-1], chance.choice(SURFACES))), settings
    if kind == "mesh":
        return dataclasses.replace(scene, meshes=(*scene.meshes[:-1], chance.choice(SHAPES))), settings
    if kind == "light":
        kinds = chance.sample((LightKind.POINT, LightKind.SUN), chance.randrange(3))
        lights = [scenes.light(kind, chance.uniform(1.0, 5.0), (0.3, -0.2, 0.5)) for kind in kinds]
        return dataclasses.replace(scene, lights=tuple(lights)), settings
    if kind == "world":
        world = chance.choice((None, scenes.world(chance.uniform(0.1, 1.0))))
        return dataclasses.replace(scene, world=world), settings
    return scene, settings.with_values(bounces=chance.choice((0, 2)), seed=chance.randrange(100))
