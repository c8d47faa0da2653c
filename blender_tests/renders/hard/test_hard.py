# SPDX-License-Identifier: GPL-3.0-or-later
"""Hard cases: finite, as bright as the answer, the same bits on a repeat, and as bright elsewhere, turned, larger."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

pytest.importorskip("bpy")

from addon.gpu.context import GpuContext
from blender_tests.pictures import Picture

from . import answers, measure
from .case import VARIANTS, Case
from .catalogue import CASES

pytestmark = pytest.mark.once


def _checks() -> Iterator[object]:
    for case in CASES.values():
        for check in case.checks:
            reason = case.missed.get(check)
            missed = [pytest.mark.xfail(strict=True, reason=reason)] if reason else []
            yield pytest.param(case, check, id=f"{case.name}-{check}", marks=missed)


@pytest.fixture(scope="module")
def render() -> Iterator[Callable[[Case, str, int], Picture]]:
    """A function (case, variant, how often before) -> picture; what has been rendered of the last case is kept."""
    gpu = GpuContext.standalone()
    made: dict[tuple[str, str, int], Picture] = {}

    def picture(case: Case, variant: str = "", repeat: int = 0) -> Picture:
        key = (case.name, variant, repeat)
        if key not in made:
            for other in [k for k in made if k[0] != case.name]:
                del made[other]
            made[key] = measure.conelight(gpu, case, variant, debug_checks=not (variant or repeat))
        return made[key]

    yield picture
    gpu.release()


@pytest.mark.parametrize(("case", "check"), list(_checks()))
def test_case(case: Case, check: str, render: Callable[..., Picture]) -> None:
    picture = render(case)
    found = measure.parts(picture)
    if check == "finite":
        assert np.isfinite(picture).all() and (picture >= 0.0).all()
    elif check == "repeat":
        again = render(case, repeat=1)
        assert (again.view(np.uint32) == picture.view(np.uint32)).all()
    elif check in VARIANTS:
        elsewhere = measure.parts(render(case, check))
        assert abs(measure.deviation(elsewhere[0], found[0], case.exact)) <= case.bound
    else:
        answer = answers.of(case, found)
        if check == "brightness":
            assert abs(measure.deviation(found[0], answer[0])) <= case.bound
        else:
            assert measure.worst_part(found, answer) <= case.parts_bound


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.exact is None])
def test_stored_answer_is_of_this_scene(name: str) -> None:
    stored = answers.read().get(CASES[name].same_as or name)
    assert stored is not None, answers.COMMAND
    assert stored["scene"] == measure.fingerprint(measure.set_up(CASES[CASES[name].same_as or name])), answers.COMMAND
