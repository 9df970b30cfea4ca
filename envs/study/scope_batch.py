"""Many scopes at once for studies: jobs become worlds, and worlds of a kind share a batch, whatever their numbers."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from haustra.children import cores
from haustra.envs.runs.measure.injury import perforation_scores
from haustra.envs.runs.outcome import Outcome
from haustra.envs.runs.tally import Insertions
from haustra.envs.sim.scope_colon_set import BATCH_OPTIONS
from haustra.envs.sim.scope_reading import ScopeChain, read_chain, read_scope
from haustra.envs.sim.scope_values import Scope
from haustra.envs.study.halving import halved
from haustra.envs.study.questions import Runner
from haustra.envs.study.sampling import conditions_of, designs_of
from haustra.envs.study.scope import SCORES, Setup, build_setup, prepare_colons
from haustra.envs.study.scope_colons import StudyColons
from haustra.envs.study.study import Job, Result, Study
from haustra.errors import HaustraError
from haustra.models.anatomy.colon import Colon
from haustra.models.presets import find_preset
from haustra.models.scene import Scene, SceneOptions, build_scene

_OPTIONS = {
    "stiffness": "wall_stiffness",
    "damping_time": "wall_damping_time",
    "friction": "friction",
    "push_limit": "push_limit",
    "torque_limit": "torque_limit",
    "gravity": "gravity",
}
"""Options of scenes that are numbers of each world, by their names there."""


@dataclass(frozen=True)
class World:
    """One job, ready to share a batch."""

    job: Job
    chain: ScopeChain
    scope: Scope
    scene: Scene
    driver: Any

    @property
    def colon(self) -> str:
        """Name of its colon."""
        return str(self.job.conditions["colon"])


Answer: TypeAlias = Callable[[StudyColons, Sequence[World], float], Insertions]
"""Runs worlds of one batch for so many seconds."""


def runner(
    study: Study,
    folder: Path,
    *,
    backend: str,
    answer: Answer,
    can_share: Callable[[World, World], bool],
    threads: int = 1,
    side_by_side: int = 1,
    largest: int | None = None,
    out_of_memory: Callable[[Exception], bool] = lambda error: isinstance(error, MemoryError),
) -> Runner:
    """Answer jobs of a study in batches.

    Args:
        study: the study.
        folder: of the study.
        backend: of `haustra.envs.sim.capabilities.BACKENDS`; what it cannot honour fails the job.
        answer: runs a batch.
        can_share: whether two worlds can be in one batch.
        threads: on which colons are tabulated.
        side_by_side: how many batches run at a time.
        largest: batch, in worlds; as many as can share one when None.
        out_of_memory: whether an exception says that a batch was too large.
    """
    colons = StudyColons(study, folder, threads=threads)
    seconds = float(study.options["seconds"])

    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        worlds: list[World] = []
        built: dict[Any, World] = {}
        for job in jobs:
            try:
                worlds.append(_world(study, colons, job, backend, built))
            except HaustraError as error:
                yield Result(job.id, "failed", reason=" ".join(str(error).split()))
        groups = [part for group in _groups(worlds, can_share) for part in _parts(group, largest or len(group))]

        def answers(group: list[World]) -> list[Result]:
            return halved(lambda some: _answered(colons, some, seconds, answer), group, full=out_of_memory)

        with ThreadPoolExecutor(side_by_side) as pool:
            for found in pool.map(answers, groups):
                yield from found

    return run


def prepare(study: Study, folder: Path, tell: Callable[[str], None]) -> None:
    """Grow the study's colons and tabulate them for all of its designs, on every core: workers read what they find.

    Raises:
        HaustraError: when a colon cannot be grown or read.
    """
    prepare_colons(study, folder, tell)
    tell("tabulating colons")
    conditions, radii = conditions_of(study)[0], set()
    for design in designs_of(study):
        with suppress(HaustraError):  # its jobs will say why
            radii.add(build_setup(study, design, conditions).design.diameter / 2)
    StudyColons(study, folder, threads=cores()).tabulate_for(radii)


def options_of(worlds: Sequence[World]) -> dict[str, Any]:
    """Options that differ by world, by their names there."""
    return {
        name: np.array([getattr(one.scene.options, own) for one in worlds], float) for name, own in _OPTIONS.items()
    }


def _world(study: Study, colons: StudyColons, job: Job, backend: str, built: dict[Any, World]) -> World:
    """The world of a job; jobs that differ by their colon only share their scene."""
    about = {**job.variables, **{name: value for name, value in job.conditions.items() if name != "colon"}}
    key = tuple(sorted(about.items()))
    if key not in built:
        setup: Setup = build_setup(study, job.variables, job.conditions)
        about = {"show_lumen": False, "to_save": False}
        scene = build_scene(colons.longest, None, setup.design, _options(setup.options), **about)
        chain, scope = read_chain(scene, backend=backend), read_scope(scene, backend=backend)
        built[key] = World(job, chain, scope, scene, setup.driver)
    return replace(built[key], job=job)


def _options(asked: SceneOptions) -> SceneOptions:
    """What was asked, in the field of the lumen and with the joints of a batch where the study names none."""
    usual = find_preset("balanced").against(asked.wall_law)
    own = {
        name: getattr(BATCH_OPTIONS, name)
        for name in ("shaft_cell", "bending_cell", "twist_hinges", "sample_spacing")
        if getattr(asked, name) == usual[name]
    }
    return replace(asked, wall_law="table", softening=False, **own)


def _groups(worlds: Sequence[World], can_share: Callable[[World, World], bool]) -> Iterator[list[World]]:
    """Worlds that can share a batch."""
    left = list(worlds)
    while left:
        first = left[0]
        same = [one for one in left if can_share(one, first)]
        yield same
        taken = {one.job.id for one in same}
        left = [one for one in left if one.job.id not in taken]


def _parts(group: list[World], largest: int) -> list[list[World]]:
    """A group in batches of that many worlds at most."""
    return [group[first : first + largest] for first in range(0, len(group), largest)]


def _answered(colons: StudyColons, worlds: Sequence[World], seconds: float, answer: Answer) -> list[Result]:
    runs = answer(colons, worlds, seconds)
    return [_result(one.job, runs, index, colons.colons[one.colon]) for index, one in enumerate(worlds)]


def _result(job: Job, runs: Insertions, index: int, colon: Colon) -> Result:
    outcome = runs.outcome[index]
    if outcome is Outcome.DIVERGED:
        return Result(job.id, "diverged", reason=outcome.advice)
    known: dict[str, Any] = {
        "outcome": outcome.value,
        "escaped": float(outcome is Outcome.ESCAPED),
        "reach": float(runs.tip_arc_max[index]) / colon.centreline.length,
        "tip_arc_max_m": float(runs.tip_arc_max[index]),
        "insertion_m": float(runs.insertion[index]),
        "push_force_peak_N": float(runs.push_force_peak[index]),
        "torque_peak_Nm": float(runs.torque_peak[index]),
        "wall_force_peak_N": float(runs.wall_force_peak[index]),
        "wall_force_mean_N": float(runs.wall_force_mean[index]),
        "loop_excess_peak_m": float(runs.loop_excess_peak[index]),
        **perforation_scores(float(runs.load_peak[index]), float(runs.load_arc[index]), colon),
        "pain_peak": float(runs.pain_peak[index]),
        "simulated_s": float(runs.simulated[index]),
    }
    # What these backends do not measure stays empty.
    return Result(job.id, "finished", scores={column.name: known.get(column.name) for column in SCORES})
