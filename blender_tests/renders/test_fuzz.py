# SPDX-License-Identifier: GPL-3.0-or-later
"""Some damaged files (``scripts/fuzz``), and the same work again and again (``scripts/soak``), in short."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("bpy")

from blender_tests.fuzz import run, worker
from blender_tests.soak import edits, renders
from blender_tests.soak.measure import Record

pytestmark = pytest.mark.once


def test_damaged_files_break_nothing(tmp_path: Path) -> None:
    report = run.fuzz(1000.0, 1, tmp_path, most=24)
    assert report.cases == 24
    assert not [finding for finding in report.findings if finding.ours], report.findings


def test_a_defect_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One whose message is a sentence, too."""
    monkeypatch.setattr(run.Worker, "render", lambda *_: {"end": "refused: " + worker.OURS[0], "ours": True})
    report = run.fuzz(0.01, 1, tmp_path, "text.obj")
    assert [finding.ours for finding in report.findings] == [True] * report.cases
    assert list(tmp_path.glob("1_0_text.obj/text.obj")), "the file is kept"


def test_nothing_piles_up_in_edits() -> None:
    assert [text for text in edits.run(60).problems() if "objects" in text] == []


def test_nothing_piles_up_in_renders() -> None:
    assert [text for text in renders.run(16).problems() if "objects" in text] == []


PROGRAMS = [min(number, 250) for number in range(400)]  # of the 400 times 250 compile one


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (Record([(500 + 0) << 20] * 400, [{"Texture": 3}] * 400), []),
        (Record([(500 << 20) + 100_000 * number for number in range(400)]), ["memory grows by"]),
        (Record([(500 << 20) + 100_000_000 * (number % 7) for number in range(400)]), []),
        (Record([(500 << 20) + 500_000 * count for count in PROGRAMS], programs=PROGRAMS), []),
        (Record([(500 << 20) + 100_000 * number for number in range(400)], programs=PROGRAMS), ["memory grows by"]),
        (Record([1 << 20] * 8, [{"Texture": number} for number in range(8)]), ["objects of kind Texture were 2"]),
    ],
)
def test_what_grows_is_said(record: Record, words: list[str]) -> None:
    problems: list[Any] = record.problems()
    assert len(problems) == len(words)
    assert all(text.startswith(word) for text, word in zip(problems, words, strict=True))
