# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark's measures, with answers from paper, and its plan of what to render."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OpenImageIO")
pytest.importorskip("matplotlib")
from conelight_benchmark import arguments, catalogue, measure, numbers, peers, report, store
from conelight_benchmark.job import Job
from conelight_benchmark.plan import plans
from conelight_cli.errors import CommandError

from blender_tests.pictures import Picture, relative_mse

SIZE = (4, 8, 3)


def flat(value: float) -> Picture:
    return np.full(SIZE, value, np.float32)


def stripes(axis: int) -> Picture:
    """+1 and -1 by turns; those of different axes are orthogonal."""
    sign = 1.0 - 2.0 * (np.arange(SIZE[axis]) % 2)
    shape = [1, 1, 1]
    shape[axis] = SIZE[axis]
    return np.broadcast_to(sign.reshape(shape), SIZE).astype(np.float32)


# ---- measures ----------------------------------------------------------------------------------------------------


def test_relative_error_of_a_constant() -> None:
    """(1.1 - 1)^2 / (1 + 0.01)."""
    assert relative_mse(flat(1.1), flat(1.0)) == pytest.approx(0.01 / 1.01, rel=1e-5)


def test_noise_of_two_halves_cancels() -> None:
    """An error of 0.2 % and halves with noise of 0.1 % each: against their mean, half of 0.1 % squared is added."""
    noisy = flat(1.0) + 0.001 * stripes(0), flat(1.0) + 0.001 * stripes(1)
    assert relative_mse(flat(1.002), *noisy) == pytest.approx(0.002**2 / 1.01, rel=0.01)
    added = relative_mse(flat(1.002), 0.5 * (noisy[0] + noisy[1])) - relative_mse(flat(1.002), *noisy)
    assert added == pytest.approx(0.5 * 0.001**2 / 1.01, rel=0.01)


def test_much_noise_cancels_where_a_smooth_picture_weighs() -> None:
    """A quarter of the pixels is dark by noise in both halves: their products are positive, and must not weigh more."""
    a, b = flat(1.0) + 0.6 * stripes(0), flat(1.0) + 0.6 * stripes(1)
    assert relative_mse(flat(1.0), a, b, flat(1.0)) == pytest.approx(0.0, abs=1e-6)
    assert relative_mse(flat(1.0), a, b) > 0.1


def test_noise_of_a_reference() -> None:
    """Independent noise of variance v in each half is v / 2 in their mean."""
    answer = measure.Answer(flat(1.0) + 0.01 * stripes(0), flat(1.0) + 0.01 * stripes(1), flat(1.0))
    assert measure.reference_noise(answer) == pytest.approx(0.5 * 0.01**2 / 1.01, rel=0.01)


def test_median_error_ignores_black_and_outliers() -> None:
    reference, picture = flat(1.0), flat(1.05)
    reference[0] = 0.0
    picture[1, 0] = 50.0
    assert measure.median_relative_error(picture, reference) == pytest.approx(0.05, rel=1e-4)


def test_constancy_and_leak() -> None:
    picture = flat(0.8)
    picture[0, 0] = 0.6
    found = measure.constancy(picture, 0.8)
    assert found["bias"] == pytest.approx(-0.25 / 32, rel=1e-4)
    assert found["largest"] == pytest.approx(0.25, rel=1e-4)
    assert measure.leak(flat(0.02), 5.0) == pytest.approx(0.004, rel=1e-5)


def test_flicker_is_what_changes() -> None:
    """A constant error does not flicker; one that changes its sign in every frame has a known deviation; noise of the
    references, independent in the two halves and in time, does not count."""
    count = 8
    times = [1.0 - 2.0 * (i % 2) for i in range(count)]
    slow = [1.0 - 2.0 * (i // 2 % 2) for i in range(count)]
    def answers(*halves: list[Picture]) -> list[measure.Answer]:
        return [measure.Answer(a, b, a) for a, b in zip(*halves, strict=True)]

    still = [flat(2.0)] * count
    assert measure.flicker([flat(2.3)] * count, answers(still, still)) == pytest.approx((0.0, 0.0), abs=1e-6)
    expected = 0.1 * math.sqrt(count / (count - 1)) / 2.0
    moving = [flat(2.0 + 0.1 * t) for t in times]
    assert measure.flicker(moving, answers(still, still)) == pytest.approx((expected, expected), rel=1e-4)
    noisy = [flat(2.0 + 0.5 * t) for t in slow]
    assert measure.flicker(moving, answers(noisy, still)) == pytest.approx((expected, expected), rel=1e-4)


def test_flip_knows_equal_pictures() -> None:
    picture = np.random.default_rng(1).random((32, 32, 3)).astype(np.float32)
    value = measure.flip(picture, picture)
    if value is None:
        pytest.skip("this OpenImageIO has no FLIP")
    assert value == pytest.approx(0.0, abs=1e-5)
    other = measure.flip(picture[::-1], picture)
    assert other is not None and other > 0.05


def test_time_to_an_error() -> None:
    """Error falls from 0.1 to 0.001 while time grows from 1 to 100: it is 0.01 at 10. A worse point does not matter."""
    def row(group: str, cpu: float, error: float) -> numbers.Row:
        return {"group": group, "cpu_ms": cpu, "full": {"relative_mse": error}}

    entry = {"stills": [row("Conelight", 100.0, 0.001), row("Conelight", 1.0, 0.1), row("samples", 50.0, 0.5),
                        row("Cycles", 2.0, 1e-9)]}
    assert numbers.time_to(entry, 0.01) == pytest.approx(10.0)
    assert numbers.time_to(entry, 0.5) == pytest.approx(1.0)
    assert numbers.time_to(entry, 1e-4) is None


def test_published_kernels_at_equal_time() -> None:
    """Our error falls from 0.1 to 0.001 while time grows from 1 to 100, so it is 0.01 at 10. Before 1 we have nothing;
    after 100 no more is known than what was reached."""
    def row(group: str, cpu: float, error: float) -> numbers.Row:
        return {"group": group, "cpu_ms": cpu, "judged": {"relative_mse": error}}

    kernels = [row("kernels", cpu, error) for cpu, error in ((10.0, 0.05), (10.0, 0.03), (0.5, 1.0), (1e3, 0.05))]
    entry = {"stills": [row("samples", 100.0, 0.001), *kernels, row("Conelight", 1.0, 0.1), row("samples", 50.0, 0.5),
                        row("voxels", 0.1, 1e-9), row("Cycles", 0.1, 1e-9)]}
    numbers.compare_kernels(entry)
    found = [kernel["equal_time"] for kernel in kernels]
    assert [own["relative_mse"] for own in found] == pytest.approx([0.01, 0.01, 0.1, 0.001])
    assert [own["ratio"] for own in found] == pytest.approx([5.0, 3.0, 10.0, 50.0])
    assert [own["holds"] for own in found] == [True, False, True, True]
    assert [own["is_reached"] for own in found] == [True, True, False, True]
    assert not any("equal_time" in other for other in entry["stills"] if other["group"] != "kernels")


def test_fetches_of_faces_and_of_pixels() -> None:
    info = {"fetches": {"gather": 600, "link": 900, "film": 20},
            "statistics": {"resolution": [5, 2], "mean_samples": 2.0, "samples": 2, "faces": 30}}
    found = numbers._fetches("conelight-draft", info)
    assert found["each"] == pytest.approx({"gather": 30.0, "link": 30.0, "film": 1.0})
    assert found["total"] == info["fetches"] and "rates" not in found


def test_rates_of_fetches() -> None:
    """From fetches counted in two passes of ten pixels, and the time of eight passes of a hundred."""
    counted = {"fetches": {"gather": 600, "link": 900, "film": 20},
               "statistics": {"resolution": [5, 2], "mean_samples": 2.0, "samples": 2, "faces": 30}}
    times = [{"name": name, "calls": 1, "cpu_ms": cpu_ms} for name, cpu_ms in (("gather", 48.0), ("link", 10.0))]
    statistics = {"resolution": [20, 5], "mean_samples": 8.0, "faces": 50, "passes": times}
    rates = {"list": 1e6, "far list": 5e5, "byte": 2e6, "trilinear": 3e6, "buffer": 4e6}
    timed = store.Result(Path(), {"statistics": statistics, "fetch_rates": rates})
    found = numbers._fetches("conelight-draft", counted, timed)
    assert found["rates"] == pytest.approx({"gather": 30.0 * 800 / 0.048, "link": 30.0 * 50 / 0.01})
    assert found["shares"]["gather"] == pytest.approx({"list": 0.5, "far list": 1.0})
    assert found["shares"]["link"] == pytest.approx({"list": 0.15, "far list": 0.3})
    table = list(report._rates([{"scene": "room", "fetches": [found]}]))
    assert table[-1] == "| room | conelight-draft | 1 | 0 | 2 | 3 | 4 | 0 (50%, 100%) | 0 (15%, 30%) |  |"
    assert "rates" not in numbers._fetches("conelight-draft", counted, store.Result(Path(), {"statistics": statistics}))


# ---- jobs --------------------------------------------------------------------------------------------------------


def parsed(*texts: str) -> arguments.Arguments:
    return arguments.parse(texts, "/nowhere")


def test_a_job_survives_json_and_its_key_depends_on_all_of_it() -> None:
    job = Job("conelight", (8, 6), 3, "final", (("bounces", "2"),), frames=2, motion=catalogue.Motion((1, 0, 0), 5.0))
    assert Job.from_dict(json.loads(json.dumps(job.as_dict()))) == job
    others = [replace(job, samples=4), replace(job, motion=None), replace(job, size=(8, 7)), replace(job, seed=1)]
    keys = {other.key("code") for other in (job, *others)} | {job.key("other code")}
    assert len(keys) == len(others) + 2


def test_rooms_that_are_dim_have_more_bounces_in_all_of_cycles() -> None:
    (dim, usual), _ = plans(parsed("--scenes", "rooms_open_1", "interior", "--peers", "cycles-4", "conelight-draft"))
    cycles = [job for job in dim.jobs if job.engine == "cycles"]
    assert len(cycles) > 6 and {job.bounces for job in cycles} == {catalogue.DIM_BOUNCES}
    assert {job.bounces for job in dim.jobs if job.engine != "cycles"} == {job.bounces for job in usual.jobs} == {0}
    assert "bounces" not in usual.jobs[0].as_dict() and usual.jobs[0].key() != replace(usual.jobs[0], bounces=8).key()


def test_code_is_known_without_its_comments(tmp_path: Path) -> None:
    def code(text: str) -> str:
        path = tmp_path / "module.py"
        path.write_text(text, encoding="utf-8")
        return store.bare_code(path)

    plain = code('"""One."""\ndef f(x):\n    """Two."""\n    return x + 1\n')
    assert plain == code('"""Other."""\n# no\ndef f(x):\n    """Words."""\n    return (x +\n        1)\n')
    assert plain != code('"""One."""\ndef f(x):\n    """Two."""\n    return x + 2\n')


def test_changes_to_shaders_are_in_a_key_only_where_they_are_made() -> None:
    plain = Job("conelight", (8, 6))
    changed = [replace(plain, kernel="seed-6"), replace(plain, counts_fetches=True)]
    assert not {"kernel", "counts_fetches"} & set(plain.as_dict())
    assert len({job.key() for job in (plain, *changed)}) == len({job.process for job in (plain, *changed)}) == 3
    for job in changed:
        assert Job.from_dict(json.loads(json.dumps(job.as_dict()))) == job
        assert store.shader_changes(job) and not store.shader_changes(plain)


def test_plan_of_kernels_and_fetches() -> None:
    """Kernels trace cones, with few passes and many; fetches are counted once for what differs only in its passes."""
    (plan,), _ = plans(parsed("--scenes", "interior", "--peers", "kernel-*", "conelight-draft", "samples-4", "cycles-4",
                              "--only", "stills"))
    kernels = [plan.stills[f"kernel-{name}{many}"] for name in ("seed-6", "six-60", "sixteen") for many in ("", "-x4")]
    assert all(("gather_mode", "CONES") in job.assignments and job.kernel and job.passes for job in kernels)
    assert [job.samples for job in kernels] == [1, 4] * 3
    assert set(plan.fetches) == {"conelight-draft", "kernel-seed-6", "kernel-six-60", "kernel-sixteen"}
    assert all(job.counts_fetches and job in plan.jobs for job in plan.fetches.values())


def test_plan_of_a_scene() -> None:
    (plan,), missing = plans(parsed("--scenes", "cornell_area", "--peers", "conelight*", "cycles-4", "--presets",
                                    "draft", "--only", "stills"))
    assert not missing
    assert set(plan.stills) == {"conelight-draft", "cycles-4"}
    assert all(job.passes for job in plan.stills.values())
    assert set(plan.reference) == {"a", "b", "smooth"}  # lamps only: its own passes tell what is direct
    seeds = {job.seed for job in plan.reference.values()}
    assert len(seeds) == 3 and not seeds & {job.seed for job in plan.stills.values()}


def test_plan_with_lamps_and_sky_needs_the_lamps_alone() -> None:
    (plan,), _ = plans(parsed("--scenes", "interior", "--only", "references"))
    assert plan.reference["direct"].lamps_only
    assert not plan.stills and not plan.sequences
    assert {job.frames for job in plan.sequence_reference.values()} == {catalogue.FRAMES}


def test_what_needs_no_reference_has_no_peers() -> None:
    (plan,), _ = plans(parsed("--scenes", "furnace_box_0.8", "--only", "stills"))
    assert not plan.reference
    assert {peers.PEERS[name].engine for name in plan.stills} == {"conelight"}


def test_voxels_of_a_scene_and_of_a_peer() -> None:
    scene = catalogue.SCENES["rooms_open_1"]
    own = dict(peers.PEERS["conelight-final"].job(scene, scene.size).assignments)
    assert own == {"voxel_auto": "off", "voxel_resolution": "128"}
    assert dict(peers.PEERS["voxels-64"].job(scene, scene.size).assignments)["voxel_resolution"] == "64"


def test_unknown_names_are_said() -> None:
    with pytest.raises(CommandError, match="no scene 'nowhere'"):
        plans(parsed("--scenes", "nowhere"))
    with pytest.raises(CommandError, match="no peer 'cycles-3'"):
        plans(parsed("--peers", "cycles-3"))


def test_walls_have_the_voxels_they_should() -> None:
    pytest.importorskip("pxr")
    from conelight_benchmark.scenes import rooms

    t = rooms.thickness(2.0, 128, rooms=2)
    voxel = (3 * t + 2 * rooms.SIDE) / 128
    assert t / voxel == pytest.approx(2.0)
