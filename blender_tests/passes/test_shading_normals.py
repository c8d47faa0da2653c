# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth shading in voxels: faces receive light by the normals of meshes' corners, and none from behind the surface."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from addon.features import Features
from addon.gpu.context import GpuContext
from addon.passes.geometry import is_smooth
from addon.scene import CameraData, LightKind, SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, radiance, read_voxels, unit_grid, voxelized

TILT = np.radians(30.0)
#: Normal of a level plane that is shaded as if it leaned towards +x.
LEANING = (np.sin(TILT), 0.0, np.cos(TILT))


def leaning_plane() -> object:
    return scenes.bent(scenes.plane(2.0), LEANING)


# Normals --------------------------------------------------------------------------------------------------------


def test_what_is_smooth() -> None:
    assert not is_smooth(scenes.box())
    assert is_smooth(scenes.sphere(1.0, 8))
    assert not is_smooth(scenes.bent(scenes.plane(), (0.001, 0.0, 1.0)))
    assert is_smooth(scenes.bent(scenes.plane(), (0.01, 0.0, 1.0)))
    assert is_smooth(scenes.bent(scenes.plane(), (0.0, 0.0, -1.0)))
    assert not is_smooth(scenes.mesh(np.zeros((0, 3)), np.zeros((0, 3))))


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 1.0, 0.5), (-1.0, 1.0, 1.0), (1.0, 1.0, -2.0)])
def test_normals_are_interpolated(scale: tuple[float, float, float], gpu: GpuContext) -> None:
    """Barycentric means of corner normals, taken to the world by the inverse transpose, on either side of a triangle
    that may be mirrored."""
    shape = scenes.soup([[[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [-2.0, 2.0, 0.0]]])
    normals = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [0.0, -0.8, 0.6]])
    made = scenes.scene((scenes.bent(shape, normals), scenes.diffuse(), scenes.at(5.0, 5.0, 3.3, scale)))
    with voxelized(gpu, made, unit_grid(12)) as found:
        faces = found.faces
    assert len(faces) > 16
    local = (faces["position"][:, :2] - 5.0) / scale[:2]
    u, v = (local + 2.0).T / 4.0
    expected = np.stack([1.0 - u - v, u, v], axis=1) @ normals
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    expected /= scale
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    expected *= np.sign(scale[2]) * np.where(faces["facing"] == 4, 1.0, -1.0)[:, None]
    np.testing.assert_allclose(faces["shading_normal"], expected, atol=1e-3)
    np.testing.assert_allclose(np.abs(faces["normal"]), np.broadcast_to([0.0, 0.0, 1.0], expected.shape), atol=1e-3)


def test_normals_of_what_is_flat(gpu: GpuContext) -> None:
    """A scale of 0 leaves normals along one line, on the side that they were on."""
    shape = scenes.soup([[[-2.0, -2.0, 0.3], [2.0, -2.0, -0.2], [-2.0, 2.0, 0.5]]])
    normals = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [0.0, -0.8, 0.6]])
    made = scenes.scene((scenes.bent(shape, normals), scenes.diffuse(), scenes.at(5.0, 5.0, 3.3, (1.0, 1.0, 0.0))))
    with voxelized(gpu, made, unit_grid(12)) as found:
        faces = found.faces
    assert len(faces) > 16
    np.testing.assert_allclose(faces["position"][:, 2], 3.3, atol=1e-5)
    up = np.where(faces["facing"] == 4, 1.0, -1.0)[:, None] * [0.0, 0.0, 1.0]
    np.testing.assert_allclose(faces["shading_normal"], up, atol=1e-3)
    np.testing.assert_allclose(faces["normal"], up, atol=1e-3)


def test_flat_shading_takes_nothing_and_changes_nothing(gpu: GpuContext) -> None:
    """Where all is flat there are no shading normals; beside a smooth sphere a flat box has the same faces, and its own
    normals."""
    box = (scenes.box((1.2, 1.3, 1.4), (3.2, 3.5, 3.3)), scenes.diffuse())
    ball = (scenes.sphere(1.5, 6), scenes.diffuse(), scenes.at(6.0, 6.0, 6.0))
    with voxelized(gpu, scenes.scene(box), unit_grid(8)) as alone:
        assert alone.voxels.faces.shading is None
    with voxelized(gpu, scenes.scene(box, ball), unit_grid(8)) as beside:
        assert beside.voxels.faces.shading is not None
        ours = (beside.face_cells < 4).all(axis=1)
    for name in ("position", "normal", "shading_normal", "reflectance", "weight"):
        np.testing.assert_array_equal(beside.faces[name][ours], alone.faces[name])
    between = np.einsum("fk,fk->f", beside.faces["normal"], beside.faces["shading_normal"])
    assert between[~ours].min() < 0.99 and between[ours].min() > 1.0 - 1e-9


# Light ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [-80.0, -70.0, -30.0, 0.0, 30.0, 80.0, 100.0, 115.0, 150.0, 180.0])
def test_sun(degrees: float, gpu: GpuContext) -> None:
    """Under irradiance E from the sun albedo a sends a E cos(angle to the shading normal) / pi on the side that the sun
    is on, where that is positive, and nothing on the other, though there are no shadows to hold it back."""
    angle = np.radians(degrees)  # of the sun, from +z towards +x
    sun = scenes.light(LightKind.SUN, 3.0, direction=(-np.sin(angle), 0.0, -np.cos(angle)))
    made = scenes.scene((leaning_plane(), scenes.diffuse(0.5)), lights=[sun])
    is_above = abs(degrees) < 90.0
    cosine = np.cos(angle - TILT) * (1.0 if is_above else -1.0)
    with pipeline(gpu, made, scenes.settings(12, bounces=0, use_shadows=False), samples=0) as ready:
        assert ready.features is not None and ready.features.has_smooth_shading
        found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
        lit = found.faces["facing"] == (4 if is_above else 5)
        leaving = radiance(ready)
    np.testing.assert_allclose(leaving[lit], max(cosine, 0.0) * 3.0 * 0.5 / np.pi, rtol=2e-3)
    assert lit.sum() > 80 and leaving[~lit].max() == 0.0


def received(cosine: float) -> float:
    """What a surface receives under a sky of radiance 1, over pi, when its shading normal leans by an angle."""
    mirrored = np.clip((cosine - 0.94) / 0.045, 0.0, 1.0)
    return 0.5 * (1.0 + cosine) + mirrored * 0.5 * (1.0 - cosine)


@pytest.mark.parametrize("degrees", [0.0, 10.0, 15.0, 30.0, 60.0])
def test_sky(degrees: float, gpu: GpuContext) -> None:
    """Under a sky of radiance 1 a surface shaded as if it leaned by an angle receives what a roof that leans so does
    from above the ground: (1 + cos) / 2. The rest is mirrored where it leans little. Nowhere more than 1."""
    angle = np.radians(degrees)
    shape = scenes.bent(scenes.plane(2.0), (0.0, np.sin(angle), np.cos(angle)))
    made = scenes.scene((shape, scenes.diffuse(1.0)), world=scenes.world(1.0))
    with pipeline(gpu, made, scenes.settings(16, bounces=1, bounce_rays=32), samples=0) as ready:
        leaving = radiance(ready)[:, 0]
    assert leaving.mean() == pytest.approx(received(np.cos(angle)), rel=2.5e-3)
    assert leaving.max() <= 1.0 + 1e-5


@pytest.mark.parametrize("degrees", [0.0, 10.0, 15.0, 30.0])
@pytest.mark.parametrize("guided", [False, True])
def test_sky_in_a_picture(degrees: float, guided: bool, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same at pixels, with rays that guides draw and without."""
    angle = np.radians(degrees)
    shape = scenes.bent(scenes.plane(8.0), (0.0, np.sin(angle), np.cos(angle)))
    made = scenes.scene(
        (shape, scenes.diffuse(1.0)), world=scenes.world(1.0), camera=scenes.camera((0.0, 0.0, 3.0), angle=0.5)
    )
    original = Features.from_scene
    monkeypatch.setattr(
        Features, "from_scene", lambda *a, **k: dataclasses.replace(original(*a, **k), has_guides=guided)
    )
    with pipeline(gpu, made, scenes.settings(16, rays=8, use_reconstruction=False), (16, 16), samples=8) as ready:
        seen = ready.film.read("combined")[..., 0]
    assert seen.mean() == pytest.approx(received(np.cos(angle)), rel=2.5e-3)


@pytest.mark.parametrize("side", [0.3, 2.0])
def test_emitter(side: float, gpu: GpuContext) -> None:
    """A square lamp over the plane: each face receives the integral of cos cos / (pi d^2) over it, whether points on
    the lamp or rays find it."""
    made = scenes.scene(
        (leaning_plane(), scenes.diffuse(1.0)), (scenes.plane(side), scenes.emission(1.0), scenes.at(z=1.0))
    )
    with pipeline(gpu, made, scenes.settings(16, bounces=0, bounce_rays=64), samples=0) as ready:
        assert ready.features is not None and ready.features.draws_emitters_at_faces is (side < 1.0)
        found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
        grid = found.voxels.grid
        place = found.faces["position"] * grid.cell_size + grid.origin
        up = (found.faces["facing"] == 4) & (place[:, 2] < 0.5)
        leaving = radiance(ready)[up, 0]
        weight = found.faces["weight"][up]
    line = (np.arange(32) + 0.5) / 32
    square = np.stack([*np.meshgrid(line - 0.5, line - 0.5), np.zeros((32, 32))], axis=-1).reshape(-1, 3)

    def expected(points: np.ndarray) -> np.ndarray:
        to_lamp = square * side + [0.0, 0.0, 1.0] - points[:, None]
        distance = np.linalg.norm(to_lamp, axis=2)
        cosine = np.maximum(to_lamp @ np.array(LEANING), 0.0) / distance
        return (cosine * to_lamp[..., 2] / distance / (np.pi * distance**2)).mean(axis=1) * side**2

    assert np.average(leaving, weights=weight) == pytest.approx(expected(2.0 * square).mean(), rel=0.01)
    there = expected(place[up])
    assert np.abs(leaving - there).mean() < 0.15 * there.mean()


def smooth_furnace(rings: int, albedo: float, camera: CameraData | None = None) -> SceneData:
    """A closed sphere, shaded smooth and seen from inside, that emits 1 - r and reflects r."""
    ball = scenes.sphere(1.0, rings)
    flat = scenes.mesh(ball.positions, ball.triangle_vertices[:, ::-1])
    inside = scenes.bent(flat, -ball.positions[flat.triangle_vertices.ravel()])
    return scenes.scene((inside, scenes.glowing(albedo, 1.0 - albedo)), camera=camera)


def test_closed_smooth_room(gpu: GpuContext) -> None:
    """Of few triangles: what its surfaces hide from their shading normals is mirrored as far as normals are alike, and
    nothing is won."""
    made = smooth_furnace(6, 0.8)
    with pipeline(gpu, made, scenes.settings(24, bounces=200, bounce_rays=32), samples=0) as ready:
        found = read_voxels(ready.voxel_light.voxelize.voxels, ready.voxel_light.geometry.geometry)  # type: ignore[arg-type]
        middle = np.array(found.voxels.grid.grid_from_world[:3, 3])
        inner = np.einsum("fk,fk->f", found.faces["normal"], middle - found.faces["position"]) > 0
        inner &= found.faces["weight"] > 0.01  # colours of slivers are rounded
        leaving = radiance(ready)[inner, 0] + 0.2
    assert leaving.max() < 1.005
    mesh = made.meshes[0]
    corners = mesh.positions[mesh.triangle_vertices]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    least = np.einsum("tk,tk->t", across, mesh.corner_normals[mesh.triangle_corners[:, 0]]).min()
    assert 0.2 / (1.0 - 0.8 * received(least)) < leaving.mean() < 1.0


@pytest.mark.parametrize("resolution", [16, 32])
def test_smooth_furnace(resolution: int, gpu: GpuContext) -> None:
    """As bright as it emits, though light is reflected twenty times, and no pixel far from it."""
    made = smooth_furnace(32, 0.95, scenes.camera((0.3, -0.2, 0.4), (1.0, 1.0, -1.0), angle=1.6))
    with pipeline(gpu, made, scenes.settings(resolution, bounces=1024), (24, 24), samples=4) as ready:
        seen = ready.film.read("combined")[..., 0]
    assert seen.mean() == pytest.approx(1.0, abs=0.005)
    assert np.abs(seen - 1.0).max() < 0.05
