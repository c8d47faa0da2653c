# SPDX-License-Identifier: GPL-3.0-or-later
"""Cutouts: what is transparent in parts lets light through there and nowhere else, within one cell too."""

from __future__ import annotations

import numpy as np
import pytest

from addon import sharing
from addon.gpu.context import GpuContext
from addon.materials.graph import MaterialData
from addon.scene import LightKind, RayVisibility
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, prepare, sample
from blender_tests.passes.test_edits import GRIDS, NESTED, assert_same, bits, placed, room

SQUARES = 5  # along the sides of the card
SIZE = 60


def chequered(alpha: float = 1.0) -> MaterialData:
    """Squares of opacity ``alpha`` and of 0."""
    return material(
        node("C", "TexCoord"), node("T", "TexChecker", Vector="C.UV", Scale=float(SQUARES)),
        node("A", "Math", Value="T.Fac", Value_001=alpha, p_operation="MULTIPLY"),
        node("P", "BsdfPrincipled", Base_Color=(0.5, 0.5, 0.5, 1.0), Alpha="A.Value"), surface="P.BSDF",
    )  # fmt: skip


def tilted(angle: float) -> np.ndarray:
    matrix = scenes.at(0.03, -0.02, 0.9)
    c, s = np.cos(angle), np.sin(angle)
    matrix[:3, :3] = [[1, 0, 0], [0, c, -s], [0, s, c]]
    return matrix


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.2])
@pytest.mark.parametrize("grid", ["one", "levels", "shared triangles"])
def test_shadows_have_outlines(grid: str, angle: float, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shadow of a chequered card under a sun: each point of the floor is lit or not as the card above it says, but
    for a seam as wide as a seventh of a cell."""
    settings = scenes.settings(40, use_indirect=False)
    if grid == "levels":
        settings = settings.with_values(voxel_levels="ON", voxel_resolution=32, voxel_detail=0.05)
    if grid == "shared triangles":
        monkeypatch.setattr(sharing, "LEAST_SAVED", 0)
    shape, surface = scenes.plane(2.0), chequered()
    made = scenes.scene(
        (scenes.plane(4.0), scenes.diffuse(1.0)),
        (shape, surface, tilted(angle), RayVisibility.ALL & ~RayVisibility.CAMERA),
        (shape, surface, scenes.at(0.0, 0.0, -1.0)),
        lights=[scenes.light(LightKind.SUN, np.pi, direction=(0.0, 0.0, -1.0))],
        camera=scenes.camera((0.0, 0.0, 3.0), width=2.4), pixel_filter_width=0.0,
    )  # fmt: skip
    with pipeline(gpu, made, settings, (SIZE, SIZE), samples=1) as ready:
        assert ready.voxel_light.voxelize.voxels is not None
        defines = ready.voxel_light.voxelize.voxels.trace_defines
        assert defines["HAS_OUTLINES"] and defines["HAS_INSTANCES"] == (grid == "shared triangles")
        lit = ready.film.read("combined")[..., 0]
        position = ready.picture.surface.pictures.position  # type: ignore[union-attr]
        place = np.frombuffer(position.read(), np.float32).reshape(SIZE, SIZE, 4)[..., :2]
        place = place * ready.grid.cell_size + ready.grid.origin[:2]  # type: ignore[union-attr]
    on_card = (place - (0.03, -0.02)) / (1.0, np.cos(angle)) / 2.0 + 0.5
    square = on_card * SQUARES
    opaque = (np.floor(square).sum(axis=-1) % 2 == 1) & (on_card > 0.0).all(axis=-1) & (on_card < 1.0).all(axis=-1)
    seam = 0.03 * SQUARES / 2.0 / np.array([1.0, np.cos(angle)])
    clear = (np.abs(square - np.round(square)) > seam).all(axis=-1)
    assert clear.mean() > 0.4 and opaque[clear].sum() > 150
    np.testing.assert_allclose(lit[clear], np.where(opaque, 0.0, 1.0)[clear], atol=1e-3)


@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_as_much_light_passes_as_is_let_through(alpha: float, gpu: GpuContext) -> None:
    """Mean opacity of a card that covers the whole floor: places that are half transparent stop half of the rays."""
    made = scenes.scene(
        (scenes.plane(4.0), scenes.diffuse(1.0)),
        (scenes.plane(2.0), chequered(alpha), tilted(0.0), RayVisibility.ALL & ~RayVisibility.CAMERA),
        lights=[scenes.light(LightKind.SUN, np.pi, direction=(0.0, 0.0, -1.0))],
        camera=scenes.camera((0.03, -0.02, 3.0), (0.03, -0.02, 0.0), width=2.0), pixel_filter_width=0.0,
    )  # fmt: skip
    with pipeline(gpu, made, scenes.settings(64, use_indirect=False), (SIZE, SIZE), samples=4) as ready:
        lit = ready.film.read_mean("combined")[..., 0].mean()
    assert lit == pytest.approx(1.0 - 12.0 / 25.0 * alpha, abs=0.01)


def test_sheets_in_one_cell_do_not_go_together(gpu: GpuContext) -> None:
    """Two that are about half transparent, a hundredth of a cell apart: a quarter of the light passes both."""
    half = material(
        node("C", "TexCoord"), node("T", "TexChecker", Vector="C.UV", Scale=float(SQUARES)),
        node("A", "Math", Value="T.Fac", Value_001=0.02, p_operation="MULTIPLY"),
        node("B", "Math", Value="A.Value", Value_001=0.49, p_operation="ADD"),
        node("P", "BsdfPrincipled", Base_Color=(0.5, 0.5, 0.5, 1.0), Alpha="B.Value"), surface="P.BSDF",
    )  # fmt: skip
    unseen = RayVisibility.ALL & ~RayVisibility.CAMERA
    made = scenes.scene(
        (scenes.plane(4.0), scenes.diffuse(1.0)),
        (scenes.plane(2.0), half, scenes.at(0.0, 0.0, 0.901), unseen),
        (scenes.plane(2.0), half, scenes.at(0.0, 0.0, 0.902), unseen),
        lights=[scenes.light(LightKind.SUN, np.pi, direction=(0.0, 0.0, -1.0))],
        camera=scenes.camera((0.0, 0.0, 3.0), width=1.9), pixel_filter_width=0.0,
    )  # fmt: skip
    with pipeline(gpu, made, scenes.settings(40, use_indirect=False), (SIZE, SIZE), samples=4) as ready:
        lit = ready.film.read_mean("combined")[..., 0].mean()
    assert lit == pytest.approx(0.25, abs=0.02)


@pytest.mark.parametrize("grid", GRIDS)
def test_an_edit_leaves_the_bits_of_a_fresh_start(grid: str, gpu: GpuContext) -> None:
    settings, size = GRIDS[grid], (24, 18)
    made = room(ball=chequered())
    moved = placed(made, {2: scenes.at(0.7, 0.5, -0.3)})
    with pipeline(gpu, made, settings, size, samples=1, is_live=True) as ready:
        prepare(ready, moved, settings, size)
        sample(ready, 1)
        assert 0 < ready.redone["cells"] < 0.5 * ready.voxel_light.voxelize.voxels.cell_count  # type: ignore[union-attr]
        with pipeline(gpu, moved, settings, size, samples=1) as fresh:
            assert_same(bits(ready), bits(fresh))


def test_what_is_transparent_all_over_has_no_outlines(gpu: GpuContext) -> None:
    """One byte for each entry of a list, and no define."""
    made = room(ball=scenes.principled(0.8, Alpha=0.4))
    with pipeline(gpu, made, NESTED, (8, 8), samples=1) as ready:
        voxels = ready.voxel_light.voxelize.voxels
        assert voxels is not None and voxels.cell_opacities is not None and voxels.cell_opacities.components == 1
        assert not voxels.trace_defines["HAS_OUTLINES"]
