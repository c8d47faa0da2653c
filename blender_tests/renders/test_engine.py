# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine inside Blender, with a stand-in for the renderer: registration, panels, callbacks, render results.

All cases run in one Blender process of their own (this file, run as a script), which tells what became of each.
"""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import tempfile
import traceback
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
RESULT_MARK = "engine cases: "


# ---- the stand-in for the renderer -------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Progress:
    fraction: float
    text: str


class PipelineError(Exception):
    pass


class GpuUnavailable(Exception):
    pass


class ExtractionError(Exception):
    pass


@dataclasses.dataclass
class Script:
    """What the stand-in does and saw, set anew for each case."""

    raise_in_extract: Exception | None = None
    raise_in_sample: Exception | None = None
    raise_in_attach: Exception | None = None
    readers: int = 0
    extractions: int = 0
    previews: int = 0
    samples: int = 0
    pipelines: int = 0
    released: int = 0
    guards: int = 0
    size: tuple[int, int] = (0, 0)
    border: tuple[float, ...] = ()
    wanted: frozenset[str] = frozenset()
    resolutions: list[tuple[int, int]] = dataclasses.field(default_factory=list)
    follows: list[bool] = dataclasses.field(default_factory=list)
    settings: Any = None


script = Script()


class StandInContext:
    is_current = True

    @classmethod
    def attach(cls) -> StandInContext:
        if script.raise_in_attach:
            raise script.raise_in_attach
        return cls()

    def guard(self) -> Any:
        import contextlib

        script.guards += 1
        return contextlib.nullcontext()

    def release(self) -> None:
        pass


class StandInFilm:
    """The red of a pixel is its column, the green its row from the bottom, in pixels of the picture."""

    names = ("combined", "depth", "normal", "diffuse_direct")
    is_converged = False

    def __init__(self) -> None:
        self.samples = 0

    def read(self, name: str) -> np.ndarray:
        width, height = script.size
        y, x = np.mgrid[0:height, 0:width].astype(np.float32)
        if name == "depth":
            return (x + 100 * y)[:, :, None]
        picture = np.stack([x, y, np.full_like(x, 0.5), np.ones_like(x)], axis=2)
        return picture if name == "combined" else picture[:, :, :3]


class StandInPipeline:
    warnings = ("voxelize: a warning of the pipeline",)

    def __init__(self, context: StandInContext, *, is_live: bool) -> None:
        self.film = StandInFilm()
        script.pipelines += 1

    def want(self, names: set[str]) -> None:
        script.wanted = frozenset(names)

    def prepare(
        self, scene: Any, settings: Any, size: tuple[int, int], *, follows: bool = False
    ) -> Iterator[Progress]:
        script.size, script.border, script.settings = size, scene.camera.border, settings
        script.follows.append(follows)
        yield Progress(0.5, "Voxels")
        yield Progress(1.0, "Bounces")

    def sample(self) -> Iterator[Progress]:
        if script.raise_in_sample:
            raise script.raise_in_sample
        yield Progress(0.5, "Tile")
        script.samples += 1
        self.film.samples += 1
        yield Progress(1.0, "Tile")

    def statistics(self) -> dict[str, Any]:
        return {"voxels": [8, 8, 8], "memory": {"radiance": 2**20}}

    def release(self) -> None:
        script.released += 1


class StandInReader:
    def __init__(self, *, is_preview: bool = False) -> None:
        self.is_preview = is_preview
        script.readers += 1

    def read(self, depsgraph: Any, resolution: tuple[int, int], check: Any, **_: Any) -> Any:
        from addon.scene import CameraData, SceneData

        script.extractions += 1
        script.previews += self.is_preview
        script.resolutions.append(resolution)
        check()
        if script.raise_in_extract:
            raise script.raise_in_extract
        camera = CameraData(np.eye(4), np.eye(4))
        return SceneData((), (), (), (), None, camera, warnings=('light "Key" is odd',))


def stand_in() -> None:
    """Puts the stand-in where the engine imports the renderer from."""
    modules = {
        "addon.gpu.context": {"GpuContext": StandInContext, "GpuUnavailable": GpuUnavailable},
        "addon.pipeline": {"Pipeline": StandInPipeline, "PipelineError": PipelineError},
        "addon.host.extract.scene": {"SceneReader": StandInReader, "ExtractionError": ExtractionError},
    }
    for name, members in modules.items():
        module = types.ModuleType(name)
        module.__dict__.update(members)
        sys.modules[name] = module


# ---- cases: each starts with an empty file, one camera, the engine chosen, 32 x 16 pixels -------------------------


def start() -> Any:
    global script
    import bpy

    script = Script()
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "CONELIGHT"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 16, 100
    scene.conelight.samples = 3
    return scene


def render() -> str:
    """Renders; gives the text of Blender's error, or nothing."""
    import bpy

    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        return str(error)
    return ""


def saved_channels(scene: Any) -> dict[str, np.ndarray]:
    """Renders to a multilayer EXR and reads it: (H, W) float32 by "pass.channel", row 0 at the top."""
    import bpy
    import OpenImageIO as oiio

    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth = "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "out.exr")
        bpy.ops.render.render(write_still=True)
        image = oiio.ImageInput.open(scene.render.filepath)
        channels, part = {}, 0
        while image.seek_subimage(part, 0):
            spec = image.spec()
            pixels = image.read_image(part, 0, 0, spec.nchannels, "float")
            for index, name in enumerate(spec.channelnames):
                full = name if name.count(".") == 2 else f"{spec.getattribute('name')}.{name}"
                channels[full.split(".", 1)[1]] = pixels[:, :, index]
            part += 1
        image.close()
    return channels


def engine_panels() -> list[str]:
    import bpy

    found, todo = [], [bpy.types.Panel]
    while todo:
        for panel in todo.pop().__subclasses__():
            todo.append(panel)
            if "CONELIGHT" in getattr(panel, "COMPAT_ENGINES", ()) and "conelight" not in panel.__name__:
                found.append(panel.__name__)
    return sorted(found)


def case_register_three_times() -> None:
    import bpy

    import addon

    addon.unregister()
    try:
        before = {name for name in dir(bpy.types) if "conelight" in name.lower()}
        assert not before and not engine_panels() and not hasattr(bpy.types.Scene, "conelight")
        counts = set()
        for _ in range(3):
            addon.register()
            counts.add(len(engine_panels()))
            assert hasattr(bpy.types, "RENDER_PT_conelight")
            addon.unregister()
            assert engine_panels() == []
            assert not hasattr(bpy.types, "RENDER_PT_conelight") and not hasattr(bpy.types.Scene, "conelight")
        assert len(counts) == 1 and counts.pop() > 100
        addon.unregister()  # once more does no harm
    finally:
        addon.register()
        addon.register()


def case_flags() -> None:
    from addon.host.engine import ConelightEngine as Engine

    on = ("bl_use_preview", "bl_use_gpu_context", "bl_use_eevee_viewport", "bl_use_postprocess")
    off = ("bl_use_shading_nodes_custom", "bl_use_stereo_viewport", "bl_use_spherical_stereo")
    assert (Engine.bl_idname, Engine.bl_label) == ("CONELIGHT", "Conelight")
    assert all(getattr(Engine, name) is True for name in on)
    assert all(getattr(Engine, name) is False for name in off)


def case_blender_panels() -> None:
    import bpy

    panels = engine_panels()
    expected = ["EEVEE_MATERIAL_PT_surface", "DATA_PT_EEVEE_light", "DATA_PT_spot", "EEVEE_WORLD_PT_surface",
                "RENDER_PT_color_management", "VIEWLAYER_PT_layer_passes", "DATA_PT_camera_dof"]  # fmt: skip
    expected.append("EEVEE_MATERIAL_PT_settings" if bpy.app.version >= (5,) else "EEVEE_NEXT_MATERIAL_PT_settings")
    assert not set(expected) - set(panels)
    assert not {"RENDER_PT_freestyle", "DATA_PT_light", "NODE_DATA_PT_light"} & set(panels)


class FakeLayout:
    """Takes what a panel draws; a property that does not exist fails, as Blender would only grumble."""

    def __init__(self, drawn: list[tuple[str, bool]], labels: list[str]) -> None:
        self.drawn, self.labels, self.active = drawn, labels, True
        self.children: list[FakeLayout] = []

    def prop(self, data: Any, name: str, **_: Any) -> None:
        assert name in data.bl_rna.properties, name
        self.drawn.append((name, self.active))

    def label(self, *, text: str = "", icon: str = "NONE") -> None:
        import bpy

        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items, icon
        self.labels.append(text)

    def operator(self, name: str) -> None:
        import bpy

        group, _, operator = name.partition(".")
        assert hasattr(getattr(bpy.ops, group), operator), name

    def _child(self, **_: Any) -> FakeLayout:
        return FakeLayout(self.drawn, self.labels)

    row = column = box = _child


def draw_panels() -> tuple[dict[str, bool], list[str]]:
    """Draws every panel of ours: what properties are there (and not greyed out), and the labels."""
    import bpy

    from addon.host import panels

    drawn: list[tuple[str, bool]] = []
    labels: list[str] = []
    light = bpy.data.lights.new("Light", "POINT")
    context = types.SimpleNamespace(
        engine="CONELIGHT", scene=bpy.context.scene, view_layer=bpy.context.view_layer, light=light,
        object=bpy.context.scene.camera,
        space_data=types.SimpleNamespace(shading=types.SimpleNamespace(type="RENDERED")),
    )  # fmt: skip
    again = panels.VIEW3D_PT_conelight  # in another editor
    for panel in panels.CLASSES:
        assert panel.poll(context), panel
        assert not panel.poll(types.SimpleNamespace(engine="CYCLES", light=light)), panel
        seen = [] if panel is again else drawn
        panel.draw(types.SimpleNamespace(layout=FakeLayout(seen, labels), bl_label=panel.bl_label,
                                         panel=getattr(panel, "panel", None)), context)  # fmt: skip
    assert len({name for name, _ in drawn}) == len(drawn), "a property is drawn twice"
    return dict(drawn), labels


def case_panels_draw() -> None:
    from addon.host import session
    from addon.host.panels import APPLIES
    from addon.settings import Settings

    scene = start()
    session.begin_render()
    drawn, labels = draw_panels()
    assert not set(Settings.declarations()) - set(drawn), "every setting is in a panel"
    assert not set(APPLIES) - set(Settings.declarations()), "a rule for a setting that is not there"
    assert not drawn["voxel_resolution"] and drawn["memory_budget"] and not drawn["shadow_cone_angle"]
    assert any(f"{Settings().memory_budget} MiB" in label for label in labels)

    scene.conelight.voxel_auto = False
    assert any("for a closed room" in label for label in draw_panels()[1])
    scene.conelight.voxel_resolution = 1024
    scene.conelight.shadow_mode = "CONE"
    session.last_error = "There is no voxel left."
    session.last_statistics |= {"voxels": [256, 128, 64], "memory": {"faces": 3 * 2**20, "links": 2**20}}
    session.last_statistics["warnings"] = ['material "Paint": node "Noise" is not supported ' + "and on " * 20]
    drawn, labels = draw_panels()
    assert drawn["voxel_resolution"] and not drawn["memory_budget"] and drawn["shadow_cone_angle"]
    assert any("about 64 MiB" in label for label in labels)  # 4 MiB at 256, and 1024 were asked for
    assert any("256 x 128 x 64 voxels, 4 MiB" in label for label in labels)
    assert "There is no voxel left." in labels
    assert 'material "Paint": node "Noise"' in " ".join(labels) and max(map(len, labels)) < 80


def case_settings_round_trip() -> None:
    from addon.host.properties import settings_from_scene
    from addon.settings import PRESETS, Settings, preset

    scene = start()
    scene.conelight.samples = Settings().samples
    assert settings_from_scene(scene) == Settings()
    changed = {}
    for name, setting in Settings.declarations().items():
        if setting.choices:
            changed[name] = setting.choices[-1][0]
        elif setting.kind is bool:
            changed[name] = not setting.default
        else:
            step = 1 if setting.kind is int else 0.1
            changed[name] = setting.default - step if setting.default == setting.hi else setting.default + step
        setattr(scene.conelight, name, changed[name])
        unit = scene.conelight.bl_rna.properties[name].unit
        assert unit == {"m": "LENGTH", "rad": "ROTATION", "s": "TIME_ABSOLUTE"}.get(setting.unit.value, "NONE"), name
        assert setting.help.rstrip(".") in scene.conelight.bl_rna.properties[name].description
    values = dataclasses.asdict(settings_from_scene(scene))
    assert all(abs(values[k] - v) < 1e-6 if isinstance(v, float) else values[k] == v for k, v in changed.items())

    for name, setting in Settings.declarations().items():  # the ends of every range survive 32 bits
        for end in (setting.lo, setting.hi):
            if end is not None:
                setattr(scene.conelight, name, setting.kind(end))
                assert getattr(settings_from_scene(scene), name) == end

    for name in PRESETS:
        scene.conelight.preset = name
        assert scene.conelight.preset == name
        assert settings_from_scene(scene).samples == preset(name).samples
    scene.conelight.bounces += 1
    assert scene.conelight.preset == "custom"
    scene.conelight.preset = "custom"
    assert settings_from_scene(scene).bounces == preset("final").bounces + 1
    assert settings_from_scene(scene, samples=7).samples == 7


def case_render() -> None:
    from addon.host import session

    scene = start()
    heard: list[float] = []
    session.progress_listener = lambda fraction, text: heard.append(fraction)
    try:
        assert render() == ""
    finally:
        session.progress_listener = None
    assert script.size == (32, 16) and script.resolutions == [(32, 16)] and script.samples == 3
    assert script.released == 1 and script.guards > 0
    assert heard == sorted(heard) and 0 < heard[0] < 0.5 and abs(heard[-1] - 1) < 1e-6
    assert session.last_error is None
    statistics = session.last_statistics
    assert (statistics["samples"], statistics["resolution"], statistics["voxels"]) == (3, [32, 16], [8, 8, 8])
    assert statistics["warnings"] == ['light "Key" is odd', "voxelize: a warning of the pipeline"]
    assert statistics["wall_ms"] >= statistics["first_frame_ms"] > 0
    scene.view_layers[0].samples = 2
    render()
    assert session.last_statistics["samples"] == 2


def case_passes() -> None:
    import bpy

    from addon.host import session
    from addon.host.film import PASSES

    scene = start()
    layer = scene.view_layers[0]
    for film_pass in PASSES:
        if film_pass.flag:
            setattr(layer, film_pass.flag, True)
    channels = saved_channels(scene)
    names = {name.rsplit(".", 1)[0] for name in channels}
    assert script.wanted == {film_pass.name for film_pass in PASSES}
    expected = {film_pass.blender_name(bpy.app.version) for film_pass in PASSES}
    assert names == expected, (names, expected)
    assert len(channels) == sum(len(film_pass.channels) for film_pass in PASSES)
    y, x = np.mgrid[15:-1:-1, 0:32]
    diffuse = "Diffuse Direct" if bpy.app.version >= (5,) else "DiffDir"
    for name, wanted in (("Combined.R", x), ("Combined.G", y), ("Depth.Z", x + 100 * y), ("Normal.Y", y),
                         (f"{diffuse}.R", x), (f"{diffuse}.B", 0.5)):  # fmt: skip
        assert np.array_equal(channels[name], np.broadcast_to(wanted, (16, 32))), name
    assert any("Position" in warning for warning in session.last_statistics["warnings"])  # the stand-in has none

    for film_pass in PASSES:
        if film_pass.flag:
            setattr(layer, film_pass.flag, False)
    assert {name.rsplit(".", 1)[0] for name in saved_channels(scene)} == {"Combined"}
    assert script.wanted == {"combined"}


def case_border() -> None:
    scene = start()
    scene.render.use_border = True
    # 0.3 * 32 = 9.6 and 0.8 * 32 = 25.6 are cut to 9 and 25; 0.25 * 16 = 4, 0.7 * 16 = 11.2 to 11.
    scene.render.border_min_x, scene.render.border_max_x = 0.3, 0.8
    scene.render.border_min_y, scene.render.border_max_y = 0.25, 0.7
    for crop in (False, True):
        scene.render.use_crop_to_border = crop
        red = saved_channels(scene)["Combined.R"]
        # A pixel more to each side, which the pixel filter reaches.
        assert script.size == (18, 9), script.size
        assert np.allclose(script.border, (8 / 32, 3 / 16, 26 / 32, 12 / 16)), script.border
        assert script.resolutions[-1] == (32, 16)
        assert red.max() == 16
        if not crop:
            assert red.shape == (16, 32) and red[8, 9:25].tolist() == list(range(1, 17)) and red[8, 25:].max() == 0
    scene.render.use_border = False
    render()
    assert script.size == (32, 16) and script.border == (0.0, 0.0, 1.0, 1.0)


def case_errors() -> None:
    from addon.host import session

    for place, error in (
        ("raise_in_extract", ExtractionError('mesh "Cube" has no place to be.')),
        ("raise_in_attach", GpuUnavailable("There is no OpenGL context.")),
        ("raise_in_sample", PipelineError("There is too little memory for 9 voxels.")),
    ):
        start()
        setattr(script, place, error)
        said = render()
        assert session.last_error == str(error), (place, session.last_error)
        assert str(error) in said, said
        assert session.last_statistics == {}
        start()
        assert render() == "" and session.last_error is None and script.samples == 3, place

    scene = start()
    script.raise_in_sample = ZeroDivisionError("division by zero")
    assert "ZeroDivisionError" in render() and "ZeroDivisionError" in session.last_error
    assert script.released == 1
    script.raise_in_sample = KeyboardInterrupt()
    render()
    assert "interrupted" in session.last_error

    script.raise_in_sample = PipelineError("The first layer fails.")
    scene.view_layers.new("Second")
    script.extractions = 0
    render()
    assert session.last_error == "The first layer fails."
    assert script.extractions == 1, "the second layer, which might succeed, would hide the failure"


def case_missing_renderer() -> None:
    from addon.host import session

    start()
    module = sys.modules.pop("addon.pipeline")
    sys.modules["addon.pipeline"] = None  # as if it, or moderngl, could not be imported
    try:
        assert "install" in render() and "install" in session.last_error
    finally:
        sys.modules["addon.pipeline"] = module


def case_cancel() -> None:
    from addon.host import session
    from addon.host.engine import ConelightEngine

    start()
    steps = 0
    step = ConelightEngine._step

    def break_at_step_six(self: Any, fraction: float, text: str) -> bool:
        nonlocal steps
        steps += 1
        return step(self, fraction, text) and steps < 6

    ConelightEngine._step = break_at_step_six
    try:
        assert render() == ""
    finally:
        ConelightEngine._step = step
    assert session.last_error is None
    assert steps == 6 and script.samples == 2, (steps, script.samples)  # two steps of preparation, two of each sample
    assert script.released == 1 and session.last_statistics == {}

    synchronize = session.Session.synchronize
    session.Session.synchronize = lambda self, *arguments: synchronize(self, *arguments[:2], lambda: True)
    start()
    try:
        assert render() == "" and script.extractions == 1 and script.samples == 0
    finally:
        session.Session.synchronize = synchronize
    assert session.last_error is None
    assert render() == "" and script.samples == 3

    for is_pressed in (False, True):  # there is no Esc in background
        told: list[Any] = []
        engine = types.SimpleNamespace(
            _session=session.Session(), test_break=lambda value=is_pressed: value,
            update_progress=told.append, update_stats=lambda *texts, told=told: told.append(texts),
        )  # fmt: skip
        assert step(engine, 0.25, "Voxels") is not is_pressed
        assert told == [0.25, ("", "Voxels")]


def case_time_limit() -> None:
    scene = start()
    scene.conelight.samples = 1000
    scene.conelight.time_limit = 1e-6
    assert render() == "" and script.samples == 1


def case_view_layers() -> None:
    scene = start()
    scene.view_layers.new("Second")
    assert render() == "" and script.extractions == 2 and script.samples == 6


def case_persistent_data() -> None:
    """With persistent data, the frames of an animation share one reader of the scene and one pipeline, and know that
    they follow each other; a render does not follow the one before."""
    import bpy

    for is_persistent in (True, False):
        scene = start()
        scene.render.use_persistent_data = is_persistent
        scene.frame_end = 3
        with tempfile.TemporaryDirectory() as folder:
            scene.render.filepath = os.path.join(folder, "frame_")
            bpy.ops.render.render(animation=True)
            assert len(os.listdir(folder)) == 3
            assert script.extractions == 3 and script.samples == 9
            assert script.pipelines == script.readers == (1 if is_persistent else 3)
            assert script.follows == [False, True, True]
            bpy.ops.render.render(animation=True)
            assert script.follows[3:] == [False, True, True]
        before = script.released
        render()  # frees its own, or what the engine of the animation left behind
        assert not script.follows[-1]
        assert script.released == before + 1


def case_synchronize() -> None:
    import bpy

    from addon.host.session import Session

    scene = start()
    session = Session()
    session.synchronize(bpy.context.evaluated_depsgraph_get(), (32, 16))
    assert session.scene is not None and script.readers == 1
    scene.conelight.bounces = 1
    session.synchronize(bpy.context.evaluated_depsgraph_get(), (16, 16))
    assert session.settings.bounces == 1 and script.resolutions == [(32, 16), (16, 16)] and script.readers == 1
    session.forget()
    assert session.scene is None
    session.synchronize(bpy.context.evaluated_depsgraph_get(), (16, 16))
    assert session.scene is not None and script.readers == 2, "what was skipped is not known to the old reader"
    script.raise_in_extract = ExtractionError("a sentence")
    try:
        session.synchronize(bpy.context.evaluated_depsgraph_get(), (16, 16))
        raise AssertionError("the error is the caller's")
    except ExtractionError:
        assert session.scene is None, "no picture of what was there before"


def case_changes() -> None:
    import bpy

    from addon.host.changes import Change, changes_in

    scene = start()
    mesh = bpy.data.meshes.new("Mesh")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    thing = bpy.data.objects.new("Thing", mesh)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    material = bpy.data.materials.new("Paint")
    material.use_nodes = True
    mesh.materials.append(material)
    scene.world = scene.world or bpy.data.worlds.new("World")
    scene.collection.children.link(bpy.data.collections.new("Hidden"))
    for new in (thing, lamp):
        scene.collection.objects.link(new)

    seen: list[Change] = []

    def note(_: Any, depsgraph: Any) -> None:
        seen.append(changes_in(depsgraph).kinds)

    def after(change: Any) -> Change:
        bpy.context.view_layer.update()
        seen.clear()
        change()
        bpy.context.view_layer.update()
        return seen[-1] if seen else Change.NONE

    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        base = material.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
        assert after(lambda: setattr(thing.location, "x", 2)) == Change.GEOMETRY
        assert Change.GEOMETRY in after(lambda: mesh.vertices[0].co.__setitem__(0, 0.5) or mesh.update())
        assert after(lambda: setattr(lamp.location, "x", 2)) == Change.LIGHT
        assert Change.LIGHT in after(lambda: setattr(lamp.data, "energy", 5))
        assert after(lambda: setattr(scene.camera.location, "x", 2)) == Change.CAMERA
        assert Change.CAMERA in after(lambda: setattr(scene.camera.data, "lens", 20))
        assert Change.MATERIAL in after(lambda: setattr(base, "default_value", (1, 0, 0, 1)))
        assert Change.WORLD in after(lambda: setattr(scene.world, "color", (1, 0, 0)))
        assert Change.SETTINGS in after(lambda: setattr(scene.conelight, "bounces", 3))
        assert Change.GEOMETRY in after(lambda: setattr(thing, "visible_diffuse", False))
        assert Change.GEOMETRY in after(lambda: setattr(thing, "hide_render", True))
        hidden = bpy.context.view_layer.layer_collection.children["Hidden"]
        assert Change.GEOMETRY in after(lambda: setattr(hidden, "exclude", True))
        assert after(lambda: None) == Change.NONE
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)


def case_preview() -> None:
    """A preview cannot be asked for in background: a render whose session is one."""
    from addon.host import engine, session

    start()
    engine.Session = lambda is_preview: session.Session(is_preview=True)
    try:
        render()
        assert script.previews == 1 and script.settings.samples <= 16 and script.settings.voxel_resolution <= 64
        script.raise_in_extract = ExtractionError("a sentence")
        assert render() == ""
        assert session.last_error is None and session.last_statistics == {}
    finally:
        engine.Session = session.Session


def case_backend() -> None:
    from addon.host.backend import backend_problem

    assert backend_problem("OPENGL", "4.5 (Core Profile) Mesa 22.3.6") is None
    assert backend_problem("OPENGL", "4.3.0 NVIDIA") is None
    assert "4.3" in backend_problem("OPENGL", "4.1 Metal") and "4.1" in backend_problem("OPENGL", "4.1 Metal")
    assert backend_problem("VULKAN", "1.3") is None  # then renders have a GL context of their own
    assert "Metal" in backend_problem("METAL", "") and backend_problem("NONE", "")


def without_gl() -> None:
    """Runs apart, where no OpenGL 4.3 context can be made. Blender crashes if an engine asks for one all the same."""
    from addon.host import session

    start()
    said = render()
    assert "OpenGL 4.3" in said and "driver" in said, said
    assert session.last_error is not None and "OpenGL 4.3" in session.last_error
    assert script.pipelines == 0


CASES = {name.removeprefix("case_"): case for name, case in list(globals().items()) if name.startswith("case_")}


def main() -> None:
    """Runs the cases, or ``without_gl`` when asked to; writes a line of JSON: case -> traceback or null."""
    cases = {"without_gl": without_gl} if sys.argv[1:] == ["without_gl"] else CASES
    sys.path.insert(0, str(ROOT))
    outcome: dict[str, str | None] = {}
    try:
        import bpy  # noqa: F401

        stand_in()
        import addon

        addon.register()
        for name, case in cases.items():
            try:
                case()
                outcome[name] = None
            except BaseException:
                outcome[name] = traceback.format_exc()
    except BaseException:
        outcome["start"] = traceback.format_exc()
    print(f"\n{RESULT_MARK}{json.dumps(outcome)}")
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # Blender 4.5 hangs at exit once it has rendered on a GPU


def run_in_blender(*arguments: str, **environment: str) -> dict[str, str | None]:
    """Runs this file as a script. Gives what became of each case."""
    process = subprocess.run(
        [sys.executable, __file__, *arguments], capture_output=True, text=True, timeout=300, cwd=ROOT,
        stdin=subprocess.DEVNULL, env=os.environ | environment,
    )  # fmt: skip
    for line in process.stdout.splitlines():
        if line.startswith(RESULT_MARK):
            return json.loads(line.removeprefix(RESULT_MARK))
    pytest.fail(f"Blender ended with status {process.returncode}:\n{process.stdout[-2000:]}\n{process.stderr[-4000:]}")


@pytest.fixture(scope="module")
def outcome() -> dict[str, str | None]:
    return run_in_blender()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="takes GL away by variables of Mesa and libglvnd")
@pytest.mark.parametrize(
    ("variable", "value"),
    [("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent"), ("MESA_GL_VERSION_OVERRIDE", "4.1")],
)
def test_without_gl(variable: str, value: str) -> None:
    outcome = run_in_blender("without_gl", **{variable: value, "LIBGL_ALWAYS_SOFTWARE": "1"})
    assert outcome == {"without_gl": None}, outcome.popitem()[1]


@pytest.mark.parametrize("name", CASES)
def test_engine(name: str, outcome: dict[str, str | None]) -> None:
    assert "start" not in outcome, outcome["start"]
    assert outcome[name] is None, outcome[name]


if __name__ == "__main__":
    main()
