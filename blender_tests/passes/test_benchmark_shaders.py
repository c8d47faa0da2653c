# SPDX-License-Identifier: GPL-3.0-or-later
"""What the benchmark does to shaders: published kernels in place of the gather, and fetches that are counted."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest
from conelight_benchmark import fetch_rate, fetches, kernels, numbers

from addon.gpu import context as context_module
from addon.gpu import interface
from addon.gpu.context import GpuContext
from addon.pipeline import Pipeline
from addon.scene import SceneData
from blender_tests.passes import scenes
from blender_tests.passes.run import pipeline


@pytest.fixture
def changeable(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> Iterator[GpuContext]:
    """A context without programs, whose shaders may be changed; afterwards all is as it was."""
    for owner, name in (
        (context_module, "resolve"), (GpuContext, "dispatch"), (GpuContext, "dispatch_indirect"), (Pipeline, "sample"),
    ):
        monkeypatch.setattr(owner, name, getattr(owner, name))
    monkeypatch.setattr(gpu, "_kernels", {})
    yield gpu
    for kernel in gpu._kernels.values():
        kernel.shader.release()


def picture(gpu: GpuContext, made: SceneData, size: tuple[int, int] = (16, 16)) -> np.ndarray:
    """(rows, columns, 3): what cones gather."""
    with pipeline(gpu, made, scenes.settings(32, gather_mode="CONES", use_direct=False), size, samples=1) as ready:
        return np.array(ready.film.read("combined")[..., :3])


# ---- kernels -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", kernels.KERNELS)
@pytest.mark.parametrize("side", [0.0, 0.7])
def test_a_kernel_has_the_right_energy(name: str, side: float, changeable: GpuContext) -> None:
    """Under a sky of radiance 1 a plane of albedo 0.8 leaves 0.8, seen from above and from the side."""
    kernels.install(name)
    made = scenes.scene((scenes.plane(2.0), scenes.diffuse(0.8)), world=scenes.world(1.0),
                        camera=scenes.camera((side, 0.0, 1.0), width=0.3))
    np.testing.assert_allclose(picture(changeable, made), 0.8, rtol=0.01)


def test_kernels_differ_and_one_is_our_own(changeable: GpuContext) -> None:
    """Six cones at 60 degrees are what Conelight's own few cones are; the seed's look up more steeply."""
    made = scenes.cornell()
    original, own = context_module.resolve, picture(changeable, made, (32, 32))
    found = {}
    for name in kernels.KERNELS:
        context_module.resolve = original
        changeable._kernels.clear()
        kernels.install(name)
        found[name] = picture(changeable, made, (32, 32))
    np.testing.assert_allclose(found["six-60"], own, rtol=1e-3, atol=1e-4)
    for name in ("seed-6", "sixteen"):
        assert np.abs(found[name] - own).mean() > 0.01 * own.mean()


def test_a_kernel_where_something_is_glossy(changeable: GpuContext) -> None:
    """Reflections are shared between pixels, and gathered by rays that tell how near they ended; cones tell nothing."""
    kernels.install("seed-6")
    made = dataclasses.replace(scenes.cornell(), materials=(scenes.principled(0.8, Roughness=0.8),) * 3)
    with pipeline(changeable, made, scenes.settings(16, gather_mode="CONES"), (16, 16), samples=1) as ready:
        assert ready.features is not None and ready.features.has_glossy
        assert changeable.memory["indirect light"] == 16 * 16 * 16  # incoming light and no more


def test_a_kernel_does_not_stand_in_for_rays(changeable: GpuContext) -> None:
    kernels.install("seed-6")
    made = scenes.scene((scenes.plane(2.0), scenes.diffuse(0.8)), world=scenes.world(1.0))
    with pytest.raises(ValueError, match="seed-6"), pipeline(changeable, made, scenes.settings(16), samples=1):
        pass


# ---- fetches -----------------------------------------------------------------------------------------------------

PROGRAM = """#version 430 core
layout(local_size_x = 8) in;
layout(binding = 0) uniform sampler2D some_tex;
layout(binding = 0, r32f) uniform image2D some_img;
uniform int rounds;
float once(ivec2 at)
{
    return texelFetch(some_tex, ivec2(texelFetch(some_tex, at, 0).xy), 0).r;
}
void main()
{
    if (gl_GlobalInvocationID.x >= 5u) {
        return;
    }
    float sum = textureLod(some_tex, vec2(0.5), 0.0).r + imageLoad(some_img, ivec2(0)).r;
    for (int i = 0; i < rounds; ++i) {
        sum += once(ivec2(0));
    }
    imageStore(some_img, ivec2(gl_GlobalInvocationID.x, 0), vec4(sum));
}
"""


def test_fetches_are_counted(gpu: GpuContext) -> None:
    """Five threads with 2 + 2 x 3 fetches each, also those within each other; a sum that runs over is carried."""
    shader = gpu.mgl.compute_shader(fetches.counting(PROGRAM, 1))
    start = 2**32 - 7
    sums = gpu.mgl.buffer(np.array([5, 5, start, 3], np.uint32))
    texture = gpu.texture("test", (2, 2), 4, "f4", np.zeros((2, 2, 4), np.float32))
    image = gpu.texture("test", (8, 1), 1, "f4", np.zeros((1, 8, 1), np.float32))
    try:
        sums.bind_to_storage_buffer(len(interface.BUFFERS))
        texture.use(0)
        image.bind_to_image(0, read=True, write=True)
        shader["rounds"] = 3
        shader.run(1)
        gpu.barrier()
        untouched, low, high = np.split(np.frombuffer(sums.read(), np.uint32), [2, 3])
        assert untouched.tolist() == [5, 5]
        assert int(low[0]) + (int(high[0]) << 32) == start + (3 << 32) + 5 * (2 + 2 * 3)
    finally:
        shader.release()
        sums.release()
        gpu.free(texture, image)


def test_counting_changes_no_picture(changeable: GpuContext) -> None:
    """All shaders of a scene still compile, each with its number of fetches; the picture stays."""
    made = scenes.cornell()
    plain = picture(changeable, made)
    changeable._kernels.clear()
    counter = fetches.install()
    try:
        np.testing.assert_array_equal(picture(changeable, made), plain)
        assert counter.counts["gather"] > 6 * 16 * 16 and counter.counts["link"] > 0
        assert set(counter.counts) == {name for name, *_ in changeable._kernels}
    finally:
        counter.release()


def test_a_binding_is_left_for_the_sums() -> None:
    """GL promises eight storage buffers."""
    assert len(interface.BUFFERS) < 8


# ---- raw rates ---------------------------------------------------------------------------------------------------


def test_rates_are_measured_once_after_a_sample(changeable: GpuContext) -> None:
    """In the context that rendered, of every kind that the report names; afterwards nothing is left."""
    before, sample = changeable.object_count, Pipeline.sample
    with fetch_rate.after_sample() as rates:
        picture(changeable, scenes.cornell())
        first = dict(rates)
        picture(changeable, scenes.cornell())
    assert tuple(first) == numbers.RAW_KINDS and rates == first
    assert all(1e5 < rate < 1e13 for rate in rates.values())
    assert changeable.object_count == before and Pipeline.sample is sample
