# SPDX-License-Identifier: GPL-3.0-or-later
"""The command ``scripts/soak``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence


def main(texts: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="soak", description="Renders and edits again and again. The exit status is 0 only if neither memory nor "
        "the number of GL objects grows.",
    )  # fmt: skip
    parser.add_argument("--renders", type=int, default=1000, help="pictures in one Blender (default: %(default)s)")
    parser.add_argument("--edits", type=int, default=4000, help="edits in a viewport (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="another seed, other changes (default: %(default)s)")
    given = parser.parse_args(list(texts))
    from . import edits, renders  # Blender is not needed for --help

    failed = False
    for name, module, count in (("edits", edits, given.edits), ("renders", renders, given.renders)):
        if count:
            record = module.run(count, given.seed)
            print(f"{name}: {record.summary()}", file=sys.stderr)
            for problem in record.problems():
                print(f"{name}: {problem}", file=sys.stderr)
                failed = True
    return 1 if failed else 0
