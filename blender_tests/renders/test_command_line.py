# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/render from outside, as a user runs it, mostly with Cycles; and its framing, on numbers."""

from __future__ import annotations

import json
import math
import os
import pathlib
import subprocess
import sys
import textwrap

import numpy as np
import OpenImageIO as oiio
import pytest

from addon.settings import preset

ROOT = pathlib.Path(__file__).parents[2]
RENDER = ROOT / "scripts" / "render"
SMALL = ["--resolution", "32x18", "--samples", "2"]
CYCLES = ["--engine", "cycles", *SMALL]

HAS_ENGINE = (ROOT / "addon" / "host" / "engine.py").exists()
needs_engine = pytest.mark.skipif(not HAS_ENGINE, reason="the engine is not there")

QUAD = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nvn 0 1 0\nf 4//1 3//1 2//1 1//1\n"  # a floor of 2 m, y up


def render(
    *arguments: str | pathlib.Path, folder: pathlib.Path, environ: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Runs the command line in ``folder``."""
    return subprocess.run(
        [sys.executable, str(RENDER), *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=240,
        env={**os.environ, **(environ or {})}, check=False,
    )


def succeed(*arguments: str | pathlib.Path, folder: pathlib.Path) -> str:
    """What the command line says; it must have rendered, and without a traceback."""
    result = render(*arguments, folder=folder)
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    return result.stderr


def refuse(*arguments: str | pathlib.Path, folder: pathlib.Path, status: int = 1) -> str:
    """What the command line says; it must have failed in one line."""
    result = render(*arguments, folder=folder)
    assert result.returncode == status, result.stderr
    assert "Traceback" not in result.stderr
    assert len(result.stderr.splitlines()) == 1, result.stderr
    return result.stderr


def make_blend(path: pathlib.Path, text: str) -> pathlib.Path:
    """A .blend made from an empty one by some lines of Python."""
    code = "import bpy, os, sys\nbpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)\n"
    code += textwrap.dedent(text)
    code += f"\nbpy.ops.wm.save_as_mainfile(filepath={str(path)!r})\nsys.stdout.flush()\nos._exit(0)\n"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120, stdout=subprocess.DEVNULL)
    assert path.exists()
    return path


def pixels(path: pathlib.Path) -> np.ndarray:
    buffer = oiio.ImageBuf(str(path))
    assert not buffer.has_error, buffer.geterror()
    return np.asarray(buffer.get_pixels(oiio.FLOAT))


def channels(path: pathlib.Path) -> set[str]:
    """Names of all channels in all parts of an EXR."""
    picture = oiio.ImageInput.open(str(path))
    names: set[str] = set()
    part = 0
    while picture.seek_subimage(part, 0):
        names.update(picture.spec().channelnames)
        part += 1
    picture.close()
    return names


@pytest.fixture(scope="module")
def lit_blend(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """A white floor under a world of radiance 0.18, two cameras, two view layers."""
    return make_blend(tmp_path_factory.mktemp("blend") / "lit.blend", """
        scene = bpy.context.scene
        bpy.ops.mesh.primitive_plane_add(size=200)
        world = scene.world = bpy.data.worlds.new("Grey")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.18, 0.18, 0.18, 1)
        for name, tilt in (("Down", 0.0), ("Up", 3.14159265)):
            camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
            camera.location = (0, 0, 2)
            camera.rotation_euler = (tilt, 0, 0)
            scene.collection.objects.link(camera)
        scene.camera = bpy.data.objects["Up"]
        scene.view_layers[0].name = "Main"
        scene.view_layers.new("Other")
        scene.view_settings.view_transform = "Standard"
    """)


# Pictures


def test_exr_is_linear_and_png_goes_through_the_view_transform(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    succeed(lit_blend, *CYCLES, "-o", "sky.exr", folder=tmp_path)
    succeed(lit_blend, *CYCLES, folder=tmp_path)
    assert np.allclose(pixels(tmp_path / "sky.exr")[..., :3], 0.18, atol=1e-6)
    srgb = 1.055 * 0.18 ** (1 / 2.4) - 0.055
    assert np.allclose(pixels(tmp_path / "lit.png")[..., :3], srgb, atol=1.5 / 255)
    assert pixels(tmp_path / "lit.png").shape == (18, 32, 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lit.png", "sky.exr"], "temporary files are left"


def test_nothing_temporary_is_left(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    environ = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(temporary))
    result = render(lit_blend, *CYCLES, "-o", "a.png", folder=tmp_path, environ=environ)
    assert result.returncode == 0, result.stderr
    assert list(temporary.iterdir()) == []


def test_statistics_of_cycles(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    succeed(lit_blend, *CYCLES, "-o", "a.png", "--stats", "s.json", folder=tmp_path)
    stats = json.loads((tmp_path / "s.json").read_text())
    assert stats["resolution"] == [32, 18]
    assert stats["samples"] == 2
    assert stats["renderer"] == "cycles"
    assert stats["blender"][:3] in ("4.5", "5.2")
    assert [entry["name"] for entry in stats["passes"]] == ["render"]
    assert 0 < stats["passes"][0]["cpu_ms"] < 1e6
    assert 0 < stats["first_frame_ms"] <= stats["wall_ms"]
    assert stats["warnings"] == []


def test_a_camera_is_chosen_by_name(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    succeed(lit_blend, *CYCLES, "--camera", "Down", "-o", "floor.exr", folder=tmp_path)
    floor = pixels(tmp_path / "floor.exr")[..., :3].mean()
    assert floor == pytest.approx(0.8 * 0.18, rel=0.02)  # Blender's default grey reflects 0.8


def test_frames_have_numbers(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    succeed(lit_blend, *CYCLES, "--frames", "3-4", "-o", "out/a.png", folder=tmp_path)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a_0003.png", "a_0004.png"]


@pytest.fixture(scope="module")
def moving_blend(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """A lit cube; the camera moves until it is infinitely far away in frame 4."""
    return make_blend(tmp_path_factory.mktemp("blend") / "moving.blend", """
        bpy.ops.mesh.primitive_cube_add()
        bpy.ops.object.light_add(type="SUN")
        bpy.ops.object.camera_add(location=(0, 0, 5))
        camera = bpy.context.scene.camera = bpy.context.object
        for frame, x in ((1, 0.0), (3, 1.0)):
            camera.location.x = x
            camera.keyframe_insert("location", frame=frame)
        bpy.ops.object.empty_add()
        camera.parent = bpy.context.object
        for frame, scale in ((3, 1.0), (4, 1e38)):
            camera.parent.scale = (scale, scale, scale)
            camera.parent.keyframe_insert("scale", frame=frame)
    """)


@needs_engine
def test_frames_share_what_does_not_change(moving_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    options = [moving_blend, *SMALL, "--voxels", "16"]
    for frames in ("1-3", "2"):
        succeed(*options, "--frames", frames, "-o", f"{frames}/a.exr", "--stats", f"{frames}.json", folder=tmp_path)
    calls = [
        {entry["name"]: entry["calls"] for entry in json.loads((tmp_path / name).read_text())["passes"]}
        for name in ("1-3.json", "2.json")
    ]
    for name in ("materials", "geometry", "voxelize", "compile"):
        assert calls[0][name] == calls[1][name], name
    assert calls[0]["visibility"] == 3 * calls[1]["visibility"]
    names = ["a_0001.exr", "a_0002.exr", "a_0003.exr"]
    assert sorted(path.name for path in (tmp_path / "1-3").iterdir()) == names
    assert np.array_equal(pixels(tmp_path / "1-3" / names[1]), pixels(tmp_path / "2" / names[1]))
    assert not np.array_equal(pixels(tmp_path / "1-3" / names[0]), pixels(tmp_path / "1-3" / names[1]))


@needs_engine
def test_frames_end_with_the_first_that_fails(moving_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    result = render(moving_blend, *SMALL, "--voxels", "16", "--frames", "3-5", "-o", "a.exr", folder=tmp_path)
    assert result.returncode == 1 and "Traceback" not in result.stderr
    assert [line.split(":")[0] for line in result.stderr.splitlines()] == ["wrote a_0003.exr", "render"]
    assert "position or rotation is not a number" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a_0003.exr"]


def test_a_frame_that_cannot_be_written_is_named(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    (tmp_path / "a_0004.png").mkdir()
    result = render(lit_blend, *CYCLES, "--frames", "3-5", "-o", "a.png", folder=tmp_path)
    assert result.returncode == 1 and "output 'a_0004.png' could not be written" in result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a_0003.png", "a_0004.png"]


def test_one_view_layer_with_all_its_passes(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    succeed(lit_blend, *CYCLES, "--view-layer", "Other", "--passes", folder=tmp_path)
    names = channels(tmp_path / "lit.exr")
    assert {"Other.Combined.R", "Other.Normal.X"} <= names
    assert any(name.startswith("Other.Depth.") for name in names)
    assert not any(name.startswith("Main") for name in names)


@needs_engine
def test_the_engine_renders_a_picture(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    options = [*SMALL, "--voxels", "16", "--set", "bounces=1"]
    succeed(lit_blend, *options, "-o", "a.exr", "--stats", "s.json", folder=tmp_path)
    picture = pixels(tmp_path / "a.exr")
    assert np.isfinite(picture).all()
    assert np.allclose(picture[..., :3], 0.18, atol=1e-3)
    stats = json.loads((tmp_path / "s.json").read_text())
    assert stats["samples"] == 2
    assert stats["bounces"] <= 1
    assert max(stats["voxels"]) <= 16


@needs_engine
def test_settings_in_a_blend_count_until_a_preset_is_asked_for(tmp_path: pathlib.Path) -> None:
    blend = make_blend(tmp_path / "stored.blend", f"""
        sys.path.insert(0, {str(ROOT)!r})
        import addon
        addon.register()
        bpy.context.scene.conelight.samples = 3
        bpy.ops.mesh.primitive_cube_add()
    """)
    arguments = [blend, "--resolution", "16x16", "--voxels", "16", "--stats", "s.json"]
    succeed(*arguments, folder=tmp_path)
    assert json.loads((tmp_path / "s.json").read_text())["samples"] == 3
    succeed(*arguments, "--preset", "draft", folder=tmp_path)
    assert json.loads((tmp_path / "s.json").read_text())["samples"] == preset("draft").samples != 3


# Files without camera or light


def test_what_is_missing_is_made_and_said(tmp_path: pathlib.Path) -> None:
    (tmp_path / "quad.obj").write_text(QUAD)
    said = succeed("quad.obj", *CYCLES, "-o", "a.exr", "--stats", "s.json", folder=tmp_path)
    assert "'quad.obj' has no camera" in said
    assert "'quad.obj' has no light: a neutral white world of strength 1 lights it" in said
    picture = pixels(tmp_path / "a.exr")[..., :3]
    assert np.isclose(picture, 1.0, atol=1e-3).any(axis=2).sum() > 50, "the world is seen beside the floor"
    assert np.isclose(picture, 0.8, atol=0.02).all(axis=2).sum() > 50, "the floor is seen and lit"
    assert len(json.loads((tmp_path / "s.json").read_text())["warnings"]) == 2


def test_usd_and_gltf_come_in(tmp_path: pathlib.Path) -> None:
    make_blend(tmp_path / "source.blend", f"""
        bpy.ops.mesh.primitive_plane_add(size=2)
        bpy.ops.wm.usd_export(filepath={str(tmp_path / "a.usda")!r})
        bpy.ops.object.light_add(type="SUN")
        bpy.ops.export_scene.gltf(filepath={str(tmp_path / "a.glb")!r}, export_lights=True)
    """)
    assert "has no light" in succeed("a.usda", *CYCLES, "-o", "u.png", folder=tmp_path)
    said = succeed("a.glb", *CYCLES, "-o", "g.png", folder=tmp_path)
    assert "has no camera" in said
    assert "has no light" not in said


def test_an_emitting_material_is_light(tmp_path: pathlib.Path) -> None:
    blend = make_blend(tmp_path / "lamp.blend", """
        bpy.ops.mesh.primitive_cube_add()
        material = bpy.data.materials.new("Lamp")
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 2
        bpy.context.object.data.materials.append(material)
    """)
    assert "has no light" not in succeed(blend, *CYCLES, folder=tmp_path)


def test_a_scene_of_nothing_shows_the_world(tmp_path: pathlib.Path) -> None:
    blend = make_blend(tmp_path / "empty.blend", "")
    assert f"'{blend}' has nothing to show" in succeed(blend, *CYCLES, "-o", "a.exr", folder=tmp_path)
    assert np.allclose(pixels(tmp_path / "a.exr")[..., :3], 1.0, atol=1e-5)


@pytest.mark.parametrize("vertices", ["v 1 2 3\n", "v 1 2 3\nv nan 0 0\nv inf 0 0\nf 1 2 3\n"])
def test_a_scene_of_one_point_renders(tmp_path: pathlib.Path, vertices: str) -> None:
    (tmp_path / "point.obj").write_text("o point\n" + vertices)
    succeed("point.obj", *CYCLES, "-o", "a.exr", folder=tmp_path)
    assert np.isfinite(pixels(tmp_path / "a.exr")).all()


# What cannot be


@pytest.mark.parametrize("extension", ["blend", "usda", "usdc", "usdz", "glb", "gltf", "obj"])
def test_broken_files_are_named(tmp_path: pathlib.Path, extension: str) -> None:
    name = "broken." + extension
    (tmp_path / name).write_text("nonsense")
    assert f"render: scene file '{name}'" in refuse(name, *CYCLES, folder=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_what_is_not_there_is_named(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    assert "scene file 'no.blend' does not exist" in refuse("no.blend", folder=tmp_path)
    assert "has no camera 'Side'; it has: Down, Up" in refuse(lit_blend, *CYCLES, "--camera", "Side", folder=tmp_path)
    said = refuse(lit_blend, *CYCLES, "--view-layer", "X", folder=tmp_path)
    assert "has no view layer 'X'; it has: Main, Other" in said
    said = refuse(lit_blend, *CYCLES, "--set", "bounce=3", folder=tmp_path, status=2)
    assert "there is no setting 'bounce'; known settings: samples, rays" in said
    assert "bounces: 9999 is not a whole number from 0 to 1024" in refuse(
        lit_blend, *CYCLES, "--set", "bounces=9999", folder=tmp_path, status=2)
    assert "'.' is a folder" in refuse(lit_blend, "-o", "out.png", "--stats", ".", folder=tmp_path)
    (tmp_path / "file").touch()
    assert "output 'file/a.png': the folder cannot be made" in refuse(lit_blend, "-o", "file/a.png", folder=tmp_path)


def test_settings_are_listed() -> None:
    result = render("--list-settings", folder=ROOT)
    assert result.returncode == 0
    assert result.stderr == ""
    assert result.stdout.splitlines()[0].split() == ["name", "default", "range", "unit", "cost", "help"]
    assert any(line.startswith("voxel_resolution ") for line in result.stdout.splitlines())


def test_the_users_blender_is_left_alone(lit_blend: pathlib.Path, tmp_path: pathlib.Path) -> None:
    """A start-up script in the user's folder does not run, and nothing is written there."""
    home = tmp_path / "home"
    startup = home / "scripts" / "startup"
    startup.mkdir(parents=True)
    (startup / "noise.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    result = render(lit_blend, *CYCLES, "-o", "a.png", folder=tmp_path, environ={"BLENDER_USER_RESOURCES": str(home)})
    assert result.returncode == 0, result.stderr
    assert not (tmp_path / "ran").exists()
    assert [path.name for path in home.iterdir()] == ["scripts"]


# Framing


def seen_at(view: object, points: np.ndarray) -> np.ndarray:
    """(N, 2) tangents at which a view sees points."""
    from conelight_cli import framing

    assert isinstance(view, framing.View)
    right, up, back = framing.camera_axes(view.forward)
    offsets = points - view.position
    return np.stack([offsets @ right, offsets @ up], axis=1) / (offsets @ -back)[:, None]


@pytest.mark.parametrize("size", [(1, 1, 1), (10, 0, 0.1), (0.01, 0.02, 3), (1e4, 1e4, 5)])
@pytest.mark.parametrize("tangents", [(0.5, 0.3), (0.3, 0.5)])
def test_everything_fits_and_touches_the_margin(
    size: tuple[float, float, float], tangents: tuple[float, float]
) -> None:
    from conelight_cli import framing

    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size + np.array([5.0, -3.0, 2.0])
    share = np.abs(seen_at(framing.outside_view(corners, tangents), corners)) / tangents
    assert share.max() == pytest.approx(1.0 / framing.MARGIN, rel=1e-6)


def test_directions_are_even() -> None:
    from conelight_cli import framing

    around = framing.directions_around(200)
    assert np.allclose(np.linalg.norm(around, axis=1), 1.0)
    assert np.abs(around.mean(axis=0)).max() < 0.01
    assert np.allclose((around**2).mean(axis=0), 1.0 / 3.0, atol=0.01)


def test_a_room_is_seen_from_inside_and_a_solid_from_outside() -> None:
    import bpy
    from conelight_cli import framing

    for turned_inward in (False, True):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.ops.mesh.primitive_cube_add(size=4.0)
        if turned_inward:
            bpy.context.object.data.flip_normals()
        view = framing.add_camera(bpy.context.scene)
        assert view is not None
        assert view.is_inside == turned_inward
        assert (np.abs(view.position) < 2.0).all() == turned_inward
        assert math.isclose(np.linalg.norm(view.forward), 1.0)
