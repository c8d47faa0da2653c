# SPDX-License-Identifier: GPL-3.0-or-later
"""All settings as a table: as text for ``--list-settings``, as Markdown for the README."""

from __future__ import annotations

from typing import Any

from addon.settings import Setting, Settings

COLUMNS = ("name", "default", "range", "unit", "cost", "help")


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _range(setting: Setting) -> str:
    if setting.choices:
        return ", ".join(identifier for identifier, _, _ in setting.choices)
    if setting.kind is bool:
        return "on, off"
    if setting.lo is None and setting.hi is None:
        return ""
    low, high = ("" if bound is None else f"{bound:.10g}" for bound in (setting.lo, setting.hi))
    return f"{low} to {high}" if low and high else f"at least {low}" if low else f"at most {high}"


def _help(setting: Setting) -> str:
    choices = "; ".join(f"{identifier}: {text}" for identifier, _, text in setting.choices)
    return f"{setting.help} {choices}." if choices else setting.help


def rows() -> list[tuple[str, ...]]:
    """One row of COLUMNS for each setting."""
    return [
        (name, _value(setting.default), _range(setting), setting.unit.value, setting.cost, _help(setting))
        for name, setting in Settings.declarations().items()
    ]


def as_text() -> str:
    """Aligned columns for a terminal."""
    table = [COLUMNS, *rows()]
    widths = [max(len(row[column]) for row in table) for column in range(len(COLUMNS) - 1)]
    lines = []
    for row in table:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        lines.append("  ".join([*cells, row[-1]]).rstrip())
    return "\n".join(lines)


def as_markdown() -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + " --- |" * len(COLUMNS)]
    for name, *cells in rows():
        lines.append(" | ".join([f"| `{name}`", *(cell.replace("|", "\\|") for cell in cells)]) + " |")
    return "\n".join(lines)


BEGIN = "<!-- settings: written by scripts/update_readme -->"
END = "<!-- end of settings -->"


def with_table(readme: str) -> str:
    """The text of the README with the table of today between its marks. Raises ValueError if a mark is missing."""
    before, begin, rest = readme.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"README.md needs the marks '{BEGIN}' and '{END}' around the table of settings")
    return f"{before}{BEGIN}\n{as_markdown()}\n{END}{after}"
