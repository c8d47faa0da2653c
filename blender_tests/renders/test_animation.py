# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept from one frame to the next: never anything that has changed, and everything else.

The scene changes in a handler before each frame is evaluated, of an animation and then of single renders, all of
one engine that keeps its data.
"""

from __future__ import annotations

import dataclasses
import itertools
import pathlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.host.extract.keep import says_the_same  # noqa: E402
from addon.host.extract.scene import SceneReader  # noqa: E402
from addon.scene import SceneData  # noqa: E402
from blender_tests.pictures import Picture, read  # noqa: E402
from blender_tests.scenes import build, rendering  # noqa: E402

PARTS = ("meshes", "instances", "materials", "lights", "world")


# Reading ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def scene() -> Any:
    """A little of everything that a depsgraph can report."""
    scene = build.empty_scene()
    _, tree, surface = build.bare_material("Paint")
    shader = build.new_node(tree, "BsdfPrincipled", Roughness=0.3)
    tree.links.new(shader.outputs[0], surface)
    image = bpy.data.images.new("Card", 4, 4)
    image.pixels.foreach_set(np.full(64, 0.5, np.float32))
    texture = build.image_node(tree, image)
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
    value, end = group.nodes.new("ShaderNodeValue"), group.nodes.new("NodeGroupOutput")
    group.links.new(value.outputs[0], end.inputs[0])
    use = build.new_node(tree, "Group")
    use.node_tree = group
    tree.links.new(use.outputs[0], shader.inputs["Metallic"])

    box = build.add_box("Box", (1, 1, 1), (0, 0, 0), material=bpy.data.materials["Paint"])
    box.data.uv_layers.new(name="One")
    box.data.uv_layers.new(name="Two")
    build.add_object("Twin", box.data, (2, 0, 0))
    ball = build.add_sphere("Ball", 0.5, (-2, 0, 0), build.principled("Plain"), segments=8)
    ball.shape_key_add(name="Basis")
    ball.shape_key_add(name="Wide").data[0].co.x += 0.3
    build.add_object("Text", bpy.data.curves.new("Text", "FONT"), (0, 2, 0)).data.body = "A"
    meta = bpy.data.metaballs.new("Drop")
    meta.elements.new()
    build.add_object("Drop", meta, (0, 4, 0))
    build.add_light("POINT", (0, 0, 3), name="Lamp", energy=10.0)
    build.add_light("AREA", (0, 1, 3), name="Window", energy=10.0)
    build.add_camera((0, -6, 2), (0, 0, 0))
    build.set_world((0.2, 0.3, 0.4))

    props = bpy.data.collections.new("Props")  # seen by its instance alone
    for name in ("Inner", "Inner lamp"):
        data = bpy.data.lights.new(name, "SPOT") if "lamp" in name else build.sphere_mesh(name, 0.2, segments=6)
        props.objects.link(bpy.data.objects.new(name, data))
    copies = build.add_object("Copies", None, (0, 0, 2))
    copies.instance_type, copies.instance_collection = "COLLECTION", props
    shelf = bpy.data.collections.new("Shelf")
    scene.collection.children.link(shelf)
    shelf.objects.link(bpy.data.objects.new("Book", build.sphere_mesh("Book", 0.1, box.active_material, segments=6)))
    return scene


def thing(name: str) -> Any:
    return bpy.data.objects[name]


def shelf() -> Any:
    return bpy.context.scene.view_layers[0].layer_collection.children["Shelf"]


def node(owner: Any, kind: str) -> Any:
    return next(node for node in owner.node_tree.nodes if node.bl_idname == kind)


def paint() -> Any:
    return node(bpy.data.materials["Paint"], "ShaderNodeBsdfPrincipled")


def even(frame: int) -> bool:
    return frame % 2 == 0


def _move(name: str) -> Callable[[int], None]:
    return lambda frame: setattr(thing(name).location, "x", 0.1 * frame)


def _edit(name: str) -> Callable[[int], None]:
    def edit(frame: int) -> None:
        mesh = thing(name).data
        mesh.vertices[0].co.z = 0.1 * frame
        mesh.update()

    return edit


def _set_pixels(frame: int) -> None:
    bpy.data.images["Card"].pixels.foreach_set(np.full(64, frame / 8, np.float32))


def _add_modifier(frame: int) -> None:
    thing("Twin").modifiers.clear()
    if even(frame):
        thing("Twin").modifiers.new("Array", "ARRAY").count = frame


def _come_and_go(frame: int) -> None:
    if even(frame):
        build.add_object("New", thing("Ball").data.copy(), (3, 0, 0))
    elif "New" in bpy.data.objects:
        bpy.data.objects.remove(bpy.data.objects["New"])


def _other_camera(frame: int) -> None:
    bpy.context.scene.camera = thing("Lamp") if even(frame) else thing("Camera")


def _border(frame: int) -> None:
    render = bpy.context.scene.render
    render.use_border, render.border_min_x, render.border_max_x = True, 0.1 * frame, 0.9


def _drive(frame: int) -> None:
    if frame == 2:
        thing("Box").driver_add("location", 2).driver.expression = "frame * 0.1"


def _key_light(frame: int) -> None:
    if frame == 2:
        lamp = bpy.data.lights["Lamp"]
        for at, energy in ((2, 10.0), (5, 20.0)):
            lamp.energy = energy
            lamp.keyframe_insert("energy", frame=at)


def layer() -> Any:
    return bpy.context.scene.view_layers[0]


#: What is changed in frame 2 and after -> how, and which parts of the scene change by it.
CHANGES: dict[str, tuple[Callable[[int], Any], set[str]]] = {
    "nothing": (lambda frame: None, set()),
    "camera": (_move("Camera"), set()),
    "lens": (lambda frame: setattr(thing("Camera").data, "lens", 10 * frame), set()),
    "which camera": (_other_camera, set()),
    "border": (_border, set()),
    "pixel aspect": (lambda frame: setattr(bpy.context.scene.render, "pixel_aspect_x", frame), set()),
    "film": (lambda frame: setattr(bpy.context.scene.render, "film_transparent", even(frame)), set()),
    "filter": (lambda frame: setattr(bpy.context.scene.render, "filter_size", frame), set()),
    "exposure": (lambda frame: setattr(bpy.context.scene.cycles, "film_exposure", frame), set()),
    "light": (_move("Lamp"), {"lights"}),
    "light energy": (lambda frame: setattr(thing("Lamp").data, "energy", frame), {"lights"}),
    "light energy keyed": (_key_light, {"lights"}),
    "light shadow": (lambda frame: setattr(thing("Lamp").data, "use_shadow", even(frame)), {"lights"}),
    "light rays": (lambda frame: setattr(thing("Lamp"), "visible_glossy", even(frame)), {"lights"}),
    "light hidden": (lambda frame: setattr(thing("Lamp"), "hide_render", even(frame)), {"lights"}),
    "instanced light": (_move("Inner lamp"), {"lights"}),
    "world": (
        lambda frame: setattr(node(bpy.context.scene.world, "ShaderNodeBackground").inputs[1], "default_value", frame),
        {"world"},
    ),
    "which world": (lambda frame: setattr(bpy.context.scene, "world", bpy.data.worlds.new("New")), {"world"}),
    "no world": (lambda frame: setattr(bpy.context.scene, "world", None), {"world"}),
    "world override": (
        lambda frame: setattr(layer(), "world_override", bpy.data.worlds.new("New") if even(frame) else None), {"world"}
    ),
    "material": (lambda frame: setattr(paint().inputs["Roughness"], "default_value", frame / 8), {"materials"}),
    "node group": (
        lambda frame: setattr(bpy.data.node_groups["Group"].nodes["Value"].outputs[0], "default_value", frame / 8),
        {"materials"},
    ),
    "image pixels": (_set_pixels, {"materials"}),
    "image size": (lambda frame: bpy.data.images["Card"].scale(frame, frame), {"materials"}),
    "image alpha": (
        lambda frame: setattr(bpy.data.images["Card"], "alpha_mode", "NONE" if even(frame) else "PREMUL"), {"materials"}
    ),
    "image colours": (
        lambda frame: setattr(
            bpy.data.images["Card"].colorspace_settings, "name", "Non-Color" if even(frame) else "sRGB"
        ),
        {"materials"},
    ),
    "material override": (
        lambda frame: setattr(layer(), "material_override", bpy.data.materials["Plain"] if even(frame) else None),
        {"instances", "materials"},
    ),
    "which material": (
        lambda frame: thing("Ball").material_slots[0].__setattr__(
            "material", bpy.data.materials["Paint" if even(frame) else "Plain"]
        ),
        {"instances", "materials"},
    ),
    "object": (_move("Ball"), {"instances"}),
    "driver": (_drive, {"instances"}),
    "pass index": (lambda frame: setattr(thing("Ball"), "pass_index", frame), {"instances"}),
    "rays": (lambda frame: setattr(thing("Ball"), "visible_shadow", even(frame)), {"instances"}),
    "holdout": (lambda frame: setattr(thing("Ball"), "is_holdout", even(frame)), {"instances"}),
    "held out collection": (lambda frame: setattr(shelf(), "holdout", even(frame)), {"instances"}),
    "indirect collection": (lambda frame: setattr(shelf(), "indirect_only", even(frame)), {"instances"}),
    "hidden": (lambda frame: setattr(thing("Twin"), "hide_render", even(frame)), {"instances"}),
    "hidden collection": (
        lambda frame: setattr(bpy.data.collections["Shelf"], "hide_render", even(frame)), {"meshes", "instances"}
    ),
    "excluded collection": (lambda frame: setattr(shelf(), "exclude", even(frame)), {"meshes", "instances"}),
    "instance": (_move("Copies"), {"instances", "lights"}),
    "instanced object": (_move("Inner"), {"instances"}),
    "instanced mesh": (_edit("Inner"), {"meshes"}),
    "mesh": (_edit("Box"), {"meshes"}),
    "shape key": (
        lambda frame: setattr(thing("Ball").data.shape_keys.key_blocks["Wide"], "value", frame / 8), {"meshes"}
    ),
    "modifier": (_add_modifier, {"meshes", "instances"}),
    "text": (lambda frame: setattr(thing("Text").data, "body", "I" * frame), {"meshes"}),
    "metaball": (lambda frame: setattr(thing("Drop").data.elements[0], "radius", frame), {"meshes"}),
    "which mesh": (
        lambda frame: setattr(thing("Twin"), "data", thing("Ball" if even(frame) else "Box").data),
        {"meshes", "instances"},
    ),
    "active UV": (lambda frame: setattr(thing("Box").data.uv_layers[frame % 2], "active_render", True), {"meshes"}),
    "texture space": (lambda frame: setattr(thing("Box").data, "use_auto_texspace", even(frame)), {"meshes"}),
    "come and go": (_come_and_go, {"meshes", "instances"}),
}


@pytest.fixture
def readings(scene: Any, tmp_path: pathlib.Path) -> Iterator[Any]:
    """A function: after each of five frames, the scene as read again by one reader, and as read by a new one."""
    found: list[tuple[SceneData, SceneData]] = []
    reader = SceneReader()

    class ReaderProbe(bpy.types.RenderEngine):  # type: ignore[misc]
        bl_idname = "READER_PROBE"
        bl_label = "Reader Probe"

        def update(self, data: Any = None, depsgraph: Any = None) -> None:
            found.append((reader.read(depsgraph, (32, 16)), SceneReader().read(depsgraph, (32, 16))))

        def render(self, depsgraph: Any) -> None:
            pass

    def run(change: Callable[[int], Any]) -> list[tuple[SceneData, SceneData]]:
        before_each_frame(lambda frame: change(frame) if frame > 1 else None)
        scene.render.engine = ReaderProbe.bl_idname
        scene.render.use_persistent_data = True
        render_animation(scene, 3, tmp_path)
        for frame in (4, 5):
            scene.frame_set(frame)
            bpy.ops.render.render()
        return found

    bpy.utils.register_class(ReaderProbe)
    yield run
    bpy.app.handlers.frame_change_pre.clear()
    scene.render.engine = "CYCLES"
    bpy.utils.unregister_class(ReaderProbe)


def before_each_frame(change: Callable[[int], Any]) -> None:
    last = 0

    def handler(current: Any, *_: Any) -> None:
        nonlocal last
        if current.frame_current != last:  # it is called for each of Blender's depsgraphs
            last = current.frame_current
            change(current.frame_current)

    bpy.app.handlers.frame_change_pre.append(handler)


def render_animation(scene: Any, count: int, folder: pathlib.Path) -> None:
    scene.render.resolution_x, scene.render.resolution_y = 32, 16
    scene.frame_start, scene.frame_end = 1, count
    scene.render.filepath = f"{folder}/"
    bpy.ops.render.render(animation=True)


@pytest.mark.parametrize("name", CHANGES)
def test_a_scene_read_again_is_as_read_anew(name: str, readings: Any) -> None:
    change, changed = CHANGES[name]
    found = readings(change)
    assert len(found) == 5
    for frame, (again, anew) in enumerate(found, 1):
        differing = [
            field.name for field in dataclasses.fields(SceneData)
            if not says_the_same(getattr(again, field.name), getattr(anew, field.name))
        ]  # fmt: skip
        assert differing == [], f"frame {frame}"
    scenes = [again for again, _ in found]
    seen = {
        part for part in PARTS for before, after in itertools.pairwise(scenes)
        if getattr(before, part) is not getattr(after, part)
    }  # fmt: skip
    assert seen == changed
    if name == "nothing":
        assert all(scene is scenes[0] for scene in scenes)


def test_view_layers_do_not_mix(scene: Any, readings: Any) -> None:
    """One depsgraph serves all view layers of all frames in turn."""
    second = scene.view_layers.new("Second")
    second.layer_collection.children["Shelf"].exclude = True
    second.material_override = bpy.data.materials["Plain"]
    second.world_override = bpy.data.worlds.new("New")
    found = readings(_move("Ball"))
    assert len(found) == 10
    assert all(says_the_same(again, anew) for again, anew in found)
    assert {len(again.materials) for again, _ in found[1::2]} == {1}
    assert {len(again.materials) for again, _ in found[::2]} == {3}


# Rendering --------------------------------------------------------------------------------------------------------

VOXELS = {"geometry", "voxelize"}
LIGHT = {"inject", "bounce"}


def _turn_light(frame: int) -> None:
    _move("Lamp")(frame)
    thing("Window").data.energy = frame


def _cut(frame: int) -> None:
    """Markers that name cameras, as in an edited film."""
    scene = bpy.context.scene
    if frame == 1 and not scene.timeline_markers:
        build.add_camera((4, -4, 3), (0, 0, 0), name="Second")
        for at, camera in ((1, "Camera"), (3, "Second")):
            scene.timeline_markers.new(camera, frame=at).camera = thing(camera)


#: What is changed -> how, and which passes run again after the first frame, of those that make voxels and light.
MOVES: dict[str, tuple[Callable[[int], Any], set[str]]] = {
    "camera": (_move("Camera"), set()),
    "cut": (_cut, set()),
    "light": (_turn_light, LIGHT),
    "world": (CHANGES["world"][0], {"link"} | LIGHT),
    "material": (CHANGES["material"][0], {"materials", "voxelize"} | LIGHT),
    "image": (_set_pixels, {"materials", "voxelize"} | LIGHT),
    "object": (_move("Ball"), {"link"} | VOXELS | LIGHT),
    "mesh": (_edit("Box"), {"link"} | VOXELS | LIGHT),
    "hidden": (CHANGES["hidden"][0], {"link"} | VOXELS | LIGHT),
}


@pytest.mark.parametrize("name", MOVES)
def test_every_frame_has_the_bits_of_a_picture_of_its_own(name: str, scene: Any, tmp_path: pathlib.Path) -> None:
    change, again = MOVES[name]
    rendering.register()
    from addon.host import session

    passes: list[set[str]] = []

    def note(*_: Any) -> None:
        passes.append({entry["name"] for entry in session.last_statistics["passes"]})

    scene.render.engine = "CONELIGHT"
    rendering.choose_format()
    for key, value in {"voxel_auto": False, "voxel_resolution": 32, "samples": 2, "bounces": 2}.items():
        setattr(scene.conelight, key, value)
    before_each_frame(change)
    bpy.app.handlers.render_post.append(note)
    try:
        scene.frame_set(1)
        scene.render.use_persistent_data = True
        kept_data = pictures(scene, tmp_path / "kept")
        scene.render.use_persistent_data = False
        alone = pictures(scene, tmp_path / "alone")
    finally:
        bpy.app.handlers.render_post.remove(note)
        bpy.app.handlers.frame_change_pre.clear()
    assert alone[0][..., :3].mean() > 0.01 and not np.array_equal(alone[0], alone[3])
    for frame, (one, other) in enumerate(zip(kept_data, alone, strict=True), 1):
        assert np.array_equal(one.view(np.uint32), other.view(np.uint32)), f"frame {frame}"
    made = {"materials", "link"} | VOXELS | LIGHT
    assert [found & made for found in passes] == [made, *[again] * 3, *[made] * 4]


def pictures(scene: Any, folder: pathlib.Path) -> list[Picture]:
    render_animation(scene, 4, folder)
    return [read(folder / f"{frame:04d}.exr") for frame in range(1, 5)]
