# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as they were before: a small one of each scene of the catalogue against the stored one.

Ends with a page of all of them, ``blender_tests/output/index.html``. Accepting new ones: ``blender_tests/README.md``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("bpy")

from blender_tests import diff_page
from blender_tests.scenes import rendering
from blender_tests.scenes.catalogue import SCENES

SAMPLES = 8
#: References are of this rasterizer: others round differently, and may only be asked to be near Cycles.
RASTERIZER = "llvmpipe"


@pytest.fixture(scope="module")
def comparisons() -> Iterator[list[diff_page.Comparison]]:
    """Collects the rows of the page."""
    rows: list[diff_page.Comparison] = []
    yield rows
    print(f"\nNew, reference and difference: {diff_page.write_page(rows)}")


@pytest.mark.parametrize("name", SCENES)
def test_picture(name: str, comparisons: list[diff_page.Comparison]) -> None:
    scene = SCENES[name]
    scene.build()
    picture = rendering.conelight(scene.size, samples=SAMPLES, **scene.settings)
    assert np.isfinite(picture).all()
    renderer = rendering.last_statistics()["renderer"]
    if RASTERIZER not in renderer:
        pytest.skip(f"references are of {RASTERIZER}, this is {renderer}")
    command = f"scripts/test 'blender_tests/renders/test_references.py::test_picture[{name}]'"
    comparison = diff_page.compare(name, picture, command)
    comparisons.append(comparison)
    if comparison.problem is not None:
        pytest.fail(comparison.problem, pytrace=False)


def test_a_difference_is_noticed() -> None:
    """What the comparison itself lets through, and what not."""
    picture = np.full((32, 32, 4), 0.5, np.float32)
    tolerance = diff_page.Tolerance()
    assert diff_page.problem_of(picture, picture.copy(), tolerance) is None
    speck = picture.copy()
    speck[3, 4, 1] = 0.9
    assert diff_page.problem_of(speck, picture, tolerance) is None, "one pixel may have taken another way"
    patch = picture.copy()
    patch[:4, :4, 1] = 0.55
    assert "1.6 % of its pixels differ" in str(diff_page.problem_of(patch, picture, tolerance))
    darker = picture * np.array([0.99, 0.99, 0.99, 1.0], np.float32)
    assert "mean difference" in str(diff_page.problem_of(darker, picture, tolerance))
    seen_through = picture.copy()
    seen_through[0, 0, 3] = 0.0
    assert "alpha" in str(diff_page.problem_of(seen_through, picture, tolerance))
    broken = picture.copy()
    broken[0, 0, 0] = np.nan
    assert "not finite" in str(diff_page.problem_of(broken, picture, tolerance))
    assert "size" in str(diff_page.problem_of(picture[:16], picture, tolerance))
