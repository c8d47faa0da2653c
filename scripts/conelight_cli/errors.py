# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends the command line."""

from __future__ import annotations

USAGE = 2  # exit status: the command line itself is wrong
FAILED = 1  # exit status: everything else


class CommandError(Exception):
    """A sentence for the user that names a file, an object or an option; the script ends with ``status``."""

    def __init__(self, sentence: str, status: int = FAILED) -> None:
        super().__init__(sentence)
        self.status = status


def reason(error: BaseException) -> str:
    """What an error of a Blender operator says, on one line, without Blender's decoration."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    if any(line.startswith("Traceback") or "Traceback (most recent call last)" in line for line in lines):
        lines = lines[-1:]  # an importer written in Python: the last line is the exception itself
    return "; ".join(line.removeprefix("Error: ").rstrip(".") for line in lines) or type(error).__name__
