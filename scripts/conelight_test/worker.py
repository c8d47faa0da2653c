# SPDX-License-Identifier: GPL-3.0-or-later
"""One pytest process: runs the arguments after the first, and writes the counts as JSON into the first.

It ends with ``os._exit``, because a process in which Blender 4.5 used the GPU hangs in the ordinary way out.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import pytest


class Counter:
    """Pytest plugin: how many tests passed, failed (errors and unexpected passes included) and were skipped."""

    def __init__(self) -> None:
        self.counts = {"passed": 0, "failed": 0, "skipped": 0}

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        kinds = {
            "passed": ("passed",), "failed": ("failed", "error", "xpassed"), "skipped": ("skipped", "xfailed"),
        }
        for total, names in kinds.items():
            self.counts[total] = sum(len(terminalreporter.stats.get(name, ())) for name in names)


def main(results: str, arguments: list[str]) -> None:
    counter = Counter()
    status = int(pytest.main(arguments, plugins=[counter]))
    with open(results, "w", encoding="ascii") as file:
        json.dump({**counter.counts, "status": status}, file)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
