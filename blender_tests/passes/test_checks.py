# SPDX-License-Identifier: GPL-3.0-or-later
"""Debug checks find what is wrong, and say where; sound scenes pass them, and look the same."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from addon.checks import CheckError
from addon.gpu.context import GpuContext
from addon.gpu.interface import FACING_SHIFT, LINK_BIN_SHIFT
from addon.passes.bounce import BouncePass
from addon.passes.compose import Film
from addon.passes.direct import DirectPass
from addon.passes.gather import GatherPass
from addon.passes.geometry import GeometryPass
from addon.passes.inject import InjectPass
from addon.passes.link import LinkPass
from addon.passes.reflect import ReflectPass
from addon.passes.surface import SurfacePass
from addon.passes.voxelize import VoxelizePass
from addon.pipeline import Pipeline
from addon.scene import LightKind, SceneData
from addon.settings import Settings
from blender_tests.passes import run, scenes

SETTINGS = Settings(voxel_auto=False, voxel_resolution=16, samples=1, bounces=4, debug_checks=True)
SIZE = (8, 8)


def _scene() -> SceneData:
    """A glossy room with a lamp, a glowing box and a sky: all passes run."""
    return scenes.scene(
        (scenes.box((-2, -2, -2), (2, 2, 2), inside_out=True), scenes.principled(0.5, Roughness=0.3)),
        (scenes.box(), scenes.glowing(0.5, 1.0)),
        lights=(scenes.light(LightKind.POINT, 5.0, (1.5, 1.5, 1.5)),),
        world=scenes.world(0.5), camera=scenes.camera((1.7, -1.7, 1.2)),
    )  # fmt: skip


def _spoil_words(texture: Any, index: int, component: int, word: int) -> None:
    """Overwrites one word of a list or picture of 32-bit numbers."""
    words = np.frombuffer(texture.read(), np.uint32).copy()
    words[index * texture.components + component] = word
    texture.write(words.tobytes())


NAN = 0x7FC00000
MINUS_ONE = 0xBF800000
INFINITE = 0x7F800000

#: Pass class -> what it is given wrong when it has run, and what the error says.
FAULTS: dict[str, tuple[type, Callable[[Any], None], str]] = {
    "triangle": (
        GeometryPass, lambda p: _spoil_words(p.geometry.triangles, 3, 0, NAN), r'"geometry", triangles .* \(1, 0, 0\)'),
    "triangle far away": (
        GeometryPass, lambda p: _spoil_words(p.geometry.triangles, 0, 1, 0x47C35000), "100000 is outside the grid"),
    "brick": (VoxelizePass, lambda p: _spoil_words(p.voxels.bricks, 0, 2, 7), r'"voxelize", bricks, .* entry 0: 7'),
    "marks": (VoxelizePass, lambda p: _spoil_words(p.voxels.bricks, 0, 0, 0), '"voxelize", bricks'),
    "cell": (VoxelizePass, lambda p: _spoil_words(p.voxels.cells, 5, 0, 1), r'"voxelize", cells, .* entry 5: 1'),
    "cell's list": (
        VoxelizePass, lambda p: _spoil_words(p.voxels.cell_triangles, 9, 0, 99), "entry 9: 99 is no triangle"),
    "cell's faces": (VoxelizePass, lambda p: _spoil_words(p.voxels.cells, 3, 2, 0), "first faces, entry 3"),
    "face's place": (VoxelizePass, lambda p: _spoil_words(p.voxels.faces.place, 4, 1, NAN), r"places .* \(4, 1\)"),
    "face's order": (VoxelizePass, lambda p: _spoil_words(p.voxels.faces.order, 4, 0, 5), "order of faces"),
    "face's facing": (
        VoxelizePass, lambda p: _spoil_words(p.voxels.faces.order, 4, 0, 6 << FACING_SHIFT), "facings in the order"),
    "link's bin": (
        LinkPass, lambda p: _spoil_words(p.links, 0, 3, 64 << LINK_BIN_SHIFT), r"bins of links .* \(0, 3\): 64"),
    "link": (LinkPass, lambda p: _spoil_words(p.links, 0, 3, 1 << 24), r'"link", links .* entry \(0, 3\)'),
    "straight light": (LinkPass, lambda p: _spoil_words(p.straight, 2, 1, 0xFFFFFFFF), '"link", straight light'),
    "irradiance": (InjectPass, lambda p: _spoil_words(p.irradiance, 2, 1, 0), '"inject", irradiance of faces, entry 2'),
    "light out of nothing": (
        BouncePass, lambda p: _spoil_words(p.radiance, 6, 1, 200 << 22 | 0xFFFF), r"\(6, 0\): .* more than light"),
    "position": (SurfacePass, lambda p: _spoil_words(p.pictures.position, 9, 0, NAN), r'"surface", positions'),
    "emission": (SurfacePass, lambda p: _spoil_words(p.pictures.emission, 9, 2, MINUS_ONE), '"surface", emission'),
    "direct light": (
        DirectPass, lambda p: _spoil_words(p.diffuse, 9, 0, INFINITE), r'"direct", diffuse .* \(1, 1, 0\)'),
    "reflections": (ReflectPass, lambda p: _spoil_words(p.radiance, 9, 0, NAN), '"reflect", reflected light'),
    "gathered light": (GatherPass, lambda p: _spoil_words(p.incoming, 0, 1, NAN), '"gather", incoming light'),
}  # fmt: skip


def _after(monkeypatch: pytest.MonkeyPatch, kind: type, fault: Callable[[Any], None]) -> None:
    """Lets ``fault`` change what passes of a kind have made."""
    original = kind.run  # type: ignore[attr-defined]

    def spoilt(self: Any, *given: Any, **more: Any) -> Any:
        result = original(self, *given, **more)
        if kind is GeometryPass:
            fault(self)
            return result
        return steps(self, result)

    def steps(self: Any, made: Any) -> Any:
        yield from made
        fault(self)

    monkeypatch.setattr(kind, "run", spoilt)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named(name: str, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    kind, fault, message = FAULTS[name]
    _after(monkeypatch, kind, fault)
    # Shared light comes from what was gathered: without it the fault is where it was made.
    settings = SETTINGS.with_values(use_reconstruction=False)
    with pytest.raises(CheckError, match=message), run.pipeline(gpu, _scene(), settings, SIZE):
        pass


def test_a_fault_of_the_film_is_named(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    add = Film.add

    def spoilt(self: Film, *given: Any) -> None:
        add(self, *given)
        _spoil_words(self._means["combined"], 10, 3, NAN)

    monkeypatch.setattr(Film, "add", spoilt)
    with pytest.raises(CheckError, match=r'"film", combined, entry \(1, 2, 3\): nan is not finite'):
        with run.pipeline(gpu, _scene(), SETTINGS, SIZE):
            pass


def test_a_sound_scene_passes_and_looks_the_same(gpu: GpuContext) -> None:
    pictures = []
    for checks in (True, False):
        settings = dataclasses.replace(SETTINGS, debug_checks=checks, samples=2)
        with run.pipeline(gpu, _scene(), settings, SIZE, outputs=("diffuse_indirect", "normal")) as made:
            pictures.append(made.film.read("combined"))
    assert pictures[0][..., :3].mean() > 0.1
    np.testing.assert_array_equal(*pictures)


def test_off_nothing_is_read(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()  # all tests may run with checks: blender_tests/conftest.py
    from addon import checks

    for name in [name for name in vars(checks) if name.startswith("check_")]:
        monkeypatch.setattr(checks, name, lambda *_: pytest.fail("a check ran"))
    with run.pipeline(gpu, _scene(), SETTINGS.with_values(debug_checks=False), SIZE) as made:
        assert isinstance(made, Pipeline)
