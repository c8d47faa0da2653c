# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of scripts/render, which other programs rely on."""

from __future__ import annotations

import pytest
from conelight_cli import arguments

from addon.settings import PRESETS


def refused(capsys: pytest.CaptureFixture[str], *texts: str) -> str:
    """What is said about a wrong command line."""
    with pytest.raises(SystemExit) as end:
        arguments.parse(texts)
    assert end.value.code == 2
    return capsys.readouterr().err.splitlines()[-1]


def test_defaults() -> None:
    parsed = arguments.parse(["some/where/atrium.blend"])
    assert parsed.output == "atrium.png"
    assert parsed.engine == "conelight"
    assert parsed.preset is None
    assert parsed.assignments == ()
    assert not parsed.passes
    assert not parsed.enable_autoexec


def test_everything_together() -> None:
    parsed = arguments.parse(
        "a.usdz -o out/b.EXR --engine cycles --preset final --resolution 64x36 --samples 3 --voxels 48 --camera Cam "
        "--frames 2-5 --view-layer Front --passes --set bounces=3 --set shadow_mode=CONE --stats s.json "
        "--time-limit 2.5 --skip-existing --enable-autoexec".split()
    )
    assert parsed == arguments.Arguments(
        scene="a.usdz", output="out/b.EXR", engine="cycles", preset="final", resolution=(64, 36), samples=3, voxels=48,
        camera="Cam", frames=(2, 5), view_layer="Front", passes=True,
        assignments=(("bounces", "3"), ("shadow_mode", "CONE")), stats="s.json", time_limit=2.5, skip_existing=True,
        enable_autoexec=True, list_settings=False,
    )


def test_passes_default_to_exr() -> None:
    assert arguments.parse(["a.obj", "--passes"]).output == "a.exr"


def test_listing_needs_no_scene() -> None:
    assert arguments.parse(["--list-settings"]).list_settings


def test_preset_names_are_those_of_the_settings() -> None:
    assert set(arguments.PRESET_NAMES) == set(PRESETS)


@pytest.mark.parametrize(
    "texts, words",
    [
        ([], "no SCENE given"),
        (["a.obj", "--skip-existing"], "--skip-existing needs --frames"),
        (["scene.fbx"], "'scene.fbx': unknown extension '.fbx'; known: .blend"),
        (["scene"], "unknown extension ''"),
        (["a.obj", "-o", "b.gif"], "'b.gif': unknown extension '.gif'; known: .exr .png"),
        (["a.obj", "-o", "b.png", "--passes"], "'b.png': --passes needs a file that ends in .exr"),
        (["a.obj", "--resolution", "640"], "'640' is not WIDTHxHEIGHT"),
        (["a.obj", "--resolution", "0x10"], "'0x10' is not WIDTHxHEIGHT"),
        (["a.obj", "--samples", "0"], "'0' is not a whole number of at least 1"),
        (["a.obj", "--samples", "-3"], "'-3' is not a whole number"),
        (["a.obj", "--voxels", "1.5"], "'1.5' is not a whole number"),
        (["a.obj", "--frames", "9-2"], "the last frame comes before the first"),
        (["a.obj", "--frames", "x"], "'x' is not FIRST-LAST"),
        (["a.obj", "--time-limit", "nan"], "'nan' is not a number of seconds"),
        (["a.obj", "--set", "bounces"], "'bounces' is not NAME=VALUE"),
        (["a.obj", "--engine", "luxcore"], "invalid choice: 'luxcore'"),
        (["a.obj", "--preset", "best"], "invalid choice: 'best'"),
        (["a.obj", "--sample", "3"], "unrecognized arguments"),
    ],
)
def test_mistakes_are_named(capsys: pytest.CaptureFixture[str], texts: list[str], words: str) -> None:
    assert words in refused(capsys, *texts)


@pytest.mark.parametrize(
    "output, frame, path",
    [
        ("name.exr", 3, "name_0003.exr"),
        ("folder.d/name.png", 12345, "folder.d/name_12345.png"),
        ("name_##.png", 7, "name_07.png"),
        ("a#.png", 11, "a11.png"),
    ],
)
def test_frame_files(output: str, frame: int, path: str) -> None:
    assert arguments.frame_path(output, frame) == path
