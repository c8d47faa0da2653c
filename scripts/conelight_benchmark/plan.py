# SPDX-License-Identifier: GPL-3.0-or-later
"""From a command line to the jobs of each scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

from conelight_cli.errors import USAGE, CommandError

from . import catalogue, peers
from .arguments import Arguments
from .catalogue import MOTIONS, SCENES, BenchmarkScene
from .job import Job
from .peers import PEERS, Peer


@dataclass(frozen=True)
class Plan:
    """Everything to render of one scene, by the names of peers, and those of a reference's parts."""

    scene: BenchmarkScene
    reference: dict[str, Job] = field(default_factory=dict)
    stills: dict[str, Job] = field(default_factory=dict)
    fetches: dict[str, Job] = field(default_factory=dict)  # of some of these peers
    sequence_reference: dict[str, Job] = field(default_factory=dict)
    sequences: dict[str, Job] = field(default_factory=dict)

    @property
    def jobs(self) -> list[Job]:
        parts = (self.reference, self.stills, self.fetches, self.sequence_reference, self.sequences)
        return [job for part in parts for job in part.values()]


def plans(arguments: Arguments) -> tuple[list[Plan], list[str]]:
    """What is to be done, and sentences about what cannot. Raises CommandError for a pattern that fits nothing."""
    scenes = _chosen("scene", SCENES, arguments.scenes or (catalogue.QUICK_SCENES if arguments.quick else ("*",)))
    everyone = [PEERS[name] for name in _chosen(
        "peer", PEERS, arguments.peers or (peers.QUICK if arguments.quick else ("*",))
    )]
    everyone = [peer for peer in everyone if not peer.preset or peer.group != "Conelight"
                or peer.preset in arguments.presets]
    result, missing = [], []
    for name in scenes:
        scene = SCENES[name]
        if scene.needs is not None and not scene.needs.is_file():
            missing.append(f"scene '{name}' is left out: there is no file '{scene.needs}'")
            continue
        result.append(_plan(scene, everyone, arguments))
    return result, missing


def _plan(scene: BenchmarkScene, everyone: Sequence[Peer], arguments: Arguments) -> Plan:
    size = arguments.resolution or (catalogue.QUICK_SIZE if arguments.quick else scene.size)
    samples = arguments.reference_samples or (
        catalogue.QUICK_REFERENCE_SAMPLES if arguments.quick else scene.reference_samples
    )
    # All that is reported needs references; "only" leaves out the rest of what was not asked for.
    stills = {"references", "stills"} & set(arguments.only)
    reference = peers.reference_jobs(scene, size, samples) if stills and scene.has_reference else {}
    here = [peer for peer in everyone if scene.has_reference or peer.group in peers.ALONE]
    plan = Plan(scene, reference)
    if "stills" in arguments.only:
        plan.stills.update({peer.name: peer.job(scene, size) for peer in here})
        if scene.has_reference and not arguments.quick:
            plan.fetches.update(_counts(plan.stills))
    if scene.name in MOTIONS and not arguments.quick and {"references", "sequences"} & set(arguments.only):
        _add_sequences(plan, everyone, arguments)
    return plan


def _counts(stills: dict[str, Job]) -> Iterator[tuple[str, Job]]:
    """Of peers that differ only in their passes, the first."""
    found = set()
    for name, still in stills.items():
        if PEERS[name].group in peers.COUNTED:
            job = replace(still, samples=peers.COUNTED_SAMPLES, passes=False, counts_fetches=True)
            if job not in found:
                found.add(job)
                yield name, job


def _add_sequences(plan: Plan, everyone: Sequence[Peer], arguments: Arguments) -> None:
    size = arguments.resolution or catalogue.SEQUENCE_SIZE
    samples = arguments.reference_samples or catalogue.SEQUENCE_REFERENCE_SAMPLES

    def along(job: Job) -> Job:
        return replace(job, frames=catalogue.FRAMES, motion=MOTIONS[plan.scene.name], passes=False)

    halves = peers.reference_jobs(plan.scene, size, samples)
    plan.sequence_reference.update({name: along(halves[name]) for name in ("a", "b", "smooth")})
    if "sequences" in arguments.only:
        chosen = [peer for peer in everyone if arguments.peers or peer.name in peers.SEQUENCE]
        plan.sequences.update({peer.name: along(peer.job(plan.scene, size)) for peer in chosen})


def _chosen(what: str, known: Iterable[str], patterns: Iterable[str]) -> list[str]:
    names = list(known)
    result: dict[str, None] = {}
    for pattern in patterns:
        fitting = [name for name in names if fnmatchcase(name, pattern)]
        if not fitting:
            raise CommandError(f"there is no {what} '{pattern}'; known: {', '.join(names)}", USAGE)
        result.update(dict.fromkeys(fitting))
    return [name for name in names if name in result]
