# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes by name: how each is built, at what size it is rendered, and what is asked of its picture.

Imports neither Blender nor USD.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
#: Scenes that are files and not part of this project lie here, beside the checkout.
SHARED = ROOT.parent / "shared" / "scenes"

SUN = 5.0  # W/m2, of scenes/rooms.py
#: Where light comes through a door, with 16 bounces Cycles is 1.8 % too dark, and with more than 32 no brighter.
DIM_BOUNCES = 64


@dataclass(frozen=True)
class Recipe:
    """A function that builds a scene: ``path -> None`` writes USD, one without a path leaves it in Blender."""

    module: str
    function: str
    arguments: tuple[tuple[str, Any], ...] = ()

    @property
    def is_usd(self) -> bool:
        return self.module.startswith("conelight_benchmark.scenes.") and not self.module.endswith("_blend")


@dataclass(frozen=True)
class Bar:
    """What a preset is to reach."""

    error: float  # relMSE; of a constant picture the largest deviation; 0: any
    bias: float


@dataclass(frozen=True)
class Motion:
    """A moving camera: over all frames it travels along its own axes (right, up, back; metres) and turns to the left
    (degrees about the vertical)."""

    travel: tuple[float, float, float]
    turn: float


@dataclass(frozen=True, eq=False)
class BenchmarkScene:
    """``measure``: ``indirect`` or ``full``, the picture that the bars are about; ``constant``: every pixel must be
    ``expected``; ``dark``: every pixel must be black, given ``irradiance`` (W/m2) outside."""

    name: str
    recipe: Recipe
    measure: str = "full"
    size: tuple[int, int] = (256, 192)
    voxels: int | None = None  # along the longest side; None: as the preset chooses
    has_lamps: bool = False
    has_surroundings: bool = False  # a lit world or surfaces that glow
    expected: float = 0.0
    irradiance: float = 0.0
    reference_samples: int = 512  # of each half
    bounces: int = 0  # of Cycles, where as many as on the command line are too few; else 0
    bars: dict[str, Bar] = field(default_factory=dict)
    needs: Path | None = None  # a file that may be missing

    @property
    def has_reference(self) -> bool:
        return self.measure in ("indirect", "full")


def _recipe(module: str, function: str, **arguments: Any) -> Recipe:
    package = "blender_tests.scenes" if module in ("cornell", "sky_sphere", "furnace") else "conelight_benchmark.scenes"
    return Recipe(f"{package}.{module}", function, tuple(sorted(arguments.items())))


def _bars(balanced: tuple[float, float], final: tuple[float, float]) -> dict[str, Bar]:
    return {"balanced": Bar(*balanced), "final": Bar(*final)}


def _scenes() -> Iterator[BenchmarkScene]:
    yield BenchmarkScene("cornell_area", _recipe("cornell", "scene", lamp="area"), "indirect", has_lamps=True,
                         bars=_bars((0.008, 0.03), (0.003, 0.015)))
    yield BenchmarkScene("cornell_point", _recipe("cornell", "scene", lamp="point"), "indirect", has_lamps=True,
                         bars=_bars((0.012, 0.03), (0.006, 0.015)))
    yield BenchmarkScene("cornell_emitter", _recipe("cornell", "scene", lamp="emitter"), "indirect",
                         has_surroundings=True, bars=_bars((0.03, 0.04), (0.01, 0.02)))
    resolution = 128
    for thick in (1, 2):
        yield BenchmarkScene(
            f"rooms_open_{thick}", _recipe("rooms", "two_rooms", door_open=True, voxels_thick=thick,
                                           resolution=resolution),
            "indirect", voxels=resolution, has_lamps=True, reference_samples=1024, bounces=DIM_BOUNCES,
            bars=_bars((0.10, 0.08), (0.03, 0.04)),
        )
        yield BenchmarkScene(
            f"rooms_closed_{thick}", _recipe("rooms", "two_rooms", door_open=False, voxels_thick=thick,
                                             resolution=resolution),
            "dark", voxels=resolution, has_lamps=True, irradiance=SUN, bars={"balanced": Bar(0.0, 0.001)},
        )
    for name, wall, leak in (("leak_1", 1.0, 0.001), ("leak_quarter", 0.25, 0.01)):
        yield BenchmarkScene(
            name, _recipe("rooms", "closed_room", voxels_thick=wall, resolution=resolution), "dark",
            voxels=resolution, has_lamps=True, irradiance=SUN, bars={"balanced": Bar(0.0, leak)},
        )
    yield BenchmarkScene("interior", _recipe("rooms", "interior"), "indirect", has_lamps=True, has_surroundings=True,
                         bars=_bars((0.03, 0.04), (0.01, 0.02)))
    yield BenchmarkScene("sky_sphere", _recipe("sky_sphere", "scene"), "indirect", has_surroundings=True,
                         bars=_bars((0.008, 0.03), (0.003, 0.015)))
    yield BenchmarkScene("hdri_sphere", _recipe("sky", "sphere_under_picture"), "indirect", has_surroundings=True)
    yield BenchmarkScene("spheres", _recipe("reflections", "spheres"), has_lamps=True, has_surroundings=True,
                         bars=_bars((0.05, 0.04), (0.02, 0.02)))
    yield BenchmarkScene("foliage", _recipe("foliage", "cards"), has_lamps=True, has_surroundings=True)
    yield BenchmarkScene("glass", _recipe("glass_blend", "glass"), has_lamps=True, has_surroundings=True)
    yield BenchmarkScene("strips", _recipe("strips", "strips"), "indirect", has_surroundings=True)
    yield BenchmarkScene("atrium", _recipe("files_blend", "atrium"), size=(640, 360), voxels=256, has_lamps=True,
                         reference_samples=128, bars=_bars((0.03, 0.03), (0.012, 0.02)),
                         needs=SHARED / "atrium" / "atrium.blend")
    yield BenchmarkScene("living_room", _recipe("files_blend", "living_room"), has_lamps=True, has_surroundings=True,
                         size=(320, 180), needs=SHARED / "living_room" / "living_room.blend")
    for tilt in (0, 15, 30, 45):
        yield BenchmarkScene(f"plane_{tilt}", _recipe("sky", "tilted_plane", tilt=float(tilt)), "constant",
                             size=(64, 48), has_surroundings=True, expected=0.8,
                             bars={name: Bar(0.0, 0.01) for name in ("balanced", "final")})
    within = {"draft": Bar(0.0, 0.005), "balanced": Bar(0.0, 0.005), "final": Bar(0.05, 0.005)}
    furnaces: list[tuple[str, dict[str, Any]]] = [
        (f"furnace_{shape}_{albedo:g}", {"albedo": albedo, "shape": shape})
        for shape in ("box", "sphere") for albedo in (0.2, 0.5, 0.8, 0.95)
    ]
    furnaces += [
        ("furnace_tiny", {"albedo": 0.8, "size": 2.0 * 0.004}),
        ("furnace_huge", {"albedo": 0.8, "size": 2.0 * 2500}),
        ("furnace_far", {"albedo": 0.8, "centre": (5000.0, 0.0, 0.0)}),
    ]
    for name, arguments in furnaces:
        yield BenchmarkScene(name, _recipe("furnace", "scene", **arguments), "constant", size=(64, 48),
                             has_surroundings=True, expected=1.0, bars=within)


SCENES: dict[str, BenchmarkScene] = {scene.name: scene for scene in _scenes()}

FRAMES = 24
SEQUENCE_SIZE = (240, 136)
SEQUENCE_REFERENCE_SAMPLES = 64  # of each half, a frame

MOTIONS: dict[str, Motion] = {
    "interior": Motion((-0.6, 0.0, -0.5), -12.0),
    "rooms_open_1": Motion((0.5, 0.0, -0.6), 10.0),
    "atrium": Motion((0.6, 0.0, -1.5), 8.0),
}

QUICK_SCENES = ("cornell_area", "rooms_closed_1", "sky_sphere", "furnace_box_0.8")
QUICK_SIZE = (64, 48)
QUICK_REFERENCE_SAMPLES = 128
