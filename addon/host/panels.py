# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels: our own, built from ``settings.py`` and the table of passes, and which of Blender's appear beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy

from ..grid import SurfaceMeasure, estimate_memory
from ..settings import Panel, Settings
from . import session, viewport
from .backend import backend_in_use, way_of_drawing
from .engine import ENGINE_ID
from .film import PASSES

#: Settings that do nothing in some cases: greyed out when this is false. The argument is ``scene.conelight``.
APPLIES: dict[str, Callable[[Any], bool]] = {
    "voxel_resolution": lambda s: not s.voxel_auto,
    "memory_budget": lambda s: s.voxel_auto,
    "voxel_levels": lambda s: s.gather_mode != "CONES" and s.shadow_mode != "CONE",
    "voxel_detail": lambda s: s.voxel_levels == "ON" or (s.voxel_levels == "AUTO" and s.voxel_auto),
    "bounces": lambda s: _gathers_light(s),
    "bounce_rays": lambda s: _gathers_light(s),  # without bounces too: they bring the light of world and emitters
    "gather_interval": lambda s: s.use_indirect and s.noise_threshold <= 0.0,
    "reuse_frames": lambda s: s.use_indirect and s.noise_threshold <= 0.0,
    "clamp_indirect": lambda s: s.use_indirect or s.use_specular,
    "rays": lambda s: s.use_indirect and s.gather_mode != "CONES",
    "direct_amount": lambda s: s.use_direct,
    "indirect_amount": lambda s: s.use_indirect,
    "gather_mode": lambda s: s.use_indirect,
    "specular_amount": lambda s: s.use_specular,
    "specular_aperture": lambda s: s.use_specular,
    "glossy_layers": lambda s: s.use_specular and s.gather_mode != "OCCLUSION",
    "light_falloff": lambda s: s.use_direct or s.use_indirect,
    "max_distance": lambda s: s.use_indirect or s.use_specular,
    "shadow_amount": lambda s: s.use_shadows,
    "shadow_mode": lambda s: s.use_shadows,
    "shadow_cone_angle": lambda s: s.use_shadows and s.shadow_mode == "CONE",
    "ao_distance": lambda s: (
        s.viewport_pass == "AMBIENT_OCCLUSION" or (s.use_indirect and s.gather_mode == "OCCLUSION")
    ),
    "viewport_level": lambda s: s.viewport_pass == "VOXELS",
}

#: Blender's panels that do not suit us though they are meant for every engine.
_UNSUITABLE = ("RENDER_PT_freestyle", "VIEWLAYER_PT_freestyle", "DATA_PT_light", "NODE_DATA_PT_light")

#: EEVEE's panels that suit us: of each line, the first that this Blender has.
_SUITABLE = (
    ("EEVEE_MATERIAL_PT_context_material",),
    ("EEVEE_MATERIAL_PT_surface",),
    ("EEVEE_NEXT_MATERIAL_PT_settings", "EEVEE_MATERIAL_PT_settings"),  # 4.5, and later
    ("MATERIAL_PT_preview",),
    ("EEVEE_WORLD_PT_surface",),
    ("DATA_PT_camera_dof",),
    ("DATA_PT_camera_dof_aperture",),
    ("DATA_PT_EEVEE_light",),
    ("VIEWLAYER_PT_layer_passes",),  # holds our own passes
    ("VIEWLAYER_PT_override",),
    ("VIEW3D_PT_shading_render_pass",),
)


def _gathers_light(settings: Any) -> bool:
    return (settings.use_indirect and settings.gather_mode != "OCCLUSION") or settings.use_specular


class _OwnPanel:
    """What all our panels have in common."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES = {ENGINE_ID}
    bl_label: str
    layout: Any

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine in cls.COMPAT_ENGINES


class RENDER_PT_conelight(_OwnPanel, bpy.types.Panel):
    bl_label = "Conelight"
    bl_context = "render"

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        backend, problem = backend_in_use()
        if problem is not None:
            _draw_sentences(layout.box(), [problem], "ERROR")
        layout.prop(context.scene.conelight, "preset")
        if session.last_error is not None:
            _draw_sentences(layout.box(), [session.last_error], "CANCEL")
        for text in viewport.problems():
            _draw_sentences(layout.box(), [f"Viewport: {text}"], "CANCEL")
        warnings = list(dict.fromkeys(session.last_statistics.get("warnings", []) + viewport.warnings()))
        if warnings:
            box = layout.box()
            box.label(text="Not rendered as asked:", icon="INFO")
            _draw_sentences(box, warnings, "DOT")
        if problem is None and backend != "UNKNOWN":
            _draw_sentences(layout, [f"Graphics: {way_of_drawing(backend)}"], "NONE")


class _SettingsPanel(_OwnPanel):
    """A sub-panel with the settings of one :class:`~addon.settings.Panel`."""

    bl_context = "render"
    bl_parent_id = "RENDER_PT_conelight"
    panel: Panel

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        settings = context.scene.conelight
        for name, setting in Settings.declarations().items():
            if setting.panel is self.panel:
                row = layout.row()
                row.active = APPLIES.get(name, lambda _: True)(settings)
                row.prop(settings, name)
        if self.panel is Panel.VOXELS:
            _draw_memory(layout, settings)


class VIEW3D_PT_conelight(bpy.types.Panel):
    """Beside Blender's choices for a rendered viewport: what it shows, and what explains it."""

    bl_label = "Conelight"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_parent_id = "VIEW3D_PT_shading"
    layout: Any

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine == ENGINE_ID and context.space_data.shading.type == "RENDERED"

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.scene.conelight
        layout.prop(settings, "viewport_pass", text="")
        row = layout.row()
        row.active = APPLIES["viewport_level"](settings)
        row.prop(settings, "viewport_level")
        layout.operator("conelight.show_rays")


class RENDER_PT_conelight_film(_OwnPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        render = context.scene.render
        layout.prop(render, "film_transparent", text="Transparent")
        layout.prop(render, "filter_size", text="Filter Width")
        layout.prop(render, "use_persistent_data", text="Persistent Data")


class _PassesPanel(_OwnPanel):
    """The passes of one group, as switches of the view layer."""

    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for film_pass in PASSES:
            if film_pass.flag is not None and film_pass.panel == self.bl_label:
                layout.prop(context.view_layer, film_pass.flag, text=film_pass.name_5)


class DATA_PT_conelight_shadow(_OwnPanel, bpy.types.Panel):
    bl_label = "Shadow"
    bl_context = "data"
    bl_parent_id = "DATA_PT_EEVEE_light"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and getattr(context, "light", None) is not None

    def draw(self, context: Any) -> None:
        self.layout.use_property_split = True
        self.layout.prop(context.light, "use_shadow", text="Cast Shadow")


class OBJECT_PT_conelight_ray_visibility(_OwnPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for kind in ("camera", "diffuse", "glossy", "transmission", "shadow"):
            layout.prop(context.object, f"visible_{kind}", text=kind.capitalize())


def _draw_sentences(layout: Any, sentences: list[str], icon: str) -> None:
    """Sentences as labels, broken into lines as wide as the editor: Blender does not wrap text."""
    region, scale = bpy.context.region, bpy.context.preferences.system.ui_scale
    pixels = region.width / scale if region and scale else 440.0  # without a window there is no scale
    width = max(int((pixels - 60) / 6.3), 16)  # icon and margins take 60, a letter 6.3
    column = layout.column(align=True)
    for text in sentences:
        line, first = "", True
        for word in [*text.split(), None]:
            if word is not None and len(line) + len(word) < width:
                line = f"{line} {word}".strip()
                continue
            column.label(text=line, icon=icon if first or icon == "NONE" else "BLANK1")
            line, first = word or "", False


def _draw_memory(layout: Any, settings: Any) -> None:
    """How much memory voxels will take, and took."""
    voxels, memory = session.last_statistics.get("voxels", []), session.last_statistics.get("memory", {})
    used = sum(memory.values()) if voxels and memory else 0
    if settings.voxel_auto:
        lines = [f"Memory: up to {settings.memory_budget} MiB"]
    elif used:  # surfaces grow with the square of the resolution
        estimate = used * (settings.voxel_resolution / max(voxels)) ** 2
        lines = [f"Memory: about {estimate / 2**20:.0f} MiB, from the last render"]
    else:
        room = SurfaceMeasure(area=6.0)
        estimate = estimate_memory(settings.voxel_resolution, (1.0, 1.0, 1.0), room, settings.bounce_rays)
        lines = [f"Memory: about {estimate / 2**20:.0f} MiB for a closed room"]
    if used:
        lines.append(f"Last render: {' x '.join(map(str, voxels))} voxels, {used / 2**20:.0f} MiB")
    levels = session.last_statistics.get("levels", []) if used else []
    if levels:
        widths = [f"{level['voxel_size']:.3g} m" for level in (levels[0], levels[-1])]
        lines.append(f"In the finest of {len(levels)} levels around the camera: voxels are {' to '.join(widths)} wide")
    _draw_sentences(layout, lines, "NONE")


def _settings_panels() -> Iterator[type]:
    for panel in Panel:
        name = f"RENDER_PT_conelight_{panel.name.lower()}"
        closed = set() if panel in (Panel.SAMPLING, Panel.VOXELS) else {"DEFAULT_CLOSED"}
        yield type(
            name,
            (_SettingsPanel, bpy.types.Panel),
            {"__module__": __name__, "bl_label": panel.value, "bl_options": closed, "panel": panel},
        )


def _passes_panels() -> Iterator[type]:
    for group in dict.fromkeys(film_pass.panel for film_pass in PASSES):
        name = f"VIEWLAYER_PT_conelight_passes_{group.lower()}"
        yield type(name, (_PassesPanel, bpy.types.Panel), {"__module__": __name__, "bl_label": group})


#: Our panels, parents before children.
CLASSES: tuple[type, ...] = (
    RENDER_PT_conelight,
    *_settings_panels(),
    VIEW3D_PT_conelight,
    RENDER_PT_conelight_film,
    *_passes_panels(),
    DATA_PT_conelight_shadow,
    OBJECT_PT_conelight_ray_visibility,
)


def _all_panels(base: Any = bpy.types.Panel) -> Iterator[Any]:
    """Every panel class that there is, of Blender and of add-ons."""
    for panel in base.__subclasses__():
        yield panel
        yield from _all_panels(panel)


def blender_panels() -> list[Any]:
    """The panels of Blender that appear with our engine."""
    suitable = {next((name for name in names if hasattr(bpy.types, name)), "") for names in _SUITABLE}
    return [
        panel
        for panel in _all_panels()
        if panel not in CLASSES
        and not panel.__name__.startswith(_UNSUITABLE)
        and ("BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ()) or panel.__name__ in suitable)
    ]


@bpy.app.handlers.persistent
def _show_blender_panels(*_: Any) -> None:
    """Lets Blender's panels appear with our engine; again after a file is loaded, as add-ons may have come since."""
    for panel in blender_panels():
        if isinstance(getattr(panel, "COMPAT_ENGINES", None), set):
            panel.COMPAT_ENGINES.add(ENGINE_ID)
        elif not hasattr(panel, "COMPAT_ENGINES"):
            panel.COMPAT_ENGINES = {ENGINE_ID}


def register() -> None:
    _show_blender_panels()
    for panel in CLASSES:
        bpy.utils.register_class(panel)
    bpy.app.handlers.load_post.append(_show_blender_panels)


def unregister() -> None:
    handlers = bpy.app.handlers.load_post
    if _show_blender_panels in handlers:
        handlers.remove(_show_blender_panels)
    for panel in reversed(CLASSES):
        if getattr(panel, "is_registered", False):
            bpy.utils.unregister_class(panel)
    for panel in _all_panels():
        if panel not in CLASSES and isinstance(getattr(panel, "COMPAT_ENGINES", None), set):
            panel.COMPAT_ENGINES.discard(ENGINE_ID)
