# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader sources: where they are, includes, defines, and errors that name the line at fault."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from . import interface

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')


class ShaderError(RuntimeError):
    """A shader that could not be built. The text names file, line and defines."""


@functools.cache
def shader_root() -> Path:
    """The folder ``shaders``: inside the package when installed, beside it in the source tree."""
    package = Path(__file__).resolve().parent.parent
    for root in (package / "shaders", package.parent / "shaders"):
        if root.is_dir():
            return root
    raise ShaderError(f"the folder 'shaders' is missing beside {package}: install the add-on again")


@functools.cache
def _read(name: str) -> str:
    try:
        return (shader_root() / name).read_text(encoding="utf-8")
    except OSError as error:
        raise ShaderError(f"shader file '{name}' cannot be read: {error.strerror}") from error


@dataclass
class Source:
    """A shader with its includes resolved; ``files`` translates the numbers in compiler messages."""

    text: str
    files: list[str] = field(default_factory=list)

    def explain(self, message: str) -> str:
        """A compiler's message with file names for numbers."""

        def name(match: re.Match[str]) -> str:
            number = int(match.group(1))
            file = self.files[number] if number < len(self.files) else match.group(1)
            return f"shaders/{file}:{match.group(2)}"

        # Mesa: "3:41(7): error"; NVIDIA: "3(41) : error"; AMD and Intel: "ERROR: 3:41:".
        message = re.sub(r"\b(\d+):(\d+)\(\d+\)", name, message)
        message = re.sub(r"\b(\d+)\((\d+)\) ?:", name, message)
        return re.sub(r"(?<=ERROR: )(\d+):(\d+)", name, message)


def resolve(name: str, defines: Mapping[str, object], texts: Mapping[str, str] | None = None) -> Source:
    """The text of shader ``name`` for the compiler.

    ``texts`` maps names of includes to generated text, which takes the place of a file. Each file is included once,
    where it comes first: what is needed always must not come first inside an #if.
    Raises ShaderError for a missing file.
    """
    source = Source("", ["<prelude>"])
    done: set[str] = set()

    def expand(file: str) -> list[str]:
        if file in done:
            return []
        done.add(file)
        number = len(source.files)
        source.files.append(file)
        lines = [f"#line 1 {number}"]
        text = texts[file] if texts and file in texts else _read(file)
        for index, line in enumerate(text.splitlines(), start=1):
            match = _INCLUDE.match(line)
            if match:
                lines += [*expand(match.group(1)), f"#line {index + 1} {number}"]
            else:
                lines.append(line)
        return lines

    head = ["#version 430 core", *(f"#define {key} {_glsl(value)}" for key, value in sorted(defines.items()))]
    source.text = "\n".join([*head, interface.prelude(), *expand(name)]) + "\n"
    return source


def _glsl(value: object) -> str:
    if isinstance(value, bool):
        return "1" if value else "0"
    return str(value)
