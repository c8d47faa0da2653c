# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends the command line, and its messages."""

from __future__ import annotations

import sys

USAGE = 2  # exit status: the command line itself is wrong
FAILED = 1  # exit status: everything else


class CommandError(Exception):
    """A sentence for the user that names a file, an object or an option; the script ends with ``status``."""

    def __init__(self, sentence: str, status: int = FAILED) -> None:
        super().__init__(sentence)
        self.status = status


def say(text: str) -> None:
    """A message for the user. Messages go to stderr."""
    print(text, file=sys.stderr, flush=True)
