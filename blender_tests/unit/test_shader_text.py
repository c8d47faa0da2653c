# SPDX-License-Identifier: GPL-3.0-or-later
"""Includes, defines and line numbers of shaders, and the rules that all of them keep."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from addon.gpu.program import ShaderError, resolve, shader_root

ROOT = Path(__file__).resolve().parents[2] / "shaders"
FILES = sorted(path.relative_to(ROOT).as_posix() for path in ROOT.rglob("*.glsl"))
#: Includes that passes generate, and what they hold at least.
GENERATED = {"material": "", "world": "", "fields": ""}


def test_shaders_lie_beside_the_add_on() -> None:
    assert shader_root() == ROOT
    assert any(name.startswith("passes/") for name in FILES) and any(name.startswith("tests/") for name in FILES)


def test_the_readme_names_every_pass_and_every_library_file() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    passes = {path.name.partition(".")[0] for path in (ROOT / "passes").iterdir()}
    passes |= {path.name for path in (ROOT.parent / "addon" / "passes").glob("[!_]*.py")}
    library = {path.name for path in (ROOT / "lib").iterdir()}
    assert [name for name in sorted(passes | library) if f"`{name}`" not in text] == []


@pytest.mark.parametrize("name", FILES)
def test_every_include_exists_and_comes_once(name: str) -> None:
    source = resolve(name, {}, GENERATED)
    assert len(source.files) == len(set(source.files))
    assert "#include" not in source.text
    assert source.text.count("\n#version") == 0 and source.text.startswith("#version 430 core\n")


@pytest.mark.parametrize("name", FILES)
def test_conventions(name: str) -> None:
    """Licence first, a line that says what it is, no tabs, ends with one newline."""
    text = (ROOT / name).read_text(encoding="utf-8")
    lines = text.splitlines()
    assert lines[0] == "// SPDX-License-Identifier: GPL-3.0-or-later" or lines[0].startswith("// ")
    if not name.endswith(".vert.glsl"):
        assert lines[1].startswith("// ")
    assert "\t" not in text and text.endswith("\n") and not text.endswith("\n\n")
    assert not [line for line in lines if line != line.rstrip()]


@pytest.mark.parametrize("name", [name for name in FILES if not name.startswith("lib/")])
def test_programs_name_their_storage(name: str) -> None:
    """Buffers are declared std430; what a program only reads or only writes is declared so."""
    text = (ROOT / name).read_text(encoding="utf-8")
    for declaration in re.findall(r"^layout\(.*\bbuffer\b.*$", text, re.MULTILINE):
        assert "std430" in declaration


def test_a_missing_file_is_named() -> None:
    with pytest.raises(ShaderError, match=r"passes/nothing\.comp\.glsl"):
        resolve("passes/nothing.comp.glsl", {})


def test_defines_and_messages() -> None:
    """Booleans become 0 and 1; a compiler's numbers become names of files, whichever way it writes them."""
    source = resolve("passes/transform.comp.glsl", {"HAS_THIS": True, "HAS_THAT": False, "NUMBER": 7})
    for line in ("#define HAS_THIS 1", "#define HAS_THAT 0", "#define NUMBER 7"):
        assert line + "\n" in source.text
    number = source.files.index("lib/common.glsl")
    for message in (f"{number}:41(7): error: bad", f"{number}(41) : error C1: bad", f"ERROR: {number}:41: bad"):
        assert "shaders/lib/common.glsl:41" in source.explain(message)


def test_line_numbers_are_those_of_the_files() -> None:
    """The text after each #line is the line of the file that it says."""
    for name in FILES:
        source = resolve(name, {}, GENERATED)
        current, number = None, 0
        for line in source.text.splitlines():
            match = re.match(r"#line (\d+) (\d+)$", line)
            if match:
                current, number = source.files[int(match[2])], int(match[1])
                continue
            if current in FILES:
                expected = (ROOT / current).read_text(encoding="utf-8").splitlines()
                assert line == expected[number - 1], f"{current}:{number}"
            number += 1


def test_generated_text_is_included() -> None:
    source = resolve("passes/world.comp.glsl", {}, {"world": "vec3 evaluate_world(vec3 d) { return d; }"})
    assert "vec3 evaluate_world(vec3 d) { return d; }" in source.text
