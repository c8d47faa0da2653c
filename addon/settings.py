# SPDX-License-Identifier: GPL-3.0-or-later
"""Every setting of the engine, declared once.

Blender properties, panels, ``--set NAME=VALUE``, ``--list-settings``, presets and the table in the README are all
built from this file. A setting has a unit, a range, a default, what it costs and a sentence of help.
"""

from __future__ import annotations

import dataclasses
import enum
from dataclasses import dataclass, field
from typing import Any


class Unit(enum.Enum):
    NONE = ""
    METRE = "m"
    RADIAN = "rad"
    SECOND = "s"
    MEBIBYTE = "MiB"


class Panel(enum.Enum):
    """Sub-panels of Render properties > Conelight, in order."""

    SAMPLING = "Sampling"
    VIEWPORT = "Viewport"
    VOXELS = "Voxels"
    LIGHT = "Light Transport"
    SHADOWS = "Shadows"
    OCCLUSION = "Ambient Occlusion"
    PERFORMANCE = "Performance"


@dataclass(frozen=True)
class Setting:
    """One setting; ``name`` is filled in from the field of :class:`Settings`."""

    label: str
    default: Any
    help: str
    panel: Panel
    cost: str = "none"
    unit: Unit = Unit.NONE
    lo: float | None = None
    hi: float | None = None
    soft_hi: float | None = None
    choices: tuple[tuple[str, str, str], ...] = ()  # (identifier, label, help) of an enumeration
    name: str = ""

    @property
    def kind(self) -> type:
        return type(self.default)

    def parse(self, text: str) -> Any:
        """The value that ``text`` (from a command line) means. Raises ValueError with the range or the choices."""
        try:
            if self.kind is bool:
                lowered = text.strip().lower()
                if lowered in ("1", "true", "on", "yes"):
                    return True
                if lowered in ("0", "false", "off", "no"):
                    return False
                raise ValueError(text)
            value = self.kind(text)
        except ValueError:
            raise ValueError(f"{self.name}: '{text}' is not {self._expected()}") from None
        return self.check(value)

    def check(self, value: Any) -> Any:
        """``value`` in the setting's own type. Raises ValueError when it is outside the range."""
        if self.kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if not isinstance(value, self.kind) or (self.kind is int and isinstance(value, bool)):
            raise ValueError(f"{self.name}: {value!r} is not {self._expected()}")
        if self.choices and value not in [identifier for identifier, _, _ in self.choices]:
            raise ValueError(f"{self.name}: '{value}' is not {self._expected()}")
        if self.kind in (int, float):
            number = float(value)  # type: ignore[arg-type]
            if not (self.lo is None or number >= self.lo) or not (
                self.hi is None or number <= self.hi
            ):  # NaN is neither
                raise ValueError(f"{self.name}: {value} is not {self._expected()}")
        return value

    def _expected(self) -> str:
        if self.choices:
            return "one of " + ", ".join(identifier for identifier, _, _ in self.choices)
        if self.kind is bool:
            return "on or off"
        word = {int: "a whole number", float: "a number"}.get(self.kind, "a text")
        if self.lo is not None and self.hi is not None:
            word += f" from {self.lo:g} to {self.hi:g}"
        elif self.lo is not None:
            word += f" of at least {self.lo:g}"
        return word + (f" ({self.unit.value})" if self.unit.value else "")


def _setting(label: str, default: Any, help: str, panel: Panel, **more: Any) -> Any:
    setting = Setting(label=label, default=default, help=help, panel=panel, **more)
    return field(default=default, metadata={"setting": setting})


@dataclass(frozen=True)
class Settings:
    """Values of all settings. The defaults are the preset *balanced*."""

    samples: int = _setting(
        "Samples",
        16,
        "Passes that are averaged into the picture. Noise falls with their square root.",
        Panel.SAMPLING,
        lo=1,
        hi=65536,
        soft_hi=1024,
        cost="time grows in proportion",
    )
    rays: int = _setting(
        "Rays per Pass",
        2,
        "Diffuse directions gathered at each pixel in each pass.",
        Panel.SAMPLING,
        lo=1,
        hi=64,
        soft_hi=16,
        cost="gather time grows in proportion",
    )
    seed: int = _setting(
        "Seed",
        0,
        "Another seed gives another, equally good, pattern of noise.",
        Panel.SAMPLING,
        lo=0,
        hi=2**31 - 1,
    )
    gather_interval: int = _setting(
        "Gather Interval",
        1,
        "Diffuse light from around, and reflections, are gathered in one of so many samples; the others smooth edges "
        "and shadows, and take over what was gathered. With a noise threshold, all gather.",
        Panel.SAMPLING,
        cost="time falls with it",
        lo=1,
        hi=64,
        soft_hi=8,
    )
    reuse_frames: bool = _setting(
        "Reuse Frames",
        False,
        "Frames of an animation in which only the camera moves take over diffuse light and rough reflections from the "
        "frame before, where it saw the same surfaces, and gather less: quicker, with less noise and flicker. A frame "
        "then depends on those rendered before it. Needs Persistent Data, and no noise threshold.",
        Panel.SAMPLING,
        cost="memory for pictures of light; time falls",
    )
    noise_threshold: float = _setting(
        "Noise Threshold",
        0.0,
        "Parts of the picture get no more passes once their noise is below this; it is measured as Cycles measures it. "
        "0: all parts get all passes.",
        Panel.SAMPLING,
        lo=0.0,
        hi=1.0,
        soft_hi=0.1,
    )
    use_reconstruction: bool = _setting(
        "Reconstruction",
        True,
        "Neighbouring pixels share the diffuse light they gather, less and less as passes accumulate.",
        Panel.SAMPLING,
        cost="little: about one ray for each pixel and pass",
    )
    clamp_indirect: float = _setting(
        "Clamp Indirect",
        0.0,
        "Largest radiance that one indirect sample may bring, in W/(m2 sr). 0 does not clamp. "
        "Removes bright specks, and with them some light.",
        Panel.SAMPLING,
        lo=0.0,
        hi=1e6,
    )
    voxel_auto: bool = _setting(
        "Automatic",
        True,
        "Choose the voxel resolution from the scene's extent and the memory budget.",
        Panel.VOXELS,
    )
    voxel_resolution: int = _setting(
        "Resolution",
        128,
        "Voxels along the longest side of the scene, when not automatic.",
        Panel.VOXELS,
        lo=8,
        hi=1024,
        soft_hi=512,
        cost="memory and voxel time grow with its square",
    )
    memory_budget: int = _setting(
        "Memory Budget",
        48,
        "Most memory that voxels and their light may take when the resolution is automatic, as estimated from the "
        "surfaces of the scene.",
        Panel.VOXELS,
        lo=4,
        hi=65536,
        soft_hi=4096,
        unit=Unit.MEBIBYTE,
    )
    voxel_levels: str = _setting(
        "Nested Levels",
        "AUTO",
        "Whether voxels are finest around the camera and twice as wide from level to level around it.",
        Panel.VOXELS,
        choices=(
            (
                "AUTO",
                "Automatic",
                "Where the resolution is automatic, and voxels of one size would be more than five times as wide as "
                "Detail: in scenes of several hundred metres, seen from inside or from near",
            ),
            ("ON", "On", "Each level has as many voxels along its side as Resolution says, when not automatic"),
            ("OFF", "Off", "Voxels of one size everywhere"),
        ),
        cost="rays that cross levels take longer; when the camera leaves the finest level, voxels are made again",
    )
    voxel_detail: float = _setting(
        "Detail",
        0.05,
        "Width of the voxels around the camera where there are nested levels; wider if memory does not suffice.",
        Panel.VOXELS,
        lo=1e-4,
        hi=1000.0,
        soft_hi=1.0,
        unit=Unit.METRE,
        cost="a level more for each halving",
    )
    bounces: int = _setting(
        "Bounces",
        256,
        "Most times that light is passed between voxels before the picture gathers it; it stops sooner "
        "when nothing changes any more. 0: only what light reaches directly.",
        Panel.LIGHT,
        lo=0,
        hi=1024,
        soft_hi=256,
        cost="little: visibility is found once for all bounces",
    )
    bounce_rays: int = _setting(
        "Rays per Face",
        8,
        "Directions in which each voxel face sees others; rounded up to a multiple of four. More where faces are few.",
        Panel.LIGHT,
        lo=1,
        hi=256,
        soft_hi=64,
        cost="voxel time grows in proportion",
    )
    use_direct: bool = _setting(
        "Direct", True, "Light that comes straight from lights and glowing surfaces.", Panel.LIGHT
    )
    direct_amount: float = _setting(
        "Direct Amount", 1.0, "Factor on direct light.", Panel.LIGHT, lo=0.0, hi=10.0, soft_hi=2.0
    )
    use_indirect: bool = _setting(
        "Diffuse Indirect",
        True,
        "Light bounced off surfaces, and from the world.",
        Panel.LIGHT,
        cost="most of the time of a pass",
    )
    indirect_amount: float = _setting(
        "Indirect Amount", 1.0, "Factor on diffuse indirect light.", Panel.LIGHT, lo=0.0, hi=10.0, soft_hi=2.0
    )
    use_specular: bool = _setting(
        "Specular",
        True,
        "Reflections of lights and surroundings.",
        Panel.LIGHT,
        cost="one more direction for each pixel and pass",
    )
    specular_amount: float = _setting(
        "Specular Amount", 1.0, "Factor on reflections.", Panel.LIGHT, lo=0.0, hi=10.0, soft_hi=2.0
    )
    specular_aperture: float = _setting(
        "Specular Aperture",
        1.0,
        "Factor on the width of reflections. 1 follows the roughness; small values make everything a mirror.",
        Panel.LIGHT,
        lo=0.0,
        hi=4.0,
        soft_hi=2.0,
    )
    glossy_layers: int = _setting(
        "Glossy Layers",
        8,
        "Surfaces that a sharp reflection is followed to, one after the other; each is shaded as if the camera saw it. "
        "After the last, and in wide reflections, voxels tell what is seen.",
        Panel.LIGHT,
        lo=0,
        hi=64,
        soft_hi=16,
        cost="where reflections are sharp: light at one more surface for each",
    )
    light_falloff: float = _setting(
        "Light Falloff",
        2.0,
        "Exponent k of 1 / distance^k for point, spot and area lights. 2 is physical.",
        Panel.LIGHT,
        lo=0.0,
        hi=4.0,
    )
    max_distance: float = _setting(
        "Maximum Distance",
        0.0,
        "Farthest surface that indirect light and reflections are gathered from. 0: no limit.",
        Panel.LIGHT,
        lo=0.0,
        hi=1e6,
        soft_hi=1000.0,
        unit=Unit.METRE,
    )
    use_shadows: bool = _setting(
        "Shadows", True, "Lights cast shadows.", Panel.SHADOWS, cost="one ray for each light, pixel and pass"
    )
    shadow_amount: float = _setting(
        "Shadow Amount", 1.0, "How dark shadows are. 1 is physical.", Panel.SHADOWS, lo=0.0, hi=1.0
    )
    shadow_mode: str = _setting(
        "Shadow Method",
        "EXACT",
        "How shadows of lights are found.",
        Panel.SHADOWS,
        choices=(
            ("EXACT", "Exact", "Rays to points on the light: shadows of the light's real size, exact at any distance"),
            ("CONE", "Cone", "One cone through the voxels: soft, fast, without noise, approximate"),
        ),
        cost="cones need coarser voxel levels",
    )
    shadow_cone_angle: float = _setting(
        "Shadow Cone Angle",
        0.0,
        "Full angle of shadow cones. 0 takes the light's own size as seen from the surface.",
        Panel.SHADOWS,
        lo=0.0,
        hi=3.0,
        soft_hi=1.0,
        unit=Unit.RADIAN,
    )
    gather_mode: str = _setting(
        "Gather",
        "RAYS",
        "How indirect light is gathered.",
        Panel.LIGHT,
        choices=(
            ("RAYS", "Rays", "Many narrow directions with exact visibility: converges to the right answer"),
            ("CONES", "Cones", "Few wide cones through prefiltered voxels: smooth at once, approximate"),
            ("OCCLUSION", "Ambient Occlusion", "No bounced light: the world, dimmed where surfaces are near"),
        ),
        cost="cones need coarser voxel levels",
    )
    ao_distance: float = _setting(
        "Distance",
        1.0,
        "Surfaces farther than this do not occlude, in mode Ambient Occlusion.",
        Panel.OCCLUSION,
        lo=0.001,
        hi=1e5,
        soft_hi=10.0,
        unit=Unit.METRE,
    )
    viewport_samples: int = _setting(
        "Samples",
        32,
        "Passes that are averaged into the picture of a viewport in shading mode Rendered, when nothing changes.",
        Panel.VIEWPORT,
        lo=1,
        hi=65536,
        soft_hi=1024,
    )
    viewport_fps: int = _setting(
        "Frame Rate",
        0,
        "Frames per second in a viewport while something changes: the resolution follows from it. 0: 30, and 5 where "
        "the graphics driver draws on the CPU.",
        Panel.VIEWPORT,
        lo=0,
        hi=240,
        soft_hi=60,
    )
    viewport_statistics: bool = _setting(
        "Statistics",
        False,
        "The text in a viewport tells what each pass of the picture took, in milliseconds.",
        Panel.VIEWPORT,
    )
    viewport_pass: str = _setting(
        "Pass",
        "COMBINED",
        "What a viewport shows: the picture, a part of its light, a property of what is seen, or voxels.",
        Panel.VIEWPORT,
        choices=(
            ("COMBINED", "Combined", "The picture"),
            ("DIRECT", "Direct", "All light straight from where it is made"),
            ("INDIRECT", "Indirect", "All light that surfaces pass on"),
            ("SPECULAR", "Specular", "All reflections"),
            ("DIFFUSE_DIRECT", "Diffuse Direct", "Diffuse light straight from where it is made"),
            ("DIFFUSE_INDIRECT", "Diffuse Indirect", "Diffuse light that surfaces pass on"),
            ("GLOSSY_DIRECT", "Glossy Direct", "Reflections of where light is made"),
            ("GLOSSY_INDIRECT", "Glossy Indirect", "Reflections of surfaces"),
            ("DIFFUSE_COLOR", "Diffuse Color", "The colour of diffuse reflection"),
            ("EMISSION", "Emission", "Light that surfaces send out themselves"),
            ("ENVIRONMENT", "Environment", "The world"),
            ("NORMAL", "Normal", "Shading normals"),
            ("POSITION", "Position", "Places in the world, in metres"),
            ("DEPTH", "Depth", "Distances from the camera, in metres"),
            ("SHADOW", "Shadow", "Share of the light of lights that no shadow takes"),
            ("AMBIENT_OCCLUSION", "Ambient Occlusion", "How free surfaces are as far as Ambient Occlusion > Distance"),
            ("SAMPLE_COUNT", "Sample Count", "Passes that a pixel has had, of those asked for"),
            ("VOXELS", "Voxels", "Occupied voxels, or blocks of them: see Voxel Level"),
            ("VOXEL_ALBEDO", "Voxel Albedo", "What voxel faces reflect"),
            ("VOXEL_NORMAL", "Voxel Normals", "Normals that voxel faces stand for, from (0, 0, 0) to (1, 1, 1)"),
            ("VOXEL_RADIANCE", "Voxel Radiance", "Light that leaves voxel faces"),
            ("VOXEL_OPACITY", "Voxel Opacity", "How much of a voxel's side its surfaces cover"),
            ("VOXEL_EMISSION", "Voxel Emission", "Light that surfaces in voxels send out themselves"),
        ),
        cost="little",
    )
    viewport_level: int = _setting(
        "Voxel Level",
        0,
        "Which blocks pass Voxels shows: of 2^level voxels a side.",
        Panel.VIEWPORT,
        lo=0,
        hi=8,
    )
    time_limit: float = _setting(
        "Time Limit",
        0.0,
        "Stop after this time with the passes done so far, in viewports too. 0: no limit.",
        Panel.PERFORMANCE,
        lo=0.0,
        hi=1e6,
        soft_hi=3600.0,
        unit=Unit.SECOND,
    )
    debug_checks: bool = _setting(
        "Debug Checks",
        False,
        "What each pass has written is read back and checked: finite, in range, nothing lost. The first thing that "
        "cannot be ends the render, with an error that names it.",
        Panel.PERFORMANCE,
        cost="much: all that is made is read back",
    )

    @classmethod
    def declarations(cls) -> dict[str, Setting]:
        """All settings by name, in the order of this file."""
        return {f.name: dataclasses.replace(f.metadata["setting"], name=f.name) for f in dataclasses.fields(cls)}

    def with_values(self, **values: Any) -> Settings:
        """A copy with some values changed. Raises ValueError for an unknown name or a value out of range."""
        known = self.declarations()
        for name, value in values.items():
            if name not in known:
                raise ValueError(f"there is no setting '{name}'; known settings: {', '.join(known)}")
            values[name] = known[name].check(value)
        return dataclasses.replace(self, **values)

    def with_texts(self, assignments: dict[str, str]) -> Settings:
        """As :meth:`with_values`, from texts of a command line."""
        known = self.declarations()
        parsed = {}
        for name, text in assignments.items():
            if name not in known:
                raise ValueError(f"there is no setting '{name}'; known settings: {', '.join(known)}")
            parsed[name] = known[name].parse(text)
        return dataclasses.replace(self, **parsed)


#: What each preset changes from the defaults.
PRESETS: dict[str, dict[str, Any]] = {
    "draft": {
        "samples": 8,
        "gather_interval": 2,
        "reuse_frames": True,
        "bounces": 128,
        "bounce_rays": 4,
        "memory_budget": 14,
    },
    "balanced": {},
    "final": {"samples": 128, "noise_threshold": 0.003, "bounces": 512, "bounce_rays": 16, "memory_budget": 192},
}


def preset(name: str) -> Settings:
    """The settings of a preset. Raises KeyError for an unknown name."""
    return Settings(**PRESETS[name])
