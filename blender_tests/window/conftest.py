# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests in a window share."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).parents[2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return tmp_path_factory.mktemp("window")


@pytest.fixture(scope="module")
def archive() -> str:
    """The zip that users install."""
    command = [sys.executable, str(ROOT / "scripts" / "build_extension")]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=240).stdout.strip()
