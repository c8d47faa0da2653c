# SPDX-License-Identifier: GPL-3.0-or-later
"""``scene.conelight``: a Blender property for each setting, built from ``settings.py``."""

from __future__ import annotations

from typing import Any

import bpy

from ..settings import Setting, Settings, Unit
from . import presets

#: Blender's (subtype, unit) of a number.
_BLENDER_UNITS = {
    Unit.METRE: {"subtype": "DISTANCE", "unit": "LENGTH"},
    Unit.RADIAN: {"subtype": "ANGLE", "unit": "ROTATION"},
    Unit.SECOND: {"subtype": "TIME_ABSOLUTE", "unit": "TIME_ABSOLUTE"},
}

#: A preview is a sphere a few hundred pixels wide that must be there at once.
_PREVIEW = {
    "samples": 8, "rays": 2, "bounces": 2, "bounce_rays": 4, "voxel_auto": False, "voxel_resolution": 48,
    "time_limit": 5.0,
}


def _tag(group: Any, context: Any) -> None:
    """A change from Python counts as much as one from a panel, which tags the scene by itself."""
    group.id_data.update_tag()


def _property(setting: Setting) -> Any:
    """The Blender property that a setting becomes."""
    common: dict[str, Any] = {"name": setting.label, "default": setting.default, "update": _tag}
    common["description"] = setting.help.rstrip(".") + (f".\nCost: {setting.cost}" if setting.cost != "none" else "")
    if setting.choices:
        return bpy.props.EnumProperty(items=setting.choices, **common)
    if setting.kind is bool:
        return bpy.props.BoolProperty(**common)
    if setting.kind is str:
        return bpy.props.StringProperty(**common)

    limits = {"min": setting.lo, "max": setting.hi, "soft_max": setting.soft_hi}
    common |= {limit: setting.kind(value) for limit, value in limits.items() if value is not None}
    if setting.kind is int:
        if setting.unit is not Unit.NONE:
            common["name"] += f" ({setting.unit.value})"
        return bpy.props.IntProperty(**common)
    return bpy.props.FloatProperty(precision=3, **common, **_BLENDER_UNITS.get(setting.unit, {}))


def _get_preset(group: Any) -> int:
    identifiers = [identifier for identifier, _, _ in presets.ITEMS]
    return identifiers.index(presets.matching_preset(group))


def _set_preset(group: Any, index: int) -> None:
    presets.apply_preset(group, presets.ITEMS[index][0])


ConelightSettings = type(
    "ConelightSettings",
    (bpy.types.PropertyGroup,),
    {
        "__doc__": "Settings of Conelight in one scene",
        "__module__": __name__,
        "__annotations__": {
            "preset": bpy.props.EnumProperty(
                name="Preset", description="Sets what costs time and memory", items=presets.ITEMS,
                get=_get_preset, set=_set_preset,
            ),
            **{name: _property(setting) for name, setting in Settings.declarations().items()},
        },
    },
)


def settings_from_scene(scene: Any, *, samples: int = 0, is_preview: bool = False) -> Settings:
    """The settings of a ``bpy.types.Scene``.

    ``samples`` above 0 overrides the scene's (view layers have such an override). A preview keeps the look, and little
    of the cost.
    """
    group = scene.conelight
    values: dict[str, Any] = {}
    for name, setting in Settings.declarations().items():
        value = getattr(group, name)
        if setting.kind is float:
            value = float(f"{value:.7g}")  # Blender stores 32 bits: 0.1 comes back as 0.10000000149
            value = max(value, setting.lo) if setting.lo is not None else value
            value = min(value, setting.hi) if setting.hi is not None else value
        values[name] = value
    if samples > 0:
        values["samples"] = samples
    if is_preview:
        values |= _PREVIEW
    return Settings().with_values(**values)


def register() -> None:
    bpy.utils.register_class(ConelightSettings)
    bpy.types.Scene.conelight = bpy.props.PointerProperty(type=ConelightSettings)


def unregister() -> None:
    if hasattr(bpy.types.Scene, "conelight"):
        del bpy.types.Scene.conelight
    if getattr(ConelightSettings, "is_registered", False):
        bpy.utils.unregister_class(ConelightSettings)
