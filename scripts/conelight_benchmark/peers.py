# SPDX-License-Identifier: GPL-3.0-or-later
"""Who is measured: engines with their numbers, by name. A variant of Conelight is a peer with other settings, or with
another kernel in place of its gather."""

from __future__ import annotations

from dataclasses import dataclass, replace

from conelight_cli.arguments import PRESET_NAMES

from .catalogue import BenchmarkScene
from .job import Job
from .kernels import KERNELS


@dataclass(frozen=True)
class Peer:
    """``group``: what it is compared with. ``voxels``: along the longest side, instead of the scene's. ``kernel``: as
    in :class:`.job.Job`."""

    name: str
    group: str
    engine: str
    samples: int | None = None
    preset: str | None = None
    denoiser: str = ""
    voxels: int | None = None
    assignments: tuple[tuple[str, str], ...] = ()
    kernel: str = ""

    def job(self, scene: BenchmarkScene, size: tuple[int, int]) -> Job:
        """What is rendered for this peer."""
        assignments = self.assignments
        voxels = self.voxels or scene.voxels
        if self.engine == "conelight" and voxels is not None:
            assignments = (("voxel_auto", "off"), ("voxel_resolution", str(voxels)), *assignments)
        splits = self.engine == "conelight" or (self.engine == "cycles" and not self.denoiser)
        return Job(
            self.engine, size, samples=self.samples, preset=self.preset, assignments=assignments,
            denoiser=self.denoiser, passes=splits and scene.measure == "indirect", kernel=self.kernel,
            bounces=scene.bounces if self.engine == "cycles" else 0,
        )

    @property
    def curve(self) -> str:
        """What its points are joined by in a plot of error against time."""
        if self.kernel:
            return f"kernel {self.kernel}"
        return {"Conelight": "Conelight, presets", "samples": "Conelight, samples"}.get(self.group, self.group)


CYCLES_SAMPLES = (1, 4, 16, 64, 256)
VOXELS = (32, 64, 128, 256)
SAMPLES = (1, 2, 4, 8, 16, 32, 64, 128)

#: Passes of the published kernels. They are the same in every pass: more passes only smooth edges and soft shadows.
KERNEL_SAMPLES = (1, 4, 16)


def _kernel(name: str, samples: int) -> Peer:
    return Peer(
        f"kernel-{name}" + (f"-x{samples}" if samples > 1 else ""), "kernels", "conelight", samples, preset="balanced",
        assignments=(("gather_mode", "CONES"),), kernel=name,
    )


PEERS: dict[str, Peer] = {
    peer.name: peer
    for peer in (
        *(Peer(f"conelight-{name}", "Conelight", "conelight", preset=name) for name in PRESET_NAMES),
        *(Peer(f"cycles-{n}", "Cycles", "cycles", n) for n in CYCLES_SAMPLES),
        *(Peer(f"cycles-{n}-oidn-fast", "Cycles + OIDN fast", "cycles", n, denoiser="fast") for n in CYCLES_SAMPLES),
        *(Peer(f"cycles-{n}-oidn", "Cycles + OIDN", "cycles", n, denoiser="default") for n in CYCLES_SAMPLES),
        Peer("eevee-16", "EEVEE", "eevee", 16),
        *(Peer(f"voxels-{n}", "voxels", "conelight", preset="balanced", voxels=n) for n in VOXELS),
        *(Peer(f"samples-{n}", "samples", "conelight", n, preset="balanced") for n in SAMPLES),
        *(_kernel(name, n) for name in KERNELS for n in KERNEL_SAMPLES),
    )
}

#: Of a scene that needs no path tracer to know the answer, only our own numbers are of interest.
ALONE = ("Conelight", "voxels", "kernels")

QUICK = ("conelight-draft", "conelight-balanced", "cycles-1", "cycles-4", "cycles-16", "cycles-4-oidn-fast")
SEQUENCE = ("conelight-draft", "conelight-balanced", "cycles-4", "cycles-4-oidn-fast")

#: Groups whose fetches are counted, and in how many passes.
COUNTED, COUNTED_SAMPLES = ("Conelight", "kernels"), 2

REFERENCE_SEEDS = (101, 102, 103)  # no other render has them: noise of one must not be in another
SMOOTH_SHARE = 4  # one part in so many of a half's samples is enough where noise is removed


def reference_jobs(scene: BenchmarkScene, size: tuple[int, int], samples: int) -> dict[str, Job]:
    """The path-traced answer: two halves, ``smooth``, without noise, and ``direct``, what lamps light, where a scene's
    own passes do not tell."""
    half = Job("cycles", size, samples, seed=REFERENCE_SEEDS[0], passes=scene.measure == "indirect", timed=False,
               bounces=scene.bounces)
    jobs = {"a": half, "b": replace(half, seed=REFERENCE_SEEDS[1])}
    jobs["smooth"] = replace(half, samples=max(samples // SMOOTH_SHARE, 1), seed=REFERENCE_SEEDS[2], passes=False,
                             denoiser="default")
    if half.passes and scene.has_lamps and scene.has_surroundings:
        jobs["direct"] = replace(half, lamps_only=True, passes=False)
    return jobs
