# SPDX-License-Identifier: GPL-3.0-or-later
"""Odd and broken scenes: a sentence that names what is wrong, the right exit status, and never a traceback or a crash.

Each case of a broken scene is made here and rendered in the same process; files and drivers go through scripts/render.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender_tests.pictures import Picture, read  # noqa: E402
from blender_tests.scenes import build, rendering  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
TINY = ["--resolution", "16x12", "--samples", "1", "--voxels", "16", "--set", "bounces=1"]


def run(*arguments: str | Path, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """scripts/render in a process of its own, in ``folder``."""
    return subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "render"), *map(str, arguments), *TINY], cwd=folder, timeout=120,
        capture_output=True, text=True, env={**os.environ, **environment}, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip


def refuse(*arguments: str | Path, folder: Path, status: int = 1, **environment: str) -> str:
    """The one sentence that scripts/render gives instead of a picture."""
    result = run(*arguments, folder=folder, **environment)
    assert result.returncode == status, (result.returncode, result.stderr)
    assert "Traceback" not in result.stderr + result.stdout
    sentences = [line for line in result.stderr.splitlines() if line.startswith("render: ")]
    assert len(sentences) == 1, result.stderr
    assert not list(folder.glob("*.png")) and not list(folder.glob("*.exr")), "there is no picture"
    return sentences[0]


def accept(*arguments: str | Path, folder: Path, **environment: str) -> tuple[Picture, str]:
    """The picture that scripts/render writes to out.exr, and what it says."""
    result = run(*arguments, "-o", "out.exr", folder=folder, **environment)
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr + result.stdout
    picture = read(folder / "out.exr")
    assert np.isfinite(picture).all()
    return picture, result.stderr


def save(path: Path) -> Path:
    """The scene that was built, as a file."""
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    return path


def room() -> Any:
    """A floor in the light of a white world, seen from above."""
    result = build.empty_scene()
    build.add_plane("Floor", 4.0, build.diffuse("Floor", (0.5, 0.5, 0.5)))
    build.set_world((1.0, 1.0, 1.0))
    build.add_camera((0, -3, 3), (0, 0, 0), lens=35.0)
    result.render.resolution_x, result.render.resolution_y = 16, 12
    return result


def render() -> Picture:
    """The picture of a scene that can be rendered, whatever is wrong with a part of it."""
    picture = rendering.conelight(voxels=16, samples=2, bounces=1)
    assert np.isfinite(picture).all()
    return picture


def floor_is_seen(picture: Picture) -> None:
    """The floor reflects half of the world."""
    assert picture[6, 8, :3] == pytest.approx([0.5] * 3, abs=0.05)


# ---- files -------------------------------------------------------------------------------------------------------


def test_missing_file(tmp_path: Path) -> None:
    assert refuse("nowhere.blend", folder=tmp_path) == "render: scene file 'nowhere.blend' does not exist"


@pytest.mark.parametrize("keep", [0, 10, 400, 0.5, -1])
def test_truncated_blend(tmp_path: Path, keep: float) -> None:
    """``keep``: bytes, or a share of them, that are left."""
    room()
    whole = save(tmp_path / "whole.blend").read_bytes()
    (tmp_path / "cut.blend").write_bytes(whole[: int(keep * len(whole)) if isinstance(keep, float) else keep])
    (tmp_path / "whole.blend").unlink()
    if keep == -1:  # Blender reads what misses nothing but its end
        accept("cut.blend", folder=tmp_path)
    else:
        assert "scene file 'cut.blend'" in refuse("cut.blend", folder=tmp_path)


@pytest.mark.parametrize("name", ["scene.xyz", "scene", "scene.blend1"])
def test_unknown_extension(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("nonsense")
    result = run(name, folder=tmp_path)
    assert result.returncode == 2
    assert f"scene file '{name}': unknown extension" in result.stderr
    assert ".blend .usd" in result.stderr, "the known ones are listed"
    assert "Traceback" not in result.stderr


def test_unknown_output_extension(tmp_path: Path) -> None:
    room()
    save(tmp_path / "a.blend")
    result = run("a.blend", "-o", "a.xyz", folder=tmp_path)
    assert result.returncode == 2
    assert "output 'a.xyz': unknown extension" in result.stderr


def test_empty_file(tmp_path: Path) -> None:
    """A file without anything shows a neutral world, and says so."""
    build.empty_scene()
    save(tmp_path / "empty.blend")
    picture, said = accept("empty.blend", folder=tmp_path)
    assert "'empty.blend' has nothing to show" in said
    assert "'empty.blend' has no light" in said
    assert np.allclose(picture[..., :3], 1.0, atol=1e-3)


@pytest.mark.parametrize("vertices", ["v 1 2 3\n", "v 1 2 3\nv nan 0 0\nv inf 0 0\nf 1 2 3\n", "v 0 0 0\nf 1 1 1\n"])
def test_file_of_one_point(tmp_path: Path, vertices: str) -> None:
    (tmp_path / "point.obj").write_text("o point\n" + vertices)
    picture, said = accept("point.obj", folder=tmp_path)
    assert "'point.obj' has no camera" in said or "nothing to show" in said
    assert np.allclose(picture[..., :3], 1.0, atol=1e-3), "the neutral world"


def test_missing_texture(tmp_path: Path) -> None:
    """The object is magenta, as in Blender, and the message names material and file."""
    room()
    material, tree, surface = build.bare_material("Wood")
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Planks", 8, 8)
    node.image.source = "FILE"
    node.image.filepath = "//planks.png"
    emission = build.new_node(tree, "Emission", Strength=1.0)
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], surface)
    bpy.data.objects["Floor"].data.materials[0] = material
    save(tmp_path / "a.blend")
    picture, said = accept("a.blend", folder=tmp_path)
    line = next(line for line in said.splitlines() if "planks.png" in line)
    assert "Wood" in line or "Planks" in line
    assert picture[6, 8, :3] == pytest.approx([1.0, 0.0, 1.0], abs=1e-3)


def test_texture_node_without_image() -> None:
    room()
    material, tree, surface = build.bare_material("Wood")
    emission = build.new_node(tree, "Emission", Strength=1.0)
    tree.links.new(tree.nodes.new("ShaderNodeTexImage").outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], surface)
    bpy.data.objects["Floor"].data.materials[0] = material
    assert render()[6, 8, :3] == pytest.approx([1.0, 0.0, 1.0], abs=1e-3), "as in Cycles"
    assert any("Wood" in text and "no image" in text for text in rendering.last_warnings()), rendering.last_warnings()


def test_file_without_camera_or_light(tmp_path: Path) -> None:
    build.empty_scene()
    build.add_box("Box", (1, 1, 1), (0, 0, 0), material=build.diffuse("Grey", (0.5, 0.5, 0.5)))
    save(tmp_path / "a.blend")
    picture, said = accept("a.blend", folder=tmp_path)
    assert "'a.blend' has no camera: one that frames everything is used" in said
    assert "'a.blend' has no light: a neutral white world of strength 1 lights it" in said
    assert picture[..., :3].min() < 0.7


# ---- drivers -----------------------------------------------------------------------------------------------------

on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="takes GL away by variables of Mesa")


@on_linux
@pytest.mark.parametrize(
    "environment",
    [
        {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"},
        {"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"},
        {"LIBGL_DRIVERS_PATH": "/nonexistent", "LIBGL_ALWAYS_SOFTWARE": "1"},
        {"MESA_GL_VERSION_OVERRIDE": "4.2", "LIBGL_ALWAYS_SOFTWARE": "1"},
        {"MESA_GL_VERSION_OVERRIDE": "3.3", "LIBGL_ALWAYS_SOFTWARE": "1"},
    ],
    ids=lambda environment: next(iter(environment)) + "=" + next(iter(environment.values())),
)
def test_no_gl(tmp_path: Path, environment: dict[str, str]) -> None:
    room()
    save(tmp_path / "a.blend")
    said = refuse("a.blend", folder=tmp_path, **environment)
    assert "OpenGL" in said or "EGL" in said
    assert "install" in said or "update" in said, "what to do"


@on_linux
def test_old_gl_is_told_from_none(tmp_path: Path) -> None:
    room()
    save(tmp_path / "a.blend")
    said = refuse("a.blend", folder=tmp_path, MESA_GL_VERSION_OVERRIDE="4.2", LIBGL_ALWAYS_SOFTWARE="1")
    assert "OpenGL 4.3" in said and "older" in said


@on_linux
def test_gl_4_3_is_enough(tmp_path: Path) -> None:
    room()
    save(tmp_path / "a.blend")
    accept("a.blend", folder=tmp_path, MESA_GL_VERSION_OVERRIDE="4.3", LIBGL_ALWAYS_SOFTWARE="1")


# ---- scenes ------------------------------------------------------------------------------------------------------


def test_no_camera() -> None:
    room().camera = None
    with pytest.raises(rendering.RenderError, match=r"(?i)camera"):
        render()


def test_nothing_but_a_camera() -> None:
    build.empty_scene()
    build.add_camera((0, 0, 1), (0, 0, 0), lens=35.0)
    picture = rendering.conelight((16, 12), voxels=16, samples=1)
    assert np.array_equal(picture, np.broadcast_to(np.float32([0, 0, 0, 1]), picture.shape))


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        ([], []),
        ([(0, 0, 0)], []),
        ([(0, 0, 0), (1, 0, 0)], []),
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]),
        ([(0, 0, 0.5)] * 4, [(0, 1, 2, 3)]),
        ([(0, 0, 0), (1e-30, 0, 0), (0, 1e-30, 0)], [(0, 1, 2)]),
    ],
    ids=["nothing", "one vertex", "two vertices", "no area", "one place", "tiny"],
)
def test_mesh_without_surface(vertices: list, faces: list) -> None:
    """It is not seen, and disturbs nothing; also not where it is all there is."""
    room()
    build.add_object("Degenerate", build.new_mesh("Degenerate", vertices, faces))
    floor_is_seen(render())
    bpy.data.objects.remove(bpy.data.objects["Floor"])
    assert np.allclose(render()[..., :3], 1.0, atol=1e-3)


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf"), 1e30])
def test_impossible_vertices(bad: float) -> None:
    room()
    vertices = [(0, 0, 0.01), (0.1, 0, 0.01), (0, 0.1, 0.01), (bad, 0, 0.01)]
    build.add_object("Broken", build.new_mesh("Broken", vertices, [(0, 1, 2), (0, 1, 3)]))
    floor_is_seen(render())
    assert any('"Broken"' in text for text in rendering.last_warnings()), rendering.last_warnings()


@pytest.mark.parametrize("bad", [255, -1, 10**6])
def test_faces_without_vertices(bad: int) -> None:
    """What damaged files have, and Blender takes as it is: it is left out, and nothing reads beyond an array."""
    room()
    build.add_object("Broken", build.new_mesh("Broken", [(0, 0, 0.01), (0.1, 0, 0.01), (0, 0.1, 0.01)], [(0, 1, 2)]))
    bpy.data.objects["Broken"].data.attributes[".corner_vert"].data[1].value = bad
    floor_is_seen(render())
    assert any('"Broken"' in text for text in rendering.last_warnings()), rendering.last_warnings()


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 0.0])
def test_impossible_placement(bad: float) -> None:
    room()
    thing = build.add_box("Lost", (0.1, 0.1, 0.1), (1.5, 1.5, 0))
    thing.scale = (bad, bad, bad)
    floor_is_seen(render())


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -5.0])
def test_impossible_light(bad: float) -> None:
    room()
    build.add_light("POINT", (0, 0, 2), name="Odd", energy=bad)
    floor_is_seen(render())
    assert any('"Odd"' in text for text in rendering.last_warnings()), rendering.last_warnings()


def test_camera_inside_a_closed_box() -> None:
    room()
    build.add_box("Around", (1, 1, 1), bpy.context.scene.camera.location, material=build.diffuse("Grey", (0.5,) * 3))
    assert render()[..., :3].max() < 0.05, "no light comes in"


def test_camera_inside_a_solid() -> None:
    """Between the faces of a closed mesh, and exactly on a surface: a picture, whatever it shows."""
    scene = room()
    build.add_sphere("Around", 0.5, scene.camera.location, build.emission("Glow", (1, 1, 1)))
    assert render()[..., :3] == pytest.approx(1.0, abs=1e-3)
    scene.camera.location = (0, 0, 0)
    render()


@pytest.mark.parametrize("what", ["no material", "empty slot", "no nodes", "no output", "unconnected output"])
def test_material_without_nodes(what: str) -> None:
    """Grey of 0.8 where there is no material, the viewport's colour where it has no nodes, black where nothing is
    connected."""
    room()
    mesh = bpy.data.objects["Floor"].data
    mesh.materials.clear()
    expected = 0.8
    if what == "empty slot":
        mesh.materials.append(None)
    elif what != "no material":
        material = bpy.data.materials.new("Bare")
        if what == "no nodes":
            material.diffuse_color = (0.3, 0.3, 0.3, 1)
            material.roughness = 1.0
            material.specular_intensity = 0.0
            if bpy.app.version >= (5, 0, 0):
                pytest.skip("materials always have nodes")
            expected = 0.3
        else:
            tree = build.use_nodes(material)
            tree.nodes.clear()
            if what == "unconnected output":
                tree.nodes.new("ShaderNodeOutputMaterial")
            expected = 0.0
        mesh.materials.append(material)
    assert render()[6, 8, :3] == pytest.approx([expected] * 3, abs=0.06)


def test_unknown_nodes_are_named() -> None:
    room()
    material, tree, surface = build.bare_material("Cloth")
    hair = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    hair.name = "Fibres"
    tree.links.new(hair.outputs[0], surface)
    bpy.data.objects["Floor"].data.materials[0] = material
    render()
    assert any("Cloth" in text and "Fibres" in text for text in rendering.last_warnings()), rendering.last_warnings()


@pytest.mark.parametrize(("face", "start"), [(0, 1), (1, -5), (1, 10**6), (1, 0), (1, 5)])
def test_faces_without_corners(face: int, start: int) -> None:
    """What a script can write, and Blender takes as it is."""
    room()
    corners = [(0, 0, 0.01), (0.1, 0, 0.01), (0, 0.1, 0.01), (0.1, 0.1, 0.01)]
    build.add_object("Broken", build.new_mesh("Broken", corners, [(0, 1, 2), (1, 3, 2)]))
    bpy.data.objects["Broken"].data.polygons[face].loop_start = start
    floor_is_seen(render())
    assert any('"Broken"' in text for text in rendering.last_warnings()), rendering.last_warnings()


# ---- counts and sizes ---------------------------------------------------------------------------------------------


def test_too_many_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    from addon.host.extract import instances

    room()
    monkeypatch.setattr(instances, "MOST_INSTANCES", 1)
    with pytest.raises(rendering.RenderError, match="shows 2 objects and instances, and at most 1 can be rendered"):
        render()


def test_too_large_an_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its pixels are never asked for; the object is magenta."""
    from addon.host.extract import image

    monkeypatch.setattr(image, "MOST_PIXELS", 63)
    room()
    material, tree, surface = build.bare_material("Wood")
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Vast", 8, 8)
    emission = build.new_node(tree, "Emission", Strength=1.0)
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], surface)
    bpy.data.objects["Floor"].data.materials[0] = material
    assert render()[6, 8, :3] == pytest.approx([1.0, 0.0, 1.0], abs=1e-3)
    said = next(text for text in rendering.last_warnings() if "Vast" in text)
    assert "Wood" in said and "8 x 8 pixels" in said and "Scale it down" in said


def test_groups_that_double(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each group uses the one before twice: 2 to the power of 9 nodes in all. (Of 30 levels Blender sees no end.)"""
    from addon.host.extract import material as module

    monkeypatch.setattr(module, "MOST_NODES", 100)
    room()
    material, tree, surface = build.bare_material("Doubling")
    before = None
    for number in range(9):
        group = bpy.data.node_groups.new(f"Group {number}", "ShaderNodeTree")
        group.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
        product = build.new_node(group, "Math")
        for side in range(2 if before else 0):
            inner = group.nodes.new("ShaderNodeGroup")
            inner.node_tree = before
            group.links.new(inner.outputs[0], product.inputs[side])
        group.links.new(product.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
        before = group
    outer, diffuse = tree.nodes.new("ShaderNodeGroup"), build.new_node(tree, "BsdfDiffuse")
    outer.node_tree = before
    tree.links.new(outer.outputs[0], diffuse.inputs[0])
    tree.links.new(diffuse.outputs[0], surface)
    bpy.data.objects["Floor"].data.materials[0] = material
    render()
    assert any("Doubling" in text and "more than 100 of them" in text for text in rendering.last_warnings())


@pytest.mark.parametrize("size", ["65536x65536", "40000x16"])
def test_too_large_a_picture(tmp_path: Path, size: str) -> None:
    room()
    save(tmp_path / "a.blend")
    result = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "render"), "a.blend", *TINY, "--resolution", size], cwd=tmp_path,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 1
    assert f"render: {size.replace('x', ' x ')} pixels cannot be rendered at once" in result.stderr


def test_far_from_the_origin() -> None:
    """A scene a hundred kilometres away is as near."""
    scene = room()
    for thing in scene.objects:
        thing.location.x += 1e5
    floor_is_seen(render())
