"""Thousands of tracked designs at once for studies, on an NVIDIA GPU by MuJoCo Warp."""

import time
from collections.abc import Iterable, Iterator, MutableMapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.runs.warp_rigs import WarpRigs
from haustra.envs.study.halving import halved
from haustra.envs.study.propulsion import (
    Steady,
    TabulatedColon,
    build_case,
    result_of,
    rig_of,
    roll_torque,
    touches_too_little,
)
from haustra.envs.study.questions import Backend, Runner
from haustra.envs.study.study import Job, Result, Study
from haustra.errors import HaustraError

BATCH = 16384
"""Jobs in one call; a GPU is full with 8,000 to 32,000 tracks."""
_OUT_OF_MEMORY = "Failed to allocate"


@dataclass(frozen=True)
class _World:
    """One job, ready to share a batch."""

    job: Job
    case: TabulatedColon

    @property
    def rig(self) -> tuple[Any, float]:
        """What its rig depends on; speed and friction are a world's own."""
        return self.case.design, self.case.indentation


def _start(study: Study, folder: Path) -> Runner:
    return lambda jobs: answer_worlds(study, jobs)


def answer_worlds(
    study: Study, jobs: Sequence[Job], *, spent: MutableMapping[str, float] | None = None
) -> Iterable[Result]:
    """Rows of all jobs, stepped together.

    Args:
        study: of either rig.
        jobs: at least one.
        spent: filled with the wall clock that 'building' the rigs, 'stepping' them and making 'rows' took [s].
    """
    clock = _Clock({} if spent is None else spent)
    worlds: list[_World] = []
    for job in jobs:
        try:
            worlds.append(_World(job, build_case(study, job.variables, job.conditions)))
        except HaustraError as error:
            yield Result(job.id, "failed", reason=" ".join(str(error).split()))
    if worlds:
        yield from halved(lambda some: list(_answer(study, some, clock)), worlds, full=_out_of_memory)
        clock.stop("rows")


class _Clock:
    """Wall clock, part by part."""

    def __init__(self, spent: MutableMapping[str, float]) -> None:
        self._spent, self._began = spent, time.perf_counter()

    def stop(self, part: str) -> None:
        now = time.perf_counter()
        self._spent[part] = self._spent.get(part, 0.0) + now - self._began
        self._began = now


def _answer(study: Study, worlds: Sequence[_World], clock: _Clock) -> Iterator[Result]:
    kinds = {world.rig: world.case for world in worlds}
    numbers = {rig: number for number, rig in enumerate(kinds)}
    rigs = WarpRigs(
        [rig_of(study, case) for case in kinds.values()], which=np.array([numbers[world.rig] for world in worlds])
    )
    cases = [world.case for world in worlds]
    clock.stop("building")
    whole = study.options["rig"] == "tube"
    pulls = rigs.pull(
        np.array([case.speed for case in cases]),
        np.array([case.friction for case in cases]),
        roll_torque=np.array([roll_torque(case) for case in cases]) if whole else None,
    )
    clock.stop("stepping")
    for row, world in enumerate(worlds):
        if not pulls.sound[row]:
            reason = touches_too_little(float(pulls.touching[row]), float(study.options["timestep"]))
            yield Result(world.job.id, "diverged", reason=reason)
            continue
        steady = Steady(
            force=float(pulls.force[row]),
            normal=float(pulls.normal[row]),
            string=float(pulls.string[row]),
            ripple=pulls.ripple[row],
            waves=pulls.waves[row],
            tooth_frequency=world.case.speed / world.case.design.tread.pitch,
            roll=float(pulls.roll[row]),
            touching=float(pulls.touching[row]),
        )
        yield result_of(world.job, world.case, steady, whole=whole)


def _out_of_memory(error: Exception) -> bool:
    return isinstance(error, RuntimeError) and _OUT_OF_MEMORY in str(error)


WORLDS = Backend(start=_start, batch=BATCH, together=True, most_workers=1)
"""One process: it fills the device by itself."""
