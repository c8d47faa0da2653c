# SPDX-License-Identifier: GPL-3.0-or-later
"""What numbers faces have become after an edit, run by run."""

from __future__ import annotations

import numpy as np
import pytest

from addon.gpu.interface import NO_SHIFT, NONE_INDEX, NUMBER_RUN
from addon.passes.face_changes import shifts_of_runs


@pytest.mark.parametrize("count", [0, 1, NUMBER_RUN, 10 * NUMBER_RUN + 7])
def test_shifts_tell_what_numbers_become(count: int) -> None:
    """Faces go, and others come: looked up as the shader does, each has its number."""
    stays = np.ones(count, bool)
    stays[3 * NUMBER_RUN + 5 : 3 * NUMBER_RUN + 9] = False
    stays[5 * NUMBER_RUN :: 70] = False
    come = np.zeros(count, np.int64)
    come[2 * NUMBER_RUN - 1 :] = 12
    numbers = np.where(stays, np.cumsum(stays) - 1 + come, NONE_INDEX).astype(np.uint32)
    shifts = shifts_of_runs(numbers)
    assert shifts.dtype == np.uint32 and len(shifts) == -(-count // NUMBER_RUN)
    faces = np.arange(count, dtype=np.uint32)
    shift = shifts[faces // NUMBER_RUN]
    assert (np.where(shift == NO_SHIFT, numbers, faces + shift) == numbers).all()
    if count > NUMBER_RUN:
        assert shifts[0] == 0 and shifts[1] == NO_SHIFT and shifts[2] == 12 and shifts[3] == NO_SHIFT
        assert shifts[4] == 8 and (shifts[5:10] == NO_SHIFT).all()


def test_faces_that_are_gone_have_no_shift() -> None:
    gone = np.full(NUMBER_RUN + 1, NONE_INDEX, np.uint32)
    assert (shifts_of_runs(gone) == NO_SHIFT).all()
