# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/benchmark: its scenes are built and are what the catalogue says, and a run goes on where it was."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("pxr")
pytest.importorskip("matplotlib")
from conelight_benchmark import arguments, main, numbers  # noqa: E402
from conelight_benchmark.catalogue import SCENES, SUN, BenchmarkScene  # noqa: E402
from conelight_benchmark.job import Job  # noqa: E402
from conelight_benchmark.scenes.sky import PLANE_ALBEDO  # noqa: E402
from conelight_benchmark.store import Store  # noqa: E402
from conelight_cli import scene as scene_files  # noqa: E402

from blender_tests.scenes import rendering  # noqa: E402

#: One scene for each function that builds some.
BUILDERS = {(scene.recipe.module, scene.recipe.function): name for name, scene in reversed(SCENES.items())}


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return Store(tmp_path_factory.mktemp("cache"))


def opened(store: Store, name: str) -> Any:
    """The scene in this process, with its camera set."""
    scene = SCENES[name]
    if scene.needs is not None and not scene.needs.is_file():
        pytest.skip(f"{scene.needs} is not here")
    main.build(store, scene)
    result = scene_files.load(str(store.scene_file(scene)))
    result.camera = result.camera or next(thing for thing in result.objects if thing.type == "CAMERA")
    result.render.resolution_percentage = 100
    return result


def has_glow(material: Any) -> bool:
    names = {"ShaderNodeBsdfPrincipled": ("Emission Color", "Emission Strength"),
             "ShaderNodeEmission": ("Color", "Strength")}
    for node in material.node_tree.nodes:
        if node.bl_idname in names:
            color, strength = (node.inputs[name].default_value for name in names[node.bl_idname])
            if strength * max(color[:3]) > 0:
                return True
    return False


def world_is_lit(world: Any) -> bool:
    return world is not None and any(
        node.bl_idname == "ShaderNodeBackground" and node.inputs["Strength"].default_value > 0
        and (node.inputs["Color"].is_linked or max(node.inputs["Color"].default_value[:3]) > 0)
        for node in world.node_tree.nodes
    )


@pytest.mark.parametrize("name", sorted(BUILDERS.values()))
def test_scene(kept: Store, name: str) -> None:
    """It is built, has the kinds of light that its entry says, and both engines show something of it."""
    scene = opened(kept, name)
    entry: BenchmarkScene = SCENES[name]
    assert any(thing.type == "LIGHT" for thing in scene.objects) == entry.has_lamps
    materials = {slot.material for thing in scene.objects for slot in thing.material_slots if slot.material}
    assert (world_is_lit(scene.world) or any(map(has_glow, materials))) == entry.has_surroundings
    if entry.needs is None:  # files are too large for a small test
        pictures = [rendering.cycles((16, 12), samples=16), rendering.conelight((16, 12), voxels=24, samples=1)]
        assert all(np.isfinite(picture).all() for picture in pictures)
        assert entry.measure == "dark" or all(picture[..., :3].max() > 0 for picture in pictures)


def test_sun_is_as_strong_as_its_number(kept: Store) -> None:
    suns = [thing.data for thing in opened(kept, "leak_1").objects if thing.type == "LIGHT"]
    assert [sun.energy for sun in suns] == pytest.approx([SUN])


def test_walls_are_flat(kept: Store) -> None:
    """Corners of a room have the normals of their faces: nothing is shaded over an edge."""
    for thing in opened(kept, "rooms_open_1").objects:
        if thing.type == "MESH":
            for face in thing.data.polygons:
                for corner in face.loop_indices:
                    assert thing.data.corner_normals[corner].vector.dot(face.normal) == pytest.approx(1.0, abs=1e-4)


def test_closed_room_is_dark_and_plane_is_as_bright_as_its_albedo(kept: Store) -> None:
    opened(kept, "rooms_closed_1")
    assert not rendering.cycles((16, 12), samples=16)[..., :3].any()
    opened(kept, "plane_30")
    assert rendering.cycles((16, 12), samples=64)[..., :3] == pytest.approx(PLANE_ALBEDO, rel=1e-3)


def test_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One scene from end to end; again, nothing is rendered; and the parts of a picture are what they say."""
    texts = ["--scenes", "cornell_area", "--peers", "conelight-draft", "cycles-4", "cycles-1-oidn-fast", "--only",
             "stills", "--resolution", "32x24", "--reference-samples", "64", "--cache", str(tmp_path / "cache"),
             "--output", str(tmp_path / "report")]
    options = arguments.parse(texts, str(tmp_path))
    assert main.main(options) == 0
    (entry,) = json.loads((tmp_path / "report" / "report.json").read_text())["scenes"]
    assert {row["peer"] for row in entry["stills"]} == {"conelight-draft", "cycles-4", "cycles-1-oidn-fast"}
    for row in entry["stills"]:
        assert row["cpu_ms"] > 0 and row["peak_rss"] > 0
        assert abs(row["full"]["bias"]) < 0.2
    own = numbers.find(entry, "conelight-draft")
    assert own is not None and 0 < own["preparation_cpu_ms"] < own["cpu_ms"]
    assert abs(own["indirect"]["bias"]) < 0.15
    text = (tmp_path / "report" / "report.md").read_text()
    assert all((tmp_path / "report" / name).is_file() and name in text for name in entry["pictures"])

    monkeypatch.setattr(main, "run_child", lambda *_: pytest.fail("something was rendered again"))
    assert main.main(options) == 0


def test_a_job_that_fails_costs_no_other(kept: Store) -> None:
    scene = SCENES["furnace_box_0.2"]
    main.build(kept, scene)
    small = (("voxel_auto", "off"), ("voxel_resolution", "16"))
    jobs = [Job("conelight", (16, 12), 1, preset, small) for preset in ("draft", "none of these", "balanced")]
    with main.tqdm(disable=True) as bar:
        failures = main.render(kept, scene, jobs, bar)
    assert len(failures) == 1 and "none of these" in failures[0]
    assert [kept.result(scene, job) is not None for job in jobs] == [True, False, True]


def test_a_moving_camera(kept: Store) -> None:
    """Frames differ, and each has its time."""
    from conelight_benchmark.catalogue import Motion

    scene = SCENES["cornell_area"]
    main.build(kept, scene)
    job = Job("cycles", (16, 12), 4, frames=3, motion=Motion((0.5, 0.0, -1.0), 5.0))
    with main.tqdm(disable=True) as bar:
        assert main.render(kept, scene, [job], bar) == []
    result = kept.result(scene, job)
    assert result is not None and len(result.info["each"]) == 3
    pictures = [result.picture(frame=i) for i in range(3)]
    assert abs(pictures[0] - pictures[1]).max() > 0.01 < abs(pictures[1] - pictures[2]).max()
