# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of all settings, on the terminal and in the README."""

from __future__ import annotations

import pathlib

from conelight_cli import settings_table

from addon.settings import Settings

README = pathlib.Path(__file__).parents[2] / "README.md"


def test_every_setting_has_a_row() -> None:
    assert [row[0] for row in settings_table.rows()] == list(Settings.declarations())


def test_rows_say_what_is_declared() -> None:
    rows = {row[0]: row for row in settings_table.rows()}
    assert rows["samples"][1:3] == ("16", "1 to 65536")
    assert rows["voxel_auto"][1:3] == ("on", "on, off")
    assert rows["memory_budget"][3] == "MiB"
    assert rows["gather_mode"][2] == "RAYS, CONES, OCCLUSION"
    assert "CONES: " in rows["gather_mode"][5]


def test_text_is_aligned() -> None:
    header, *lines = settings_table.as_text().splitlines()
    at = header.index("default")
    assert all(line[at - 1] == " " and line[at] != " " for line in lines)


def test_the_readme_has_the_table_of_today() -> None:
    text = README.read_text(encoding="utf-8")
    assert text == settings_table.with_table(text), "scripts/update_readme writes the table anew"
