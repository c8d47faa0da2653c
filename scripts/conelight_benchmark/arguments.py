# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of ``scripts/benchmark``.

Standard library only, and written for old Pythons, because it runs before the set-up.
"""

from __future__ import annotations

import argparse
import os
from typing import NamedTuple, Optional, Sequence, Tuple

from conelight_cli.arguments import PRESET_NAMES, resolution

CACHE_VARIABLE = "CONELIGHT_BENCHMARK_CACHE"
PARTS = ("references", "stills", "sequences")


class Arguments(NamedTuple):
    """A checked command line. Patterns are of the shell's kind."""

    quick: bool
    scenes: Tuple[str, ...]
    peers: Tuple[str, ...]
    presets: Tuple[str, ...]
    only: Tuple[str, ...]
    resolution: Optional[Tuple[int, int]]
    reference_samples: Optional[int]
    output: str
    cache: str
    list: bool


def parser(root: str) -> argparse.ArgumentParser:
    """The options, with their help. ``root``: folder of the checkout."""
    made = argparse.ArgumentParser(
        prog="benchmark",
        description="Renders scenes with Conelight, Cycles and EEVEE, and reports time and error against path-traced "
        "references. What is finished is kept: an interrupted run goes on where it was.",
        allow_abbrev=False,
    )
    folder = os.path.join(root, ".benchmark")
    add = made.add_argument
    add("--quick", action="store_true", help="few scenes and peers, small pictures: under five minutes on two cores")
    add("--scenes", metavar="NAME", nargs="+", default=[], help="names or patterns such as 'furnace*' (default: all)")
    add("--peers", metavar="NAME", nargs="+", default=[], help="names or patterns such as 'cycles-4*' (default: all)")
    add("--presets", nargs="+", choices=PRESET_NAMES, default=list(PRESET_NAMES), help="of Conelight (default: all)")
    add("--only", nargs="+", choices=PARTS, default=list(PARTS),
        help="references: only render what is missing of them; stills; sequences: a moving camera (default: all)")
    add("--resolution", metavar="WxH", type=resolution, help="size of all pictures (default: the scene's)")
    add("--reference-samples", metavar="N", type=int, help="of each of the two halves of a reference")
    add("--output", metavar="FOLDER", default=os.path.join(folder, "report"), help="default: %(default)s")
    add("--cache", metavar="FOLDER", default=os.environ.get(CACHE_VARIABLE) or os.path.join(folder, "cache"),
        help="where scenes, references and measurements are kept; also $" + CACHE_VARIABLE + " (default: %(default)s)")
    add("--list", action="store_true", help="list scenes and peers, and stop")
    return made


def parse(texts: Sequence[str], root: str) -> Arguments:
    """A checked command line. Ends the process with status 2 and a sentence when it is wrong, as argparse does."""
    made = parser(root)
    values = made.parse_args(list(texts))
    if values.reference_samples is not None and values.reference_samples < 1:
        made.error("--reference-samples: at least 1")
    for name in ("scenes", "peers", "presets", "only"):
        setattr(values, name, tuple(getattr(values, name)))
    return Arguments(**vars(values))
