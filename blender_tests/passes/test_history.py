# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that frames and passes take over: less noise, the same brightness, and nothing of another scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from addon.gpu.context import GpuContext
from addon.pipeline import Pipeline
from addon.scene import LightKind, SceneData
from addon.settings import Settings
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline, prepare, sample

SIZE = (48, 36)


def room(eye: float = 0.0, power: float = 20.0) -> SceneData:
    """A sphere in an open box, lit by a lamp and the sky; the camera stands ``eye`` to the side."""
    return scenes.scene(
        (scenes.box((-2.0, -2.0, 0.0), (2.0, 2.0, 3.0), inside_out=True), scenes.diffuse((0.7, 0.5, 0.3))),
        (scenes.sphere(0.6, 12), scenes.diffuse(0.8), scenes.at(0.3, 0.4, 0.6)),
        lights=[scenes.light(LightKind.POINT, power, (1.2, -1.0, 2.2), radius=0.1)],
        camera=scenes.camera((eye, -1.9, 1.5), (0.0, 1.0, 0.9), aspect=4 / 3),
    )  # fmt: skip


def settings(**values: object) -> Settings:
    chosen: dict[str, object] = {"reuse_frames": True, "samples": 2, "use_reconstruction": False} | values
    return scenes.settings(24, **chosen)


def moved(scene: SceneData, eye: float) -> SceneData:
    """The same scene, to the object, from another place."""
    return dataclasses.replace(scene, camera=room(eye).camera)


def metallic(scene: SceneData, roughness: float, of: int = 1) -> SceneData:
    """The same scene with metal for the material of a number."""
    materials = list(scene.materials)
    materials[of] = scenes.principled(0.9, Metallic=1.0, Roughness=roughness)
    return dataclasses.replace(scene, materials=materials)


def prepare_next(made: Pipeline, scene: SceneData, chosen: Settings, *, follows: bool = True) -> None:
    """Begin the next frame of an animation."""
    for _ in made.prepare(scene, chosen, SIZE, follows=follows):
        pass


def frames(gpu: GpuContext, shown: list[SceneData], chosen: Settings) -> Iterator[np.ndarray]:
    """The pictures of an animation."""
    made = Pipeline(gpu)
    try:
        for number, scene in enumerate(shown):
            prepare_next(made, scene, chosen, follows=number > 0)
            sample(made, chosen.samples)
            yield made.film.read("combined")[..., :3].copy()
    finally:
        made.release()


def alone(gpu: GpuContext, scene: SceneData, chosen: Settings) -> np.ndarray:
    """The picture of one frame by itself."""
    with pipeline(gpu, scene, chosen, SIZE) as made:
        return made.film.read("combined")[..., :3].copy()


def error(found: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.mean((found - wanted) ** 2 / (wanted**2 + 0.01 * wanted.mean() ** 2)))


def test_frames_gain_what_frames_before_them_found(gpu: GpuContext) -> None:
    """After eight frames of a moving camera: less than one frame's error, with a quarter of its rays."""
    first = room()
    path = [moved(first, eye) for eye in np.linspace(-0.2, 0.2, 8)]
    wanted = alone(gpu, path[-1], settings(reuse_frames=False, samples=128))
    last = list(frames(gpu, path, settings(samples=4)))[-1]
    single = alone(gpu, path[-1], settings(samples=4))
    assert error(last, wanted) < 0.6 * error(single, wanted)
    assert last.mean() == pytest.approx(wanted.mean(), rel=0.01)


def test_passes_that_gather_nothing(gpu: GpuContext) -> None:
    """They find all of the light, at edges too: no pixel differs by more than noise from one that all passes gather."""
    every = alone(gpu, room(), settings(samples=64, reuse_frames=False))
    some = alone(gpu, room(), settings(samples=64, reuse_frames=False, gather_interval=4))
    assert some.mean() == pytest.approx(every.mean(), rel=0.005)
    assert error(some, every) < 0.004
    assert np.abs(some / every - 1.0).max() < 0.5


def test_passes_that_gather_nothing_have_reflections(gpu: GpuContext) -> None:
    """What a curved mirror shows is found in every pass; what a rough one shows, in some."""
    for roughness in (0.05, 0.3):
        made = metallic(room(), roughness)
        every = alone(gpu, made, settings(samples=128, reuse_frames=False))
        some = alone(gpu, made, settings(samples=32, reuse_frames=False, gather_interval=4))
        found, wanted = (float(np.minimum(picture, 3.0).mean()) for picture in (some, every))  # glints are noise
        assert found == pytest.approx(wanted, rel=0.003)
        assert error(some, every) < 0.005


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.4])
def test_reflections_follow_the_camera(roughness: float, gpu: GpuContext) -> None:
    """A metal floor seen from a moving camera: however rough, not more error than a frame by itself has, and less where
    lobes are wide."""
    first = metallic(room(), roughness, of=0)
    path = [moved(first, eye) for eye in np.linspace(-0.4, 0.4, 6)]
    wanted = alone(gpu, path[-1], settings(reuse_frames=False, samples=256))
    last = list(frames(gpu, path, settings(samples=4)))[-1]
    single = alone(gpu, path[-1], settings(samples=4))
    bright = wanted.max(axis=-1) > 4.0 * wanted.mean()  # glints are noise
    for picture in (last, single, wanted):
        picture[bright] = 0.0
    assert error(last, wanted) < (0.8 if roughness > 0.3 else 1.2) * error(single, wanted)


def test_lobes_that_take_turns_keep_apart(gpu: GpuContext) -> None:
    """A sharp coat on a rough metal: passes that look up what others have found mix up neither."""
    made = room()
    coated = scenes.principled(0.5, Metallic=1.0, Roughness=0.6, **{"Coat Weight": 1.0, "Coat Roughness": 0.02})
    made = dataclasses.replace(made, materials=[made.materials[0], coated])
    every = alone(gpu, made, settings(samples=128, reuse_frames=False))
    some = alone(gpu, made, settings(samples=128, reuse_frames=False, gather_interval=4))
    assert some.mean() == pytest.approx(every.mean(), rel=0.01)
    assert error(some, every) < 0.005


def test_passes_that_gather_nothing_see_thin_things(gpu: GpuContext) -> None:
    """Wires of a third of a pixel, each seen by some passes only, under a sky: as bright as if all gathered."""
    wires = [
        (scenes.box((-0.01, -3.0, 0.0), (0.01, 3.0, 0.02)), scenes.diffuse(0.8), scenes.at(x, 0.0, 0.5))
        for x in np.linspace(-1.9, 1.9, 24)
    ]
    made = scenes.scene(
        *wires, camera=scenes.camera((0.0, 0.0, 3.0), width=3.0, aspect=4 / 3), world=scenes.world(1.0),
        film_transparent=True,
    )  # fmt: skip
    every = alone(gpu, made, settings(samples=16, reuse_frames=False))
    some = alone(gpu, made, settings(samples=16, reuse_frames=False, gather_interval=8))
    assert some.mean() == pytest.approx(every.mean(), rel=0.01)


def test_what_comes_into_sight_is_dark(gpu: GpuContext) -> None:
    """A board under the sky before a deep shaft, and the camera moves: none of the board's light stays on the shaft."""
    board = (scenes.box((-0.4, -0.05, 0.6), (0.4, 0.05, 1.4)), scenes.diffuse(0.8))
    sides = [(-3, 0.5, -2, -2, 6, 4), (2, 0.5, -2, 3, 6, 4), (-3, 0.5, -2, 3, 6, -1), (-3, 0.5, 3, 3, 6, 4)]
    shaft = [(scenes.box(side[:3], side[3:]), scenes.diffuse(0.2)) for side in sides]
    end = (scenes.box((-3.0, 6.0, -2.0), (3.0, 6.2, 4.0)), scenes.diffuse(0.8))

    def seen_from(eye: float) -> SceneData:
        camera = scenes.camera((eye, -6.0, 1.0), (eye, 1.0, 1.0), aspect=4 / 3)
        return scenes.scene(board, *shaft, end, camera=camera, world=scenes.world(1.0))

    first = seen_from(0.0)
    shown = [first, dataclasses.replace(first, camera=seen_from(0.5).camera)]
    wanted = alone(gpu, shown[1], settings(reuse_frames=False, samples=128))
    single = alone(gpu, shown[1], settings(samples=16))
    last = list(frames(gpu, shown, settings(samples=16)))[-1]
    assert error(last, wanted) < 1.3 * error(single, wanted)


@pytest.mark.parametrize("change", ["light", "outputs", "alone", "nothing was found"])
def test_nothing_is_taken_over_from_elsewhere(change: str, gpu: GpuContext) -> None:
    """Another lamp, other kinds of light to keep, a frame that follows none or one without passes: to the bit what the
    frame is by itself."""
    first, chosen = room(), settings(samples=4)
    second = room(power=3.0) if change == "light" else moved(first, 0.1)
    made = Pipeline(gpu)
    try:
        prepare(made, first, chosen, SIZE)
        sample(made, 4)
        if change == "nothing was found":
            prepare_next(made, moved(first, 0.05), chosen)
        if change == "outputs":
            made.want(["diffuse_direct"])
        prepare_next(made, second, chosen, follows=change != "alone")
        sample(made, 4)
        found = made.film.read("combined")[..., :3]
    finally:
        made.release()
    np.testing.assert_array_equal(found, alone(gpu, second, chosen))


def test_a_still_camera_converges(gpu: GpuContext) -> None:
    """Frames of the same view: the light goes towards what many passes find, and does not drift."""
    wanted = alone(gpu, room(), settings(reuse_frames=False, samples=256))
    scene = room()
    pictures = list(frames(gpu, [scene] * 24, settings()))
    assert error(pictures[-1], wanted) < 0.3 * error(pictures[0], wanted)
    assert pictures[-1].mean() == pytest.approx(wanted.mean(), rel=0.01)


def test_without_the_settings_nothing_is_kept(gpu: GpuContext) -> None:
    """No picture of light, and no pass; a frame that follows none keeps one mean and its places, not two."""
    for chosen, kept in ((settings(reuse_frames=False), False), (settings(), True)):
        with pipeline(gpu, room(), chosen, SIZE) as made:
            assert ("light of frames" in gpu.memory, "history" in gpu.times) == (kept, kept)
            assert gpu.memory.get("light of frames", 0) == kept * 32 * SIZE[0] * SIZE[1]
            assert made.features is not None and made.features.keeps_light == kept
