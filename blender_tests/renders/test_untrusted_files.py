# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that nobody has vouched for: nothing in them runs, writes elsewhere, or gets into a shader or a shell."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from blender_tests.scenes import build, rendering  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
TINY = ["--resolution", "16x12", "--samples", "1"]
ON_CYCLES = ["--engine", "cycles", *TINY]
ON_OURS = ["--voxels", "16", "--set", "bounces=1", *TINY]

#: Names that would do something where they are not taken for names.
NAMES = {
    "closes a function": '"; } void main() { discard; } //',
    "ends a line": "a\n#error b\r\n#define float int",
    "includes": '#include "../../../etc/passwd"',
    "shell": "$(touch ran) `touch ran`; touch ran | touch ran && touch ran",
    "format": "%s%n{0}{}{layer}%(name)s",
    "folders": "../../../../ran/../",
    "other letters": "\u30b3\u30fc\u30f3\U0001f4a1\u202e\u200b\ufeff\u00e9e\u0301",
    "long": "n" * 10000,
    "nothing": "",
    "starts as an option": "--enable-autoexec",
}


def render(*arguments: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """scripts/render in a process of its own, in ``folder``."""
    return subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "render"), *map(str, arguments)], cwd=folder, timeout=240,
        capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip


def rendered(*arguments: str | Path, folder: Path) -> str:
    """What it says; there must be a picture."""
    result = render(*arguments, folder=folder)
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr
    return result.stderr


def lit_box() -> Any:
    scene = build.empty_scene()
    build.add_box("Box", (1, 1, 1), (0, 0, 0), material=build.diffuse("Grey", (0.5, 0.5, 0.5)))
    build.set_world((1.0, 1.0, 1.0))
    build.add_camera((0, -3, 3), (0, 0, 0), lens=35.0)
    return scene


def save(path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)


# ---- code --------------------------------------------------------------------------------------------------------


@pytest.fixture
def with_code(tmp_path: Path) -> Path:
    """A folder with code.blend, which has code wherever Blender would run it; each makes a file ran_NAME."""
    scene = lit_box()

    def touch(name: str) -> str:
        return f"open({str(tmp_path / ('ran_' + name))!r}, 'w')"

    text = bpy.data.texts.new("start.py")
    text.write(
        f"import bpy\n{touch('text')}\ndef on_render(*_):\n    {touch('handler')}\n"
        "bpy.app.handlers.render_init.append(on_render)\n"
    )
    text.use_module = True
    driver = bpy.data.objects["Box"].driver_add("location", 0).driver
    driver.type, driver.expression = "SCRIPTED", f"[{touch('driver')}, 0.0][1]"
    scene.render.use_freestyle = True
    lines = scene.view_layers[0].freestyle_settings
    lines.mode = "SCRIPT"
    style = bpy.data.texts.new("style.py")
    style.write(touch("style") + "\n")
    lines.modules.new().script = style
    save(tmp_path / "code.blend")
    for path in tmp_path.glob("ran_*"):
        path.unlink()  # what ran here, where it was made
    return tmp_path


@pytest.mark.parametrize("options", [ON_OURS, ON_CYCLES], ids=["conelight", "cycles"])
def test_code_in_a_file_does_not_run(with_code: Path, options: list[str]) -> None:
    rendered("code.blend", *options, "-o", "a.png", "--frames", "1-2", folder=with_code)
    assert sorted(path.name for path in with_code.iterdir()) == ["a_0001.png", "a_0002.png", "code.blend"]


def test_code_runs_where_it_is_trusted(with_code: Path) -> None:
    """The file above does have code that runs."""
    rendered("code.blend", *ON_CYCLES, "--enable-autoexec", "-o", "a.png", folder=with_code)
    ran = {path.name for path in with_code.glob("ran_*")}
    assert ran == {"ran_text", "ran_handler", "ran_driver", "ran_style"}


# ---- writing -----------------------------------------------------------------------------------------------------


def add_file_output(scene: Any, folder: Path) -> None:
    """A compositor that writes the picture to a folder."""
    scene.render.use_compositing = True
    if bpy.app.version < (5, 0, 0):
        scene.use_nodes = True
        tree = scene.node_tree
    else:
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
    layers, output = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeOutputFile")
    if bpy.app.version < (5, 0, 0):
        output.base_path = str(folder)
        output.file_slots[0].path = "extra"
    else:
        output.directory, output.file_name = str(folder), "extra"
        output.file_output_items.new("RGBA", "extra")
    tree.links.new(layers.outputs["Image"], output.inputs[0])


def test_other_outputs_of_a_file_are_not_written(tmp_path: Path) -> None:
    elsewhere, here = tmp_path / "elsewhere", tmp_path / "here"
    elsewhere.mkdir()
    here.mkdir()
    scene = lit_box()
    scene.render.filepath = str(elsewhere / "own")
    add_file_output(scene, elsewhere)
    save(here / "a.blend")
    said = rendered("a.blend", *ON_CYCLES, "--frames", "1-1", folder=here)
    assert "file outputs of the compositor are left out: 'File Output'" in said
    assert sorted(path.name for path in here.iterdir()) == ["a.blend", "a_0001.png"]
    assert list(elsewhere.iterdir()) == []
    rendered("a.blend", *ON_CYCLES, "--enable-autoexec", folder=here)
    assert any(path.name.startswith("extra") for path in elsewhere.iterdir()), "the file does write"


def in_confinement(code: str, *folders: Path) -> subprocess.CompletedProcess[str]:
    """Python code in a process that may write to ``folders`` only; skips where the system cannot do it."""
    start = (
        "import os, sys, threading, pathlib, subprocess\n"
        "from conelight_cli.confinement import confine_writing\n"
        f"if not confine_writing({list(map(str, folders))!r}): sys.exit(77)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", start + code], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT / "scripts")},
    )  # fmt: skip
    if result.returncode == 77:
        pytest.skip("this system has no Landlock")
    return result


@pytest.mark.parametrize(
    "attempt",
    [
        "open('out/new', 'w')",
        "open('out/kept', 'w')",
        "open('out/kept', 'a')",
        "os.truncate('out/kept', 0)",
        "os.remove('out/kept')",
        "os.rename('out/kept', 'in/kept')",
        "os.rename('in/mine', 'out/kept')",
        "os.mkdir('out/folder')",
        "os.symlink('x', 'out/link')",
        "open('in/../out/new', 'w')",
        "open('in/link/new', 'w')",
        "sys.exit(subprocess.run(['touch', 'out/new']).returncode)",
        "os.kill(os.getpid(), 9) if os.system('echo > out/new') else 0",
    ],
)
def test_nothing_is_written_outside(tmp_path: Path, attempt: str) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "in" / "mine").write_text("mine")
    (tmp_path / "out" / "kept").write_text("kept")
    (tmp_path / "in" / "link").symlink_to(tmp_path / "out")
    assert in_confinement(f"os.chdir({str(tmp_path)!r})\n{attempt}", tmp_path / "in").returncode != 0
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["kept"]
    assert (tmp_path / "out" / "kept").read_text() == "kept"


def test_inside_everything_can_be_written(tmp_path: Path) -> None:
    code = (
        f"os.chdir({str(tmp_path)!r})\n"
        "open('a', 'w').write('new')\nos.replace('a', 'b')\nos.mkdir('c')\nos.rmdir('c')\n"
        "thread = threading.Thread(target=lambda: open('d', 'w'))\nthread.start()\nthread.join()\n"
    )
    result = in_confinement(code, tmp_path)
    assert result.returncode == 0, result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b", "d"]


def test_caches_are_not_written_beside_the_file(tmp_path: Path) -> None:
    """A simulation with a disk cache of its own path, and a picture that goes elsewhere."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    lit_box()
    cloth = build.add_box("Cloth", (1, 1, 0.01), (0, 0, 1))
    cache = cloth.modifiers.new("Cloth", "CLOTH").point_cache
    save(here / "a.blend")  # a disk cache needs a file to be beside
    cache.use_disk_cache = True
    save(here / "a.blend")
    (here / "a.blend1").unlink()
    in_confinement("sys.exit(0)")  # skips without it
    rendered(here / "a.blend", *ON_CYCLES, "--frames", "1-3", "-o", there / "a.png", folder=tmp_path)
    assert [path.name for path in here.iterdir()] == ["a.blend"]
    assert len(list(there.iterdir())) == 3
    rendered(here / "a.blend", *ON_CYCLES, "--enable-autoexec", "--frames", "1-3", "-o", there / "b.png",
             folder=tmp_path)  # fmt: skip
    assert [path.name for path in here.iterdir() if path.is_dir()], "the file does write a cache"


# ---- names -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES.keys())
def test_names_are_only_names(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of everything that has one: the picture is the same as with ordinary names."""
    monkeypatch.chdir(tmp_path)

    def picture(name: str) -> Any:
        scene = lit_box()
        box = bpy.data.objects["Box"]
        layer = box.data.uv_layers.new(name="map" if name == "plain" else name[:50]).name
        paint = "paint" if name == "plain" else name[:50]  # nodes know no longer ones
        paint = box.data.color_attributes.new(paint, "FLOAT_COLOR", "POINT").name  # unique: the map has it already
        for corner in box.data.color_attributes[paint].data:
            corner.color = (0.2, 0.6, 0.4, 1.0)
        image = bpy.data.images.new("checker", 4, 4)
        image.pixels[:] = [0.25, 0.5, 0.75, 1.0] * 16
        image.pack()
        material, tree, surface = build.bare_material("M")
        shader = build.new_node(tree, "BsdfDiffuse")
        mix = tree.nodes.new("ShaderNodeMixRGB")
        texture, attribute = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeAttribute")
        place, group = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeGroup")
        inside = group.node_tree = bpy.data.node_groups.new("group", "ShaderNodeTree")
        socket = inside.interface.new_socket("socket", in_out="OUTPUT", socket_type="NodeSocketFloat")
        value, output = inside.nodes.new("ShaderNodeValue"), inside.nodes.new("NodeGroupOutput")
        value.outputs[0].default_value = 0.5
        inside.links.new(value.outputs[0], output.inputs[0])
        texture.image = image
        attribute.attribute_name, place.uv_map = paint, layer
        tree.links.new(place.outputs[0], texture.inputs[0])
        tree.links.new(group.outputs[0], mix.inputs[0])
        tree.links.new(texture.outputs[0], mix.inputs[1])
        tree.links.new(attribute.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], shader.inputs[0])
        tree.links.new(shader.outputs[0], surface)
        box.data.materials[0] = material
        build.add_light("POINT", (1, -1, 2), name="Lamp", energy=10.0)
        if name != "plain":
            socket.name = name
            for thing in (
                box, box.data, image, material, inside, *tree.nodes, scene, scene.world, scene.view_layers[0],
                bpy.data.objects["Lamp"], scene.camera,
            ):  # fmt: skip
                thing.name = name
            image.filepath = name
        return rendering.conelight((16, 12), voxels=16, samples=1, bounces=1)

    plain, named = picture("plain"), picture(name)
    assert (plain == named).all()
    assert plain[6, 8, 0] != plain[6, 8, 1], "the image is seen"
    assert list(tmp_path.iterdir()) == []


def test_texts_given_to_the_compiler_hold_no_names(monkeypatch: pytest.MonkeyPatch) -> None:
    from addon.gpu import context

    texts = []
    original = context.resolve

    def recorded(*arguments: Any) -> Any:
        source = original(*arguments)
        texts.append(source.text)
        return source

    monkeypatch.setattr(context, "resolve", recorded)
    lit_box()
    material, tree, surface = build.bare_material("zebra_material")
    image = bpy.data.images.new("zebra_image", 4, 4)
    shader, texture = build.new_node(tree, "BsdfDiffuse"), tree.nodes.new("ShaderNodeTexImage")
    attribute = tree.nodes.new("ShaderNodeAttribute")
    mix = tree.nodes.new("ShaderNodeMixRGB")
    texture.image, texture.name, attribute.attribute_name = image, "zebra_node", "zebra_attribute"
    tree.links.new(texture.outputs[0], mix.inputs[1])
    tree.links.new(attribute.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], shader.inputs[0])
    tree.links.new(shader.outputs[0], surface)
    bpy.data.objects["Box"].data.materials[0] = material
    rendering.conelight((16, 12), voxels=16, samples=1, bounces=1)
    assert any("material_texture_0" in text for text in texts)
    assert not [text for text in texts if "zebra" in text]


@pytest.mark.parametrize("name", ["a;touch ran.obj", "$(touch ran).obj", "-o.obj", "a\nb.obj", "\u30b3 .obj"])
def test_file_names_are_only_names(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    rendered(tmp_path / name, *ON_CYCLES, "-o", tmp_path / name.replace(".obj", ".png"), folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 2 and not (tmp_path / "ran").exists()
