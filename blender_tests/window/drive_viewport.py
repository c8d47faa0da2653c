# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of the rendered viewport in a Blender with a window; see driving.py and README.md for how to start them."""

from __future__ import annotations

import contextlib
import gc
import importlib
import math
import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d
from mathutils import Euler

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from driving import (
    MODULE,
    Steps,
    area,
    build_scene,
    close_render_windows,
    drive,
    finish,
    folder,
    install,
    measured,
    operator,
    render,
    save,
    session,
    shade,
    shot,
    use_conelight,
    window,
)

SAMPLES = 4
VOXELS = 32

#: Names of the passes that ran since the list was emptied, in order.
passes: list[str] = []

#: Numbers of the viewports that were made, one after the other.
entered: list[int] = []


# The viewport -----------------------------------------------------------------------------------------------------


def module(name: str) -> Any:
    return importlib.import_module(f"{MODULE}.{name}")


def viewports() -> list[Any]:
    """The viewports that are alive."""
    gc.collect()
    return list(module("host.viewport").viewports)


def space() -> Any:
    return area("VIEW_3D").spaces.active


def region() -> Any:
    return next(r for r in area("VIEW_3D").regions if r.type == "WINDOW")


def log_passes() -> None:
    """Has the names of passes kept."""
    context = module("gpu.context").GpuContext
    original = context.timed

    def timed(self: Any, name: str) -> Any:
        passes.append(name)
        return original(self, name)

    context.timed = timed


def count_viewports() -> None:
    """Has ``entered`` grow by one with each viewport that is made."""
    viewport = module("host.viewport").Viewport
    original = viewport.__init__

    def init(self: Any, *arguments: Any, **options: Any) -> None:
        entered.append(len(entered))
        original(self, *arguments, **options)

    viewport.__init__ = init


def bare() -> None:
    """A 3D view that shows nothing but the picture."""
    bpy.context.preferences.system.viewport_aa = "OFF"  # or else Solid is never twice the same
    view = space()
    view.overlay.show_overlays = view.show_gizmo = False
    for name in dir(view):
        if name.startswith("show_region_") and not view.is_property_readonly(name):
            setattr(view, name, False)


def put_pointer_away() -> None:
    """Into a corner of the window where there is nothing: over the picture a tooltip would appear."""
    found = subprocess.run(["xdotool", "getdisplaygeometry"], capture_output=True, text=True, check=True, timeout=20)
    corner = str(window().x + 3), str(int(found.stdout.split()[1]) - window().y - 3)
    subprocess.run(["xdotool", "mousemove", *corner], check=True, timeout=20)


def converge(name: str, limit: float = 300.0) -> Steps:
    """Waits until the viewport is done, and keeps how long it took, in which draws and passes."""
    passes.clear()
    start = last = time.perf_counter()
    drawn, quiet = sum(viewport.draws for viewport in viewports()), 0
    shown, longest = math.nan, 0.0
    while quiet < 5:
        if time.perf_counter() - start > limit:
            raise RuntimeError(f"{name}: the viewport was not done within {limit:g} s")
        yield 0.05
        longest, last = max(longest, time.perf_counter() - last), time.perf_counter()
        alive = viewports()
        if math.isnan(shown) and any(viewport.is_lit for viewport in alive):
            shown = time.perf_counter() - start
        done = alive and all(viewport.draws and viewport.is_done for viewport in alive)
        quiet = quiet + 1 if done else 0
    alive = viewports()
    measured.setdefault("viewport", {})[name] = {
        "seconds": round(time.perf_counter() - start, 3), "first_picture": round(shown, 3),
        "longest_pause": round(longest, 3), "draws": sum(viewport.draws for viewport in alive) - drawn,
        "passes": sorted(set(passes)), "problem": [viewport.problem for viewport in alive],
        "statistics": alive[0].statistics,
    }  # fmt: skip


def in_draw(work: Callable[[], Any]) -> Steps:
    """Calls ``work`` in the next drawing of a 3D view, where Blender's context is current."""
    done: list[bool] = []

    def draw() -> None:
        if not done:
            done.append(True)
            work()

    handler = bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL")
    while not done:
        area("VIEW_3D").tag_redraw()
        yield 0.05
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")


def save_film(name: str, viewport: Any = None) -> Steps:
    """Writes a viewport's film, scene-linear, row 0 at the bottom; of the first if none is named."""
    viewport = viewport or viewports()[0]

    def read() -> bool:
        with viewport.session.pipeline() as pipeline:
            np.save(os.path.join(folder, f"{measured['case']}_{name}.npy"), pipeline.film.read("combined"))
        return True

    if viewport.session.thread.own:
        viewport.session.thread.run(read)
    else:
        yield from in_draw(read)


def save_screen(name: str) -> Steps:
    """Writes what is seen after the view transform, and where in it the region is: left, bottom, width, height."""
    yield 0.5
    shot(name)
    here = region()
    measured["region"] = [window().x + here.x, window().y + here.y, here.width, here.height]


def look_through_camera() -> None:
    """A camera view whose frame fills the region to the pixel, with a render of as many pixels."""
    scene, here = bpy.context.scene, region()
    scene.render.resolution_x, scene.render.resolution_y = here.width, here.height
    view = space().region_3d
    view.view_perspective = "CAMERA"
    view.view_camera_zoom = 100.0 - 50.0 * math.sqrt(2.0)  # the frame is as wide as the region
    view.view_camera_offset = (0.0, 0.0)


def settings() -> Any:
    return bpy.context.scene.conelight


# Cases ------------------------------------------------------------------------------------------------------------


def prepare(case: str) -> Steps:
    measured["case"] = case
    put_pointer_away()
    install()
    log_passes()
    count_viewports()
    build_scene()
    use_conelight(SAMPLES, VOXELS)
    settings().viewport_samples = SAMPLES
    bare()
    shade("SOLID")
    yield 1.0


def case_viewport_opengl() -> Steps:
    """The same as F12; leaving; edits; leaving again."""
    yield from prepare("viewport_opengl")
    yield from viewport_cases()


def case_viewport_vulkan() -> Steps:
    """The same where Blender draws without GL."""
    yield from prepare("viewport_vulkan")
    yield from viewport_cases()


def viewport_cases() -> Steps:
    # Edges in Solid are drawn a little differently after any engine's Rendered: the comparison is with Blender's own.
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    shade("RENDERED")
    yield 2.0
    shade("SOLID")
    yield 1.0
    yield from save_screen("solid_before")
    use_conelight(SAMPLES, VOXELS)
    shade("RENDERED")
    yield from converge("first")
    yield from leave()
    yield from save_screen("solid_after")
    yield from viewport_against_f12()
    yield from edits()
    yield from leave()
    yield from edits_in_solid()


def leave() -> Steps:
    """Back to Solid; keeps what is left of the viewport."""
    contexts = [viewport.session._context for viewport in viewports()]
    shade("SOLID")
    yield 1.5
    left = sum(context.object_count + context.program_count for context in contexts)
    measured.setdefault("objects_left", []).append(left)
    measured["viewports_left"] = len(viewports())


def edits_in_solid() -> Steps:
    """One of each kind while no viewport looks, and undone; after each what is seen then, and what a viewport shows
    that knows of nothing before."""
    data = bpy.data

    def shine() -> None:
        data.lights["Light"].energy /= 2

    def move() -> None:
        operator(bpy.ops.object.select_all, action="DESELECT")
        data.objects["Torus"].select_set(True)
        operator(bpy.ops.transform.translate, value=(0, 0, 0.7))
        operator(bpy.ops.ed.undo_push, message="move")

    def paint() -> None:
        shader = data.materials["Torus"].node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (0.9, 0.8, 0.1, 1)

    def bend() -> None:
        mesh = data.meshes["Cube"]
        mesh.vertices[0].co.z += 0.8
        mesh.update()

    def undo() -> None:
        operator(bpy.ops.ed.undo)

    def nothing() -> None:
        pass

    settings().viewport_pass = "COMBINED"
    operator(bpy.ops.ed.undo_push, message="solid")
    for name, edit in (
        ("nothing", nothing), ("solid_move", move), ("solid_undo", undo), ("solid_light", shine),
        ("solid_material", paint), ("solid_mesh", bend),
    ):  # fmt: skip
        edit()
        yield 0.5
        for kind in ("known", "unknown"):
            if kind == "unknown":
                module("host.legacy").forget()
            shade("RENDERED")
            yield from converge(f"{name}_{kind}")
            yield from save_film(f"{name}_{kind}")
            yield from leave()


def viewport_against_f12() -> Steps:
    look_through_camera()
    yield 0.5
    shade("RENDERED")
    yield from converge("again")
    drawn = sum(viewport.draws for viewport in viewports())
    yield 2.0
    measured["draws_at_rest"] = sum(viewport.draws for viewport in viewports()) - drawn
    yield from save_film("camera")
    yield from save_screen("camera")
    render()
    yield from finish()
    save("f12")
    measured["error_of_f12"] = session().last_error
    image = bpy.context.scene.render.image_settings
    image.file_format = "PNG"
    path = os.path.join(folder, f"{measured['case']}_f12.png")
    bpy.data.images["Render Result"].save_render(path)
    close_render_windows()
    yield 0.5


def edits() -> Steps:
    """One of each kind; the film after each."""
    data = bpy.data
    view = space().region_3d
    sphere = data.objects["Sphere"]

    def shine() -> None:
        data.lights["Light"].energy *= 3

    def paint() -> None:
        shader = data.materials["Plane"].node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (0.1, 0.7, 0.2, 1)

    def move() -> None:
        sphere.location.x += 1.0

    def sky() -> None:
        data.worlds["World"].node_tree.nodes["Background"].inputs["Color"].default_value = (0.5, 0.6, 1.0, 1)

    def fewer() -> None:
        settings().use_specular = False

    def select() -> None:
        sphere.select_set(True)

    def orbit() -> None:
        view.view_perspective = "PERSP"
        view.view_rotation.rotate(Euler((0.0, 0.0, 0.3)))

    def normals() -> None:
        settings().viewport_pass = "NORMAL"

    for name, edit in (
        ("select", select), ("light", shine), ("material", paint), ("move", move), ("world", sky), ("settings", fewer),
        ("orbit", orbit), ("normals", normals),
    ):  # fmt: skip
        edit()
        area("VIEW_3D").tag_redraw()
        yield from converge(name)
        yield from save_film(name)


# Life -------------------------------------------------------------------------------------------------------------


def case_life_opengl() -> Steps:
    """What happens around a viewport: other engines, files, windows, the add-on itself."""
    yield from prepare("life_opengl")
    yield from life_cases()


def case_life_vulkan() -> Steps:
    """The same where Blender draws without GL."""
    yield from prepare("life_vulkan")
    yield from life_cases()


def life_cases() -> Steps:
    scene, view = bpy.context.scene, space()
    settings().viewport_samples = 2
    operator(bpy.ops.ed.undo_push, message="engine")
    shade("RENDERED")
    yield from converge("start")
    yield from save_film("start")

    operator(bpy.ops.object.select_all, action="DESELECT")
    bpy.data.objects["Torus"].select_set(True)
    operator(bpy.ops.transform.translate, value=(0, 0, 1))
    operator(bpy.ops.ed.undo_push, message="move")
    for name, step in (("moved", None), ("undone", bpy.ops.ed.undo), ("redone", bpy.ops.ed.redo)):
        if step is not None:
            operator(step)
        yield from converge(name)
        yield from save_film(name)
    operator(bpy.ops.ed.undo)
    yield from converge("undone_again")
    scene, view = bpy.context.scene, space()

    yield from overlays()
    view.show_region_ui = True
    yield from converge("narrower")
    view.show_region_ui = False
    yield from converge("wider")
    operator(bpy.ops.screen.region_quadview)
    yield from converge("four_views")
    yield from save_views("four_views")
    shot("four_views")
    operator(bpy.ops.screen.region_quadview)
    yield from converge("one_view")
    operator(bpy.ops.screen.area_split, direction="VERTICAL", factor=0.4)
    other = min((a for a in window().screen.areas if a.type == "VIEW_3D"), key=lambda a: a.width)
    other.spaces.active.region_3d.view_rotation.rotate(Euler((0.0, 0.0, 1.0)))
    shade("RENDERED")  # Blender makes a new one Solid
    yield 0.5
    yield from converge("two_areas")
    yield from save_views("two_areas")
    with bpy.context.temp_override(window=window(), area=other):
        bpy.ops.screen.area_close()
    yield from converge("one_area")
    view = space()

    scene.render.film_transparent = True
    yield from converge("transparent")
    yield from save_film("transparent")
    scene.render.film_transparent = False
    operator(bpy.ops.object.select_all, action="DESELECT")
    bpy.data.objects["Sphere"].select_set(True)
    operator(bpy.ops.view3d.localview)
    yield from converge("local_view")
    yield from save_film("local_view")
    operator(bpy.ops.view3d.localview)
    yield from converge("no_local_view")
    yield from save_film("no_local_view")
    view.use_render_border = True
    view.render_border_min_x, view.render_border_max_x = 0.25, 0.75
    view.render_border_min_y, view.render_border_max_y = 0.2, 0.6
    area("VIEW_3D").tag_redraw()
    yield from converge("border")
    shot("border")
    view.use_render_border = False
    scene.render.preview_pixel_size = "4"
    yield from converge("large_pixels")
    scene.render.preview_pixel_size = "1"

    render()  # while the viewport is at work
    yield from finish()
    measured["error_of_f12"] = session().last_error
    close_render_windows()
    yield from converge("after_f12")

    for engine in ("BLENDER_WORKBENCH", "CYCLES", "CONELIGHT"):
        scene.render.engine = engine
        yield 1.5
    yield from converge("after_other_engines")

    bpy.ops.preferences.addon_disable(module=MODULE)
    yield 1.5
    measured["left_when_disabled"] = len(viewports())
    bpy.ops.preferences.addon_enable(module=MODULE)
    use_conelight(SAMPLES, VOXELS)
    settings().viewport_samples = 2
    shade("RENDERED")
    yield from converge("after_enabling")

    bpy.ops.wm.open_mainfile(filepath=os.path.join(folder, "scene.blend"))
    yield 1.0
    measured["left_after_load"] = len(viewports())
    use_conelight(SAMPLES, VOXELS)
    settings().viewport_samples = 2
    for _ in range(7):
        use_conelight(SAMPLES, VOXELS)
        drawn = view_draws()
        shade("RENDERED")
        yield from converge("entered")
        yield from leave()
        kept("conelight")
        yield from idle(view_draws() - drawn)
        kept("idle")


def save_views(name: str) -> Steps:
    """Writes the film of each viewport, and notes their sizes."""
    found = viewports()
    for number, viewport in enumerate(found):
        yield from save_film(f"{name}_{number}", viewport)
    measured[name] = [viewport.statistics["resolution"] for viewport in found]


def overlays() -> Steps:
    """Screenshots without a wire cube, with one in front of everything, with one under the floor, and with gizmos."""
    view = space()
    names = [name for name in dir(view.overlay) if name.startswith("show_") and name != "show_overlays"]
    shown = {name: getattr(view.overlay, name) for name in names if isinstance(getattr(view.overlay, name), bool)}
    cube = bpy.data.objects.new("Wires", None)
    cube.empty_display_type, cube.empty_display_size = "CUBE", 0.5
    bpy.context.scene.collection.objects.link(cube)
    cube.hide_viewport = True
    for name in shown:
        setattr(view.overlay, name, name == "show_extras")
    view.overlay.show_overlays = True
    yield from converge("wires")
    yield from save_screen("no_wires")
    cube.hide_viewport = False
    for name, height in (("before", 1.5), ("behind", -2.0)):
        cube.location = (0.0, 0.0, height)
        yield from converge(f"wires_{name}")
        yield from save_screen(f"wires_{name}")
    view.show_gizmo = True
    yield from converge("gizmo")
    yield from save_screen("gizmo")
    view.show_gizmo = view.overlay.show_overlays = False
    for name, value in shown.items():
        setattr(view.overlay, name, value)
    bpy.data.objects.remove(cube)
    yield from converge("no_wires")


class IdleEngine(bpy.types.RenderEngine):
    """Draws the same picture always, as ours are drawn: shows what Blender itself takes, which is not little on Vulkan.

    Blender 5.2 with lavapipe keeps 0.2 MiB and a hundred mappings for each time that it draws a window.
    """

    bl_idname = "IDLE"
    bl_label = "Idle"
    bl_use_shading_nodes_custom = False

    def view_update(self, context: Any, depsgraph: Any) -> None:
        pass

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        size = context.region.width, context.region.height
        pixels = gpu.types.Buffer("FLOAT", (size[1], size[0], 4), np.full((size[1], size[0], 4), 0.5, np.float32))
        draw_texture_2d(gpu.types.GPUTexture(size, format="RGBA16F", data=pixels), (0, 0), *size)


def idle(draws: int) -> Steps:
    """Enters Rendered with an engine that does nothing, has the view drawn as often, and leaves."""
    if not IdleEngine.is_registered:
        bpy.utils.register_class(IdleEngine)
    bpy.context.scene.render.engine = IdleEngine.bl_idname
    shade("RENDERED")
    end = view_draws() + draws
    while view_draws() < end - 2:
        area("VIEW_3D").tag_redraw()
        yield 0.02
    shade("SOLID")
    yield 1.5


def view_draws() -> int:
    """How often 3D views were drawn since this was called first."""
    if not _drawn:
        bpy.types.SpaceView3D.draw_handler_add(lambda: _drawn.append(len(_drawn)), (), "WINDOW", "POST_PIXEL")
        _drawn.append(0)
    return len(_drawn)


_drawn: list[int] = []


def kept(by: str) -> None:
    """Notes how much memory the process has got since this was called last, for whatever was done meanwhile."""
    gc.collect()
    now = resident()
    measured.setdefault("kept", {}).setdefault(by, []).append(now - measured.get("resident", now))
    measured["resident"] = now


def case_random_opengl() -> Steps:
    """Edits at random for as many seconds as CONELIGHT_RANDOM_SECONDS says, faster than pictures are done."""
    yield from prepare("random_opengl")
    yield from random_edits()


def case_random_vulkan() -> Steps:
    """The same where Blender draws without GL."""
    yield from prepare("random_vulkan")
    yield from random_edits()


def random_edits() -> Steps:
    """Now and then the scene is made what it was, so that what is taken can be compared: with what Blender takes by
    itself for the same edits and as many drawings, too. Ends before that is more than a process may have."""
    settings().viewport_samples = 2
    operator(bpy.ops.ed.undo_push, message="engine")
    before = remember()
    shade("RENDERED")
    yield from converge("start")
    kept("start")
    chance, drawn = random.Random(1), view_draws()
    end = time.perf_counter() + float(os.environ.get("CONELIGHT_RANDOM_SECONDS", "60"))
    counts: dict[str, int] = {}
    objects: list[int] = []
    programs: list[int] = []
    while time.perf_counter() < end and mappings_used() < 0.3:
        yield from some_edits(chance, counts)
        put_back(before)
        yield from converge("rest")
        objects.append(sum(viewport.session._context.object_count for viewport in viewports()))
        kept("edits")
        shade("SOLID")
        yield 0.5
        module("host.legacy").forget()  # which programs there are depends on what was made since the view was entered
        shade("RENDERED")
        yield from converge("anew")
        objects.append(sum(viewport.session._context.object_count for viewport in viewports()))
        programs.append(sum(viewport.session._context.program_count for viewport in viewports()))
    drawn = view_draws() - drawn
    measured["entered"] = len(entered)
    yield from leave()
    kept("leaving")
    chance, start = random.Random(1), view_draws()
    for _ in programs:
        yield from idle(0)
        shade("RENDERED")
        yield from some_edits(chance, {})
        put_back(before)
        kept("idle")
    yield from idle(drawn - (view_draws() - start))
    kept("idle")
    measured.update(edits=counts, objects=objects, programs=programs)


def some_edits(chance: random.Random, counts: dict[str, int]) -> Steps:
    """Adds to ``counts`` how often each kind was done."""
    for _ in range(25):
        edit = chance.choice(EDITS)
        counts[edit.__name__] = counts.get(edit.__name__, 0) + 1
        edit(chance)
        area("VIEW_3D").tag_redraw()
        yield chance.choice((0.0, 0.02, 0.1, 0.5))


def mappings_used() -> float:
    """Of the memory mappings that a process may have, what share this one has."""
    with open("/proc/sys/vm/max_map_count", encoding="ascii") as file:
        most = int(file.read())
    with open("/proc/self/maps", encoding="utf-8") as file:
        return sum(1 for _ in file) / most


def remember() -> list[tuple[str, str, str, Any]]:
    """What edits may change: collection of ``bpy.data``, name in it, path, value."""
    data, found = bpy.data, []
    paths = {
        "objects": ("location", "scale", "hide_viewport"),
        "lights": ("type", "energy"),
        "materials": tuple(
            f'node_tree.nodes["Principled BSDF"].inputs["{name}"].default_value'
            for name in ("Base Color", "Roughness", "Transmission Weight", "Alpha")
        ),
        "worlds": ('node_tree.nodes["Background"].inputs["Strength"].default_value',),
        "scenes": (
            "render.film_transparent", "render.preview_pixel_size", "render.use_border", "conelight.voxel_resolution",
            "conelight.bounces", "conelight.gather_mode", "conelight.noise_threshold",
        ),
    }  # fmt: skip
    for collection, of_each in paths.items():
        for thing in getattr(data, collection):
            for path in of_each:
                with contextlib.suppress(ValueError, KeyError):  # a material of Blender's own
                    value = thing.path_resolve(path)
                    if not isinstance(value, (str, int, float)):
                        value = tuple(value)  # a copy
                    found.append((collection, thing.name, path, value))
    return found


def put_back(remembered: list[tuple[str, str, str, Any]]) -> None:
    """Makes the scene and the view what they were; undone things are there again, and added ones go."""
    if bpy.context.mode != "OBJECT":
        operator(bpy.ops.object.mode_set, mode="OBJECT")
    for thing in [thing for thing in bpy.data.objects if thing.name.startswith("Extra")]:
        bpy.data.objects.remove(thing)
    for collection, name, path, value in remembered:
        owner, _, attribute = path.rpartition(".")
        thing = getattr(bpy.data, collection)[name]
        setattr(thing.path_resolve(owner) if owner else thing, attribute, value)
    use_conelight(SAMPLES, VOXELS)
    settings().viewport_samples = 2
    look_through_camera()
    shade("RENDERED")


def turn(chance: random.Random) -> None:
    view = space().region_3d
    view.view_perspective = chance.choice(("PERSP", "PERSP", "ORTHO"))
    view.view_rotation.rotate(Euler((chance.uniform(-0.2, 0.2), 0.0, chance.uniform(-0.5, 0.5))))
    view.view_distance *= chance.uniform(0.9, 1.1)


def through_camera(chance: random.Random) -> None:
    view = space().region_3d
    view.view_perspective = "CAMERA"
    view.view_camera_zoom = chance.uniform(-20, 60)
    bpy.context.scene.render.use_border = chance.random() < 0.5
    bpy.context.scene.render.border_max_x = chance.uniform(0.0, 1.0)


def displace(chance: random.Random) -> None:
    thing = chance.choice([thing for thing in bpy.data.objects if thing.type in ("MESH", "LIGHT")])
    thing.location.z += chance.uniform(-0.2, 0.2)
    thing.scale = [chance.choice((1.0, 1.0, 0.5, 0.0))] * 3


def recolour(chance: random.Random) -> None:
    shader = chance.choice(list(bpy.data.materials)).node_tree.nodes.get("Principled BSDF")
    if shader is not None:
        shader.inputs["Base Color"].default_value = [*(chance.random() for _ in range(3)), 1]
        shader.inputs["Roughness"].default_value = chance.random()
        shader.inputs["Transmission Weight"].default_value = chance.choice((0.0, 0.0, 1.0))
        shader.inputs["Alpha"].default_value = chance.choice((1.0, 1.0, 0.5))


def relight(chance: random.Random) -> None:
    light = bpy.data.objects["Light"].data
    light.energy = chance.choice((0.0, 100.0, 1000.0))
    light.type = chance.choice(("POINT", "SUN", "SPOT", "AREA"))
    background = bpy.data.worlds["World"].node_tree.nodes["Background"]
    background.inputs["Strength"].default_value = chance.choice((0.0, 0.5, 1.0))


def add_or_remove(chance: random.Random) -> None:
    extra = [thing for thing in bpy.data.objects if thing.name.startswith("Extra")]
    if len(extra) > 3 or (extra and chance.random() < 0.5):
        bpy.data.objects.remove(chance.choice(extra))
    else:
        thing = bpy.data.objects.new("Extra", bpy.data.objects["Sphere"].data)
        thing.location = [chance.uniform(-4, 4) for _ in range(3)]
        bpy.context.scene.collection.objects.link(thing)


def hide(chance: random.Random) -> None:
    thing = chance.choice(list(bpy.context.scene.objects))
    thing.hide_viewport = not thing.hide_viewport


def set_something(chance: random.Random) -> None:
    group = settings()
    group.voxel_resolution = chance.choice((16, 24, 32))
    group.bounces = chance.choice((0, 2, 256))
    group.gather_mode = chance.choice(("RAYS", "RAYS", "CONES", "OCCLUSION"))
    group.noise_threshold = chance.choice((0.0, 0.0, 0.05))
    bpy.context.scene.render.film_transparent = chance.random() < 0.5
    bpy.context.scene.render.preview_pixel_size = chance.choice(("1", "2"))


def other_shading(chance: random.Random) -> None:
    shade(chance.choice(("SOLID", "WIREFRAME", "RENDERED", "RENDERED")))


def undo_or_redo(chance: random.Random) -> None:
    # Blender 5.2 crashes now and then, whatever the engine, where it undoes changes of scripts that no step knows of.
    operator(bpy.ops.ed.undo_push, message="edit")
    if chance.random() < 0.5:
        return
    with contextlib.suppress(RuntimeError):  # there is nothing to undo
        operator(chance.choice((bpy.ops.ed.undo, bpy.ops.ed.redo)))


def edit_mesh(chance: random.Random) -> None:
    if bpy.context.mode != "OBJECT":
        operator(bpy.ops.object.mode_set, mode="OBJECT")
        return
    sphere = bpy.data.objects.get("Sphere")
    if sphere is not None and sphere.visible_get():
        bpy.context.view_layer.objects.active = sphere
        operator(bpy.ops.object.mode_set, mode="EDIT")


EDITS = (
    turn, turn, through_camera, displace, displace, recolour, relight, add_or_remove, hide, set_something,
    other_shading, undo_or_redo, edit_mesh,
)  # fmt: skip


def resident() -> int:
    """Bytes of memory that the process holds."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


drive(globals())
