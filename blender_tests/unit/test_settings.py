# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings, presets and the table of passes: what needs neither Blender nor GL."""

from __future__ import annotations

import dataclasses
import types

import numpy as np
import pytest

from addon.host import film, presets
from addon.settings import PRESETS, Panel, Settings, preset

DECLARATIONS = Settings.declarations()


@pytest.mark.parametrize("name", DECLARATIONS)
def test_declaration_is_complete(name: str) -> None:
    setting = DECLARATIONS[name]
    assert setting.name == name
    assert setting.label and setting.help.endswith((".", ")")) and isinstance(setting.panel, Panel)
    assert setting.check(setting.default) == setting.default
    assert setting.kind in (bool, int, float, str)
    if setting.kind in (int, float):
        assert setting.lo is not None and setting.hi is not None and setting.lo <= setting.default <= setting.hi
        assert setting.soft_hi is None or setting.default <= setting.soft_hi <= setting.hi
    if setting.kind is str:
        assert setting.choices, "a text setting without choices has no control in the panel"


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("samples", "64", 64), ("max_distance", "2.5", 2.5), ("max_distance", "3", 3.0), ("use_shadows", "off", False),
        ("use_shadows", "Yes", True), ("gather_mode", "CONES", "CONES"), ("voxel_resolution", " 256 ", 256),
    ],
)  # fmt: skip
def test_text_becomes_value(name: str, text: str, value: object) -> None:
    settings = Settings().with_texts({name: text})
    assert getattr(settings, name) == value and type(getattr(settings, name)) is type(value)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("samples", "0", "1 to 65536"), ("samples", "2.5", "whole number"), ("samples", "many", "'many'"),
        ("light_falloff", "5", "0 to 4"), ("light_falloff", "nan", "number"), ("use_direct", "perhaps", "on or off"),
        ("gather_mode", "MAGIC", "RAYS, CONES"), ("max_distance", "-1", "(m)"), ("voxels", "64", "no setting 'voxels'"),
    ],
)  # fmt: skip
def test_bad_text_is_explained(name: str, text: str, said: str) -> None:
    with pytest.raises(ValueError) as error:
        Settings().with_texts({name: text})
    assert said in str(error.value) and (name in str(error.value))


def test_values_keep_their_type() -> None:
    assert type(Settings().with_values(max_distance=3).max_distance) is float
    for bad in ({"samples": True}, {"use_direct": 1}, {"samples": 1.5}, {"seed": "1"}):
        with pytest.raises(ValueError):
            Settings().with_values(**bad)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Settings().samples = 3  # type: ignore[misc]


def test_presets_are_valid_and_ordered() -> None:
    assert list(PRESETS) == ["draft", "balanced", "final"]
    assert preset("balanced") == Settings()
    for name, values in PRESETS.items():
        assert Settings().with_values(**values) == preset(name)
    for governed in presets.GOVERNED:
        amounts = [getattr(preset(name), governed) for name in PRESETS]
        saves = governed in ("gather_interval", "reuse_frames")
        assert amounts == sorted(amounts, reverse=saves), f"{governed}: a better preset does not do less"


def test_preset_is_read_off_the_values() -> None:
    values = types.SimpleNamespace(**dataclasses.asdict(Settings()))
    assert presets.matching_preset(values) == "balanced"
    for name in (*PRESETS, "draft"):
        presets.apply_preset(values, name)
        assert presets.matching_preset(values) == name
    values.use_shadows = False  # not a matter of quality: presets leave it
    assert presets.matching_preset(values) == "draft"
    presets.apply_preset(values, "final")
    assert not values.use_shadows
    values.samples += 1
    assert presets.matching_preset(values) == presets.CUSTOM
    before = vars(values).copy()
    presets.apply_preset(values, presets.CUSTOM)
    assert vars(values) == before


def test_pass_names_follow_the_version() -> None:
    names = {version: [p.blender_name(version) for p in film.PASSES] for version in ((4, 5, 15), (5, 0, 0), (5, 2, 3))}
    assert names[4, 5, 15] == [
        "Combined", "Depth", "Position", "Normal", "DiffDir", "DiffInd", "DiffCol", "GlossDir", "GlossInd", "GlossCol",
        "Emit", "Env",
    ]  # fmt: skip
    assert names[5, 2, 3] == names[5, 0, 0] == [
        "Combined", "Depth", "Position", "Normal", "Diffuse Direct", "Diffuse Indirect", "Diffuse Color",
        "Glossy Direct", "Glossy Indirect", "Glossy Color", "Emission", "Environment",
    ]  # fmt: skip
    assert {p.panel for p in film.PASSES} == {"Data", "Light"}
    assert [p.kind for p in film.PASSES[:4]] == ["COLOR", "VALUE", "VECTOR", "VECTOR"]


class FakeRect(list):
    def foreach_set(self, values: np.ndarray) -> None:
        self.values = np.asarray(values)


def fake_pass(name: str, channels: int, pixels: int) -> types.SimpleNamespace:
    return types.SimpleNamespace(name=name, channels=channels, rect=FakeRect([None] * pixels))


def test_writing_passes() -> None:
    picture = np.arange(2 * 3 * 4, dtype=np.float32).reshape(2, 3, 4)
    passes = [fake_pass("Combined", 4, 6), fake_pass("DiffDir", 3, 6), fake_pass("Mist", 1, 6), fake_pass("Env", 3, 6)]
    missing = film.write_passes(passes, ("combined", "diffuse_direct"), lambda name: picture, (4, 5, 0))
    assert missing == ["Mist", "Env"]
    assert passes[0].rect.values.tolist() == list(range(24)) and passes[0].rect.values.dtype == np.float32
    assert passes[1].rect.values.reshape(2, 3, 3).tolist() == picture[:, :, :3].tolist()
    with pytest.raises(ValueError, match="3 x 2 pixels does not fit the 7 pixels"):
        film.write_passes([fake_pass("Combined", 4, 7)], ("combined",), lambda name: picture, (5, 2, 0))


def test_channels_are_fitted() -> None:
    grey = np.full((1, 1, 1), 0.25, np.float32)
    assert film.with_channels(grey, 3).tolist() == [[[0.25, 0.25, 0.25]]]
    assert film.with_channels(grey, 4).tolist() == [[[0.25, 0.25, 0.25, 1.0]]]
    color = np.array([[[1, 2, 3]]], np.float32)
    assert film.with_channels(color, 4).tolist() == [[[1, 2, 3, 1]]]
    assert film.with_channels(color, 1).tolist() == [[[1]]]
