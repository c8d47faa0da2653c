# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame as a whole: the same bits again, only what changed again, only what the scene needs."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from addon.features import Features
from addon.gpu import context
from addon.gpu.context import GpuContext
from addon.gpu.interface import LIST_WIDTH
from addon.grid import VoxelGrid, choose_resolution, estimate_memory, measure_surfaces, scene_bounds
from addon.pipeline import Pipeline, PipelineError
from addon.scene import LightKind, SceneData
from addon.settings import Settings
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, prepare, radiance, read_voxels, sample
from blender_tests.passes.test_film import PASSES, glossy_room

SETTINGS = scenes.settings(20, bounces=3)
SIZE = (24, 18)


def bits(made: Pipeline) -> dict[str, bytes]:
    """Everything that was made: faces, their light, the pictures."""
    found = read_voxels(made.voxel_light.voxelize.voxels, made.voxel_light.geometry.geometry)  # type: ignore[arg-type]
    kept = {"faces": found.faces.tobytes(), "masks": found.masks.tobytes(), "light": radiance(made).tobytes()}
    return kept | {name: made.film.read(name).tobytes() for name in made.film.names}


def fresh(gpu: GpuContext, made: SceneData, settings: Settings = SETTINGS, samples: int = 2) -> dict[str, bytes]:
    with pipeline(gpu, made, settings, SIZE, samples=samples, outputs=PASSES) as ready:
        return bits(ready)


def with_sun(made: SceneData, strength: float) -> SceneData:
    lights = (scenes.light(LightKind.SUN, strength, direction=(0.3, 0.2, -1.0), angle=0.05), *made.lights[1:])
    return dataclasses.replace(made, lights=lights)


# The same bits --------------------------------------------------------------------------------------------------


def test_two_pipelines_give_the_same_bits(gpu: GpuContext) -> None:
    made = glossy_room()
    assert fresh(gpu, made) == fresh(gpu, made)


@pytest.mark.parametrize("more", [{}, {"gather_interval": 2, "reuse_frames": True}], ids=["plain", "taken over"])
def test_undefined_memory_does_not_show(
    more: dict[str, Any], gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Textures made without content hold NaN (all bits set): nothing may read what it did not write. Bounces go on
    until they converge, so that what decides when to stop is seen too."""
    made, settings = glossy_room(), dataclasses.replace(SETTINGS, bounces=64, **more)
    first = fresh(gpu, made, settings)
    original = GpuContext.texture

    def poisoned(
        self: GpuContext, name: str, size: Any, components: int, dtype: str, data: Any = None, **more: Any
    ) -> Any:
        texture = original(self, name, size, components, dtype, data, **more)
        if data is None:
            texture.write(b"\xff" * len(texture.read()))
        return texture

    monkeypatch.setattr(GpuContext, "texture", poisoned)
    assert fresh(gpu, made, settings) == first


def test_another_seed_gives_another_picture(gpu: GpuContext) -> None:
    made = glossy_room()
    one, two = fresh(gpu, made), fresh(gpu, made, dataclasses.replace(SETTINGS, seed=1))
    assert one["faces"] == two["faces"] and one["combined"] != two["combined"]
    means = [np.frombuffer(x["combined"], np.float32).mean() for x in (one, two)]
    assert means[0] == pytest.approx(means[1], rel=0.1)


# Only what changed ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "again", "kept"),
    [
        ("light", {"inject", "bounce"}, {"materials", "geometry", "voxelize", "link"}),
        ("camera", set(), {"materials", "geometry", "voxelize", "link", "inject", "bounce"}),
        ("bounces", {"bounce"}, {"materials", "geometry", "voxelize", "link"}),
        ("world", {"link", "bounce"}, {"materials", "geometry", "voxelize"}),
        ("material", {"materials", "voxelize", "inject", "bounce"}, set()),
        ("instance", {"geometry", "voxelize", "link", "inject", "bounce"}, {"materials"}),
        ("size", set(), {"materials", "geometry", "voxelize", "link", "inject", "bounce"}),
    ],
)
def test_only_what_depends_on_a_change_is_done_again(
    change: str, again: set[str], kept: set[str], gpu: GpuContext
) -> None:
    made, settings = glossy_room(), SETTINGS
    changed, other_settings = made, settings
    if change == "light":
        changed = with_sun(made, 7.0)
    elif change == "camera":
        changed = dataclasses.replace(made, camera=scenes.camera((0.5, -3.0, 1.0)))
    elif change == "bounces":
        other_settings = dataclasses.replace(settings, bounces=1)
    elif change == "world":
        changed = dataclasses.replace(made, world=scenes.world(0.7))
    elif change == "material":
        changed = dataclasses.replace(made, materials=(scenes.diffuse((0.2, 0.8, 0.2)), *made.materials[1:]))
    elif change == "instance":
        moved = dataclasses.replace(made.instances[1], world_from_object=scenes.at(-0.4, 0.3, 0.8))
        changed = dataclasses.replace(made, instances=(made.instances[0], moved, *made.instances[2:]))
    with pipeline(gpu, made, settings, (30, 30) if change == "size" else SIZE, samples=1, outputs=PASSES) as ready:
        gpu.times.clear()
        prepare(ready, changed, other_settings, SIZE)
        done = set(gpu.times)
        sample(ready, 2)
        after = bits(ready)
    assert again <= done, f"not done again: {again - done}"
    assert not kept & done, f"done again: {kept & done}"
    assert after == fresh(gpu, changed, other_settings)


@pytest.mark.parametrize("rings", [12, 120], ids=["few triangles", "many"])
@pytest.mark.parametrize("resolution", [32, 96])
def test_voxels_take_what_was_estimated(resolution: int, rings: int, gpu: GpuContext) -> None:
    """A ball, so that surfaces face all ways, under a sky: the estimate is near what they take at most."""
    made = scenes.scene((scenes.sphere(1.0, rings), scenes.diffuse()), world=scenes.world(1.0))
    peak, track = 0, GpuContext._track
    kept = {
        "bricks", "cells", "cell triangles", "faces", "links", "straight light of faces", "face radiance",
        "face irradiance", "bouncing light",
    }  # fmt: skip

    def tracked(self: GpuContext, *arguments: Any) -> Any:
        nonlocal peak
        thing = track(self, *arguments)
        peak = max(peak, sum(size for name, size in self.memory.items() if name in kept))
        return thing

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(GpuContext, "_track", tracked)
        with pipeline(gpu, made, scenes.settings(resolution, bounces=1), samples=0):
            estimate = estimate_memory(resolution, (2.0, 2.0, 2.0), measure_surfaces(made), 8)
    rows = 4 * LIST_WIDTH * 32  # lists have whole rows
    assert 0.8 * (peak - rows) < estimate < 1.3 * peak


@pytest.mark.parametrize("automatic", [False, True])
def test_voxels_that_do_not_fit_become_coarser(
    automatic: bool, gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A driver that refuses long lists of links: half the resolution, a warning, and the picture that belongs to it.
    The next frame does not try again; with other settings of voxels everything is tried anew."""
    made, tried = scenes.cornell(), []
    original = GpuContext.list_texture

    def refusing(self: GpuContext, name: str, count: int, *arguments: Any) -> Any:
        if name == "links":
            tried.append(count)
            if count > 90_000:
                raise MemoryError("links are too many")
        return original(self, name, count, *arguments)

    rays = {"bounce_rays": 4}
    fine = Settings(memory_budget=32, **rays) if automatic else scenes.settings(64, **rays)
    assert choose_resolution(made, fine) >= 64
    monkeypatch.setattr(GpuContext, "list_texture", refusing)
    before = gpu.object_count
    ready = Pipeline(gpu)
    try:
        prepare(ready, made, fine, SIZE)
        sample(ready, 1)
        coarse = choose_resolution(made, fine) // 2 ** (len(tried) - 1)
        assert len(tried) > 1 and ready.grid == VoxelGrid.around(scene_bounds(made), coarse)  # type: ignore[arg-type]
        assert [text for text in ready.warnings if f"{coarse} are used" in text]
        found = ready.film.read("combined")
        again = len(tried)
        prepare(ready, with_sun(made, 2.0), fine, SIZE)
        assert len(tried) == again
        prepare(ready, made, scenes.settings(24, **rays), SIZE)
        assert not ready.warnings and ready.grid == VoxelGrid.around(scene_bounds(made), 24)  # type: ignore[arg-type]
    finally:
        ready.release()
    assert gpu.object_count == before
    with pipeline(gpu, made, scenes.settings(coarse, **rays), SIZE, samples=1) as expected:
        assert np.array_equal(found, expected.film.read("combined"))


def test_memory_that_voxels_do_not_need_is_not_theirs_to_give(
    gpu: GpuContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scene that is too large, or a device too small for any voxels: one error, and everything is let go of."""
    original, calls, refused = GpuContext.texture, [], ""

    def refusing(self: GpuContext, name: str, *arguments: Any, **more: Any) -> Any:
        if name == refused:
            calls.append(name)
            raise MemoryError(f"no {name}")
        return original(self, name, *arguments, **more)

    monkeypatch.setattr(GpuContext, "texture", refusing)
    for refused, tries in (("triangles", 1), ("links", 3)):
        calls.clear()
        ready, before = Pipeline(gpu), gpu.object_count
        with pytest.raises(MemoryError, match=f"no {refused}"):
            prepare(ready, scenes.cornell(), scenes.settings(64), SIZE)
        assert len(calls) == tries
        ready.release()
        assert gpu.object_count == before


def test_a_picture_that_does_not_fit_leaves_voxels_alone(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a smaller picture nor another scene is rendered coarser because a large picture found no memory."""
    original = GpuContext.texture

    def refusing(self: GpuContext, name: str, size: tuple[int, int], *arguments: Any, **more: Any) -> Any:
        if name == "surface pictures" and size[0] >= 64:
            raise MemoryError(f"no {name}")
        return original(self, name, size, *arguments, **more)

    monkeypatch.setattr(GpuContext, "texture", refusing)
    made, settings, ready = scenes.cornell(), scenes.settings(64), Pipeline(gpu)
    try:
        with pytest.raises(MemoryError, match="no surface pictures"):
            prepare(ready, made, settings, (64, 64))
        prepare(ready, made, settings, SIZE)
        assert not ready.warnings and ready.grid == VoxelGrid.around(scene_bounds(made), 64)  # type: ignore[arg-type]
    finally:
        ready.release()


@pytest.mark.parametrize("alpha", [1.0, 0.5], ids=["opaque", "transparent"])
def test_faces_come_and_go_with_light_in_voxels(alpha: float, gpu: GpuContext) -> None:
    """Occlusion asks for no faces, its picture is the same with and without them; then light from around, as if new."""
    made = glossy_room()
    made = dataclasses.replace(made, materials=(scenes.principled(0.7, Alpha=alpha), *made.materials[1:]))
    occlusion = dataclasses.replace(SETTINGS, gather_mode="OCCLUSION")

    def picture(ready: Pipeline, settings: Settings) -> bytes:
        prepare(ready, made, settings, SIZE)
        sample(ready, 2)
        return ready.film.read("combined").tobytes()

    with pipeline(gpu, made, SETTINGS, SIZE, samples=0) as ready:
        after_light = picture(ready, occlusion)
        assert "faces" not in gpu.memory and ready.statistics()["faces"] == 0
        lit = picture(ready, SETTINGS)
    with pipeline(gpu, made, occlusion, SIZE, samples=0) as ready:
        assert after_light == picture(ready, occlusion)
    assert lit == fresh(gpu, made)["combined"]


@pytest.mark.parametrize("change", ["links", "shadows", "scene"])
def test_what_was_interrupted_is_done_again(change: str, gpu: GpuContext) -> None:
    """Something else is begun and given up after each of its steps, then the first scene again: the same bits."""
    made = glossy_room()
    other, settings = made, SETTINGS
    if change == "links":
        settings = dataclasses.replace(SETTINGS, bounce_rays=16)
    elif change == "shadows":
        settings = dataclasses.replace(SETTINGS, use_shadows=False)
    else:
        other = with_sun(dataclasses.replace(made, world=scenes.world(0.9), meshes=made.meshes[::-1]), 9.0)
    expected = fresh(gpu, made)
    with pipeline(gpu, made, SETTINGS, SIZE, samples=0, outputs=PASSES) as ready:
        for stop in range(1, 40):
            steps = ready.prepare(other, settings, SIZE)
            ended = len([None for _ in zip(range(stop), steps, strict=False)]) < stop
            steps.close()
            prepare(ready, made, SETTINGS, SIZE)
            sample(ready, 2)
            assert bits(ready) == expected, f"given up after step {stop}"
            if ended:
                return
    raise AssertionError("there are more steps than this test expects")


def test_fractions_grow(gpu: GpuContext) -> None:
    """Progress never goes back, and ends at 1."""
    ready = Pipeline(gpu)
    try:
        for steps in (ready.prepare(glossy_room(), SETTINGS, SIZE), ready.sample()):
            fractions = [step.fraction for step in steps]
            assert fractions == sorted(fractions) and fractions[-1] == 1.0
    finally:
        ready.release()


def test_programs_of_edited_materials_are_let_go_of(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """However often a node graph is edited, and the picture of the first is the same again when it comes back."""
    monkeypatch.setattr(context, "MOST_PROGRAMS", gpu.program_count + 4)
    monkeypatch.setattr(context, "PROGRAM_AGE", 2)

    def edited(length: int) -> SceneData:
        sources = ("G.Position", *(f"M{k}.Value" for k in range(length - 1)))
        texts = [node(f"M{k}", "Math", p_operation="COSINE", Value=source) for k, source in enumerate(sources)]
        shader = node("D", "BsdfDiffuse", Color=f"M{length - 1}.Value")
        surface = material(node("G", "NewGeometry"), *texts, shader, surface="D.BSDF")
        return scenes.scene((scenes.plane(), surface), world=scenes.world(1.0))

    shown = Pipeline(gpu)
    try:
        pictures, counts = [], []
        for length in (1, *range(2, 13), 1):
            prepare(shown, edited(length), SETTINGS, SIZE)
            sample(shown, 1)
            pictures.append(shown.film.read("combined").copy())
            counts.append(gpu.program_count)
        assert counts[0] < counts[1] and max(counts[6:]) <= counts[5], counts
        np.testing.assert_array_equal(pictures[0], pictures[-1])
        assert not np.array_equal(pictures[0], pictures[1])
    finally:
        shown.release()


def test_release_is_complete(gpu: GpuContext) -> None:
    """Nothing lives after ``release``, also when a pipeline never ran or stopped in the middle of a step."""
    before = gpu.object_count
    Pipeline(gpu).release()
    for stop in range(12):
        ready = Pipeline(gpu)
        steps = ready.prepare(glossy_room(), SETTINGS, SIZE)
        for _, _ in zip(range(stop), steps, strict=False):
            pass
        steps.close()
        ready.release()
        assert gpu.object_count == before


# Only what is needed --------------------------------------------------------------------------------------------


def report(gpu: GpuContext, made: SceneData, settings: Settings) -> tuple[Features, list[str], set[str], set[str]]:
    """Features, passes that ran, programs that were compiled, storage that was allocated."""
    compiled: set[str] = set()
    original = gpu.kernel

    def noted(name: str, *arguments: object, **named: object) -> object:
        compiled.add(name)
        return original(name, *arguments, **named)  # type: ignore[arg-type]

    gpu.kernel = noted  # type: ignore[assignment, method-assign]
    try:
        gpu.times.clear()
        with pipeline(gpu, made, settings, SIZE, samples=1) as ready:
            assert ready.features is not None
            passes = [entry["name"] for entry in ready.statistics()["passes"]]
            return ready.features, passes, compiled, set(ready.statistics()["memory"])
    finally:
        del gpu.kernel  # the class has its own


#: What the camera sees is drawn from these.
DRAWN = {"vertex positions", "vertex indices", "draw instances"}
GEOMETRY_AND_VOXELS = DRAWN | {
    "instances", "corners", "attributes", "triangles", "material batches", "material values", "bricks", "cells",
    "cell triangles",
}  # fmt: skip


def test_matte_cornell_box_needs_only_this(gpu: GpuContext) -> None:
    """No texture, emission, gloss, transparency or world: written by hand."""
    features, passes, programs, memory = report(gpu, scenes.cornell(), scenes.settings(16, bounces=2))
    assert features.names == [
        "geometry", "lights", "diffuse_gather", "reconstruction", "direct", "visible_lights", "radiance", "bounces",
        "links", "guides",
    ]  # fmt: skip
    assert set(passes) - {"compile"} == {
        "materials", "geometry", "voxelize", "neighbours", "inject", "link", "bounce", "share faces", "guides",
        "visibility", "surface", "light shapes", "direct", "gather", "reconstruct", "film",
    }  # fmt: skip
    assert programs == {
        "clear", "transform", "work", "voxel_pairs", "voxel_count", "voxel_accumulate", "voxel_walls", "voxel_cut",
        "voxel_resolve", "face_order", "neighbours", "inject", "link", "bounce", "partners", "share_faces",
        "guide_light", "guide_collect", "guide_build", "pixel_bins",
        "surface", "light_shapes", "direct", "gather", "reconstruct", "compose", "film",
    }  # fmt: skip
    assert memory == {
        *GEOMETRY_AND_VOXELS, "faces", "lights", "links", "face radiance", "guides", "surface pictures",
        "pixel lists", "direct light", "indirect light", "shared light", "film",
    }  # fmt: skip


def test_empty_scene_needs_only_this(gpu: GpuContext) -> None:
    features, passes, programs, memory = report(gpu, scenes.scene(), scenes.settings(16))
    assert features.names == []
    assert set(passes) - {"compile"} == {"materials", "geometry", "voxelize", "visibility", "film"}
    assert programs == {"clear", "work", "voxel_count", "compose", "film"}
    assert memory == (GEOMETRY_AND_VOXELS - DRAWN) | {"surface pictures", "pixel lists", "film"}


def test_occlusion_needs_only_this(gpu: GpuContext) -> None:
    """Ambient occlusion: rays, but no light in voxels."""
    settings = scenes.settings(16, gather_mode="OCCLUSION", use_direct=False)
    features, passes, programs, memory = report(gpu, scenes.cornell(), settings)
    assert features.names == [
        "geometry", "lights", "diffuse_gather", "reconstruction", "visible_lights", "gather_occlusion",
    ]  # fmt: skip
    assert set(passes) - {"compile"} == {
        "materials", "geometry", "voxelize", "visibility", "surface", "light shapes", "gather", "reconstruct", "film",
    }  # fmt: skip
    assert programs == {
        "clear", "transform", "work", "voxel_pairs", "voxel_count", "voxel_list", "pixel_bins", "surface",
        "light_shapes", "gather", "reconstruct", "compose", "film",
    }  # fmt: skip
    assert memory == {
        *GEOMETRY_AND_VOXELS, "lights", "surface pictures", "pixel lists", "indirect light", "shared light", "film",
    }  # fmt: skip


def test_settings_switch_things_off(gpu: GpuContext) -> None:
    """No indirect light: no links, no bounces, no gather. No bounces: no links."""
    _, passes, programs, memory = report(gpu, scenes.cornell(), scenes.settings(16, use_indirect=False))
    assert not {"link", "bounce", "inject", "gather"} & (set(passes) | programs) and "links" not in memory
    _, passes, _, memory = report(gpu, scenes.cornell(), scenes.settings(16, bounces=0))
    assert not {"link", "guides"} & set(passes) and not {"links", "guides"} & set(memory) and "gather" in passes
    _, passes, programs, _ = report(gpu, scenes.cornell(), scenes.settings(16, use_direct=False))
    assert "direct" not in programs and "inject" in programs


def test_what_reflections_show_is_let_go_of_too(gpu: GpuContext) -> None:
    """Pictures of light that the settings no longer want, of what the camera sees and of what reflections show."""
    made, ready = glossy_room(), Pipeline(gpu)
    try:
        for settings, kept in ((SETTINGS, True), (dataclasses.replace(SETTINGS, use_direct=False), False)):
            prepare(ready, made, settings, SIZE)
            sample(ready, 1)
            assert ready.features is not None and ready.features.follows_glossy
            assert ("direct light" in gpu.memory) == kept
    finally:
        ready.release()


def test_rays_of_pixels_must_fit_into_a_texture(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """They take two texels side by side; the sentence says how wide the picture may be."""
    made, ready = glossy_room(), Pipeline(gpu)
    monkeypatch.setattr(type(gpu.mgl), "info", {**gpu.mgl.info, "GL_MAX_TEXTURE_SIZE": 40})
    try:
        prepare(ready, made, dataclasses.replace(SETTINGS, glossy_layers=0), SIZE)
        with pytest.raises(PipelineError, match="draws up to 20 from left to right"):
            prepare(ready, made, SETTINGS, SIZE)
    finally:
        ready.release()
