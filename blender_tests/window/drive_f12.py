# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of F12 in a Blender with a window; see driving.py and README.md for how to start them."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import bpy
import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from driving import (
    MODULE,
    Steps,
    area,
    back_from_render,
    build_scene,
    close_render_windows,
    drive,
    events,
    finish,
    folder,
    install,
    measured,
    operator,
    press,
    render,
    save,
    session,
    shade,
    shot,
    use_conelight,
    window,
)

# Cases ------------------------------------------------------------------------------------------------------------


def case_f12() -> Steps:
    """F12 from Solid and from Rendered view, Esc, again, previews, undo, other engines, off and on."""
    install()
    build_scene()
    use_conelight()
    shade("SOLID")
    yield 2.0
    shot("solid_before")

    render()
    while bpy.app.is_job_running("RENDER") and not any("Sample" in text for text in measured["stats"]):
        yield 0.05
    yield 0.5
    shot("while_rendering")
    yield from finish()
    measured["first"] = events.last()
    measured["error_of_first"] = session().last_error
    measured["renderer"] = session().last_statistics.get("renderer")
    shot("rendered")
    save("first")
    close_render_windows()
    yield 1.5
    shot("solid_after")

    render()
    yield from finish()
    save("second")
    close_render_windows()
    yield 0.5

    use_conelight(samples=4096)
    render()
    while bpy.app.is_job_running("RENDER") and not any("Sample 2/" in text for text in measured["stats"]):
        yield 0.05
    pressed = time.perf_counter()
    press("Escape")
    yield from finish()
    measured["after_escape"] = events.last()
    measured["seconds_to_escape"] = events.when("render_cancel") - pressed
    shot("cancelled")
    close_render_windows()
    yield 0.5

    use_conelight()
    render("AREA")
    yield from finish()
    save("after_escape")
    shot("in_area")
    back_from_render()
    yield 1.0

    shade("RENDERED")
    yield 2.0
    shot("rendered_view")
    render()
    yield from finish()
    save("from_rendered_view")
    close_render_windows()
    yield 1.5
    shot("rendered_view_after")
    shade("MATERIAL")
    yield 4.0
    shot("material_view")
    shade("SOLID")

    properties = area("PROPERTIES").spaces.active
    bpy.context.view_layer.objects.active = bpy.data.objects["Sphere"]
    preview = bpy.types.MATERIAL_PT_preview
    bpy.utils.unregister_class(preview)
    preview.bl_options = set()  # open
    bpy.utils.register_class(preview)
    yield 0.5
    properties.context = "MATERIAL"
    yield 5.0
    shot("material_tab")
    subprocess.run(["xdotool", "mousemove", "1180", "600", "click", "--repeat", "60", "--delay", "20", "5"], check=True)
    yield 5.0
    shot("material_preview")
    properties.context = "RENDER"
    render()
    yield from finish()
    save("after_preview")
    close_render_windows()

    operator(bpy.ops.object.select_all, action="SELECT")
    operator(bpy.ops.transform.translate, value=(0, 0, 1))
    operator(bpy.ops.ed.undo_push, message="move")
    yield 0.5
    operator(bpy.ops.ed.undo)
    yield 0.5
    use_conelight()
    render()
    yield from finish()
    save("after_undo")
    close_render_windows()

    eevee = "BLENDER_EEVEE" if bpy.app.version >= (5,) else "BLENDER_EEVEE_NEXT"
    for engine in (eevee, "CYCLES", "CONELIGHT"):
        bpy.context.scene.render.engine = engine
        if engine == "CYCLES":
            bpy.context.scene.cycles.samples = 4
        shade("RENDERED")
        yield 3.0
        shot(f"view_{engine.lower()}")
        shade("SOLID")
        yield 0.5
    bpy.context.scene.render.engine = eevee
    bpy.context.scene.eevee.taa_render_samples = 4
    render()
    yield from finish()
    measured["eevee"] = events.last()
    close_render_windows()

    bpy.context.scene.render.engine = "CONELIGHT"
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield 1.0
    shot("disabled")
    measured["engine_when_disabled"] = bpy.context.scene.render.engine
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield 1.0
    use_conelight()
    render()
    yield from finish()
    save("after_enabling")
    close_render_windows()
    yield 1.0
    shot("solid_at_the_end")


def case_previews() -> Steps:
    """Icons of materials, as this engine and as Cycles makes them."""
    install()
    build_scene()
    yield 1.0
    for engine in ("CONELIGHT", "CYCLES"):
        bpy.context.scene.render.engine = engine
        for name, kind in (("Sphere", "SPHERE"), ("Torus", "FLAT")):
            material = bpy.data.materials[name]
            material.preview_render_type = kind
            material.preview_ensure()
            material.preview.image_pixels_float = [0.0] * len(material.preview.image_pixels_float)
            with bpy.context.temp_override(window=window(), id=material):
                bpy.ops.ed.lib_id_generate_preview()
            quiet, last = 0, 0.0
            while quiet < 20:  # a preview is shown while it is rendered
                yield 0.1
                pixels = np.array(material.preview.image_pixels_float, np.float32)
                quiet = quiet + 1 if pixels.any() and pixels.sum() == last else 0
                last = float(pixels.sum())
            side = material.preview.image_size[1]
            np.save(os.path.join(folder, f"previews_{engine}_{name}.npy"), pixels.reshape(side, -1, 4))


def case_panels() -> Steps:
    """Every panel of ours, in a properties editor as high as the window."""
    install()
    build_scene()
    open_panels()
    use_conelight()
    properties = area("PROPERTIES")
    with bpy.context.temp_override(window=window(), area=properties):
        bpy.ops.screen.screen_full_area(use_hide_panels=False)
    yield 1.0
    editor = area("PROPERTIES")
    editor.spaces.active.context = "RENDER"
    yield 1.0
    shot("closed")
    width, height = editor.width, editor.height
    measured["editor"] = [width, height]
    for tab in ("RENDER", "VIEW_LAYER", "DATA", "OBJECT", "MATERIAL", "WORLD"):
        if tab in ("OBJECT", "MATERIAL"):
            bpy.context.view_layer.objects.active = bpy.data.objects["Sphere"]
        if tab == "DATA":
            bpy.context.view_layer.objects.active = bpy.data.objects["Light"]
        editor.spaces.active.context = tab
        yield 1.0
        shot(tab.lower())
        scroll(40)
        yield 1.0
        shot(f"{tab.lower()}_end")
        scroll(-60)
        yield 0.5


def open_panels() -> None:
    """Opens our panels, which Blender does when it shows one for the first time that is not closed by default."""
    panels = sys.modules[f"{MODULE}.host.panels"].CLASSES
    bpy.ops.preferences.addon_disable(module=MODULE)
    for panel in panels:
        panel.bl_options = set()
    bpy.ops.preferences.addon_enable(module=MODULE)


def scroll(clicks: int) -> None:
    """Turns the wheel over the middle of the window."""
    button = "5" if clicks > 0 else "4"
    subprocess.run(
        ["xdotool", "mousemove", "600", "400", "click", "--repeat", str(abs(clicks)), "--delay", "20", button],
        check=True, timeout=30,
    )


def case_background() -> Steps:
    """The scene of the other cases, rendered in a Blender without a window; to be run after one of them."""
    install()
    bpy.ops.wm.open_mainfile(filepath=os.path.join(folder, "scene.blend"))
    use_conelight()
    bpy.ops.render.render()
    measured["error_of_first"] = session().last_error
    save("first")
    yield 0.0


def case_vulkan() -> Steps:
    """F12 in a Blender without GL, which was started with ``--gpu-backend vulkan``."""
    install()
    build_scene()
    use_conelight()
    shade("SOLID")
    yield 1.0
    shot("before")
    render()
    yield from finish()
    measured["first"] = events.last()
    measured["error_of_first"] = session().last_error
    save("first")
    shot("rendered")


def case_old_gl() -> Steps:
    """F12 and a viewport where the GL driver (of Mesa) has only 4.2, in a Blender that does not use it: with Vulkan."""
    os.environ["MESA_GL_VERSION_OVERRIDE"] = "4.2"
    install()
    build_scene()
    use_conelight()
    yield 1.0
    render()
    yield from finish()
    measured["first"] = events.last()
    measured["error_of_first"] = session().last_error
    close_render_windows()
    shade("RENDERED")
    area("PROPERTIES").spaces.active.context = "RENDER"
    yield 2.0
    measured["problems"] = sys.modules[f"{MODULE}.host.viewport"].problems()
    shot("end")


drive(globals())
