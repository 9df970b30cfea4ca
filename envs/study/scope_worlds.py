"""Thousands of scopes at once for studies: designs of one kind share a batch, whatever their numbers."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax
import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.control.follower_worlds import WorldsFollower
from haustra.envs.runs.insertions import InsertionBatch, Insertions
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.device_arrays import on_device
from haustra.envs.sim.scope_bank import BATCH_OPTIONS
from haustra.envs.sim.scope_reading import read_scope, stack_scopes
from haustra.envs.sim.scope_values import Scope
from haustra.envs.sim.scope_worlds import JaxScopes
from haustra.envs.study.halving import halved
from haustra.envs.study.questions import Engine, Runner
from haustra.envs.study.scope import SCORES, Setup, build_setup
from haustra.envs.study.study import Job, Result, Study
from haustra.errors import HaustraError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.files import find_design
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import Tables, lumen_table, stack

BATCH = 4096
"""Jobs in one call; a GPU is full with 1,000 to 8,000 scopes."""
_OUT_OF_MEMORY = "RESOURCE_EXHAUSTED"


@dataclass(frozen=True)
class _World:
    """One job, ready to share a batch."""

    job: Job
    kind: JaxScopes
    scope: Scope
    scene: Scene
    driver: FollowerSettings


class _Colons:
    """The study's colons, stacked once for the base design's radius."""

    def __init__(self, study: Study) -> None:
        self.names = tuple(map(str, study.conditions["colon"]))
        colons = [_colon(name) for name in self.names]
        self.radius = find_design("adult" if study.base == "default" else study.base).diameter / 2
        moves = bool(study.options["mesentery"])
        seen = [
            lumen_table(colon, device_radius=self.radius, with_mesentery=moves).seen_from(*entry_of(colon))
            for colon in colons
        ]
        self.lengths = np.array([colon.centreline.length for colon in colons])
        self.longest = max(colons, key=lambda colon: colon.centreline.length)
        self.tables: Tables = stack(seen)


def _start(study: Study, folder: Path) -> Runner:
    colons = _Colons(study)
    seconds = float(study.options["seconds"])

    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        worlds: list[_World] = []
        for job in jobs:
            try:
                worlds.append(_world(study, colons, job))
            except HaustraError as error:
                yield Result(job.id, "failed", reason=" ".join(str(error).split()))
        for group in _groups(worlds):
            yield from halved(lambda some: _answer(colons, some, seconds), group, full=_out_of_memory)

    return run


def _world(study: Study, colons: _Colons, job: Job) -> _World:
    setup: Setup = build_setup(study, job.variables, job.conditions)
    scene = build_scene(colons.longest, None, setup.design, _options(setup.options), show_lumen=False)
    kind = replace(JaxScopes.of(scene), table_radius=colons.radius)
    return _World(job, kind, read_scope(scene), scene, setup.driver)


def _options(asked: SceneOptions) -> SceneOptions:
    """What was asked, in the field of the lumen and with the joints of a batch where the study names none."""
    usual = SceneOptions()
    own = {
        name: getattr(BATCH_OPTIONS, name)
        for name in ("shaft_cell", "bending_cell", "twist_hinges", "sample_spacing")
        if getattr(asked, name) == getattr(usual, name)
    }
    return replace(asked, wall_law="table", softening=False, **own)


def _out_of_memory(error: Exception) -> bool:
    return isinstance(error, jax.errors.JaxRuntimeError) and _OUT_OF_MEMORY in str(error)


def _groups(worlds: Sequence[_World]) -> Iterator[list[_World]]:
    """State that can share a batch."""
    left = list(worlds)
    while left:
        first = left[0]
        same = [one for one in left if one.driver == first.driver and one.kind.same_topology(first.kind)]
        yield same
        taken = {one.job.id for one in same}
        left = [one for one in left if one.job.id not in taken]


def _answer(colons: _Colons, worlds: Sequence[_World], seconds: float) -> list[Result]:
    first = worlds[0]
    # Few sizes of batch, so that few programs are compiled; the last world fills up.
    count = 1 << (len(worlds) - 1).bit_length()
    filled = [*worlds, *[worlds[-1]] * (count - len(worlds))]
    each: dict[str, Any] = {
        "colon": np.array([colons.names.index(str(one.job.conditions["colon"])) for one in filled]),
        "stiffness": np.array([one.scene.options.wall_stiffness for one in filled]),
        "damping_time": np.array([one.scene.options.wall_damping_time for one in filled]),
        "friction": np.array([one.scene.options.friction for one in filled]),
        "push_limit": np.array([one.scene.options.push_limit for one in filled]),
    }
    parameters = first.kind.parameters(first.scene, count, scope=stack_scopes([one.scope for one in filled]), **each)
    tip_links = first.scene.cable.tip_links
    follower = WorldsFollower.of(first.scene.design, tip_links=tip_links, settings=first.driver)
    tables = on_device(colons.tables)
    runs = InsertionBatch(first.kind, follower, tables).run(parameters, seconds=seconds)
    return [
        _result(one.job, runs, index, float(colons.lengths[each["colon"][index]])) for index, one in enumerate(worlds)
    ]


def _result(job: Job, runs: Insertions, index: int, length: float) -> Result:
    outcome = runs.outcome[index]
    if outcome is Outcome.DIVERGED:
        return Result(job.id, "diverged", reason=outcome.advice)
    known: dict[str, Any] = {
        "outcome": outcome.value,
        "reach": float(runs.tip_arc_max[index]) / length,
        "tip_arc_max_m": float(runs.tip_arc_max[index]),
        "insertion_m": float(runs.insertion[index]),
        "push_force_peak_N": float(runs.push_force_peak[index]),
        "torque_peak_Nm": float(runs.torque_peak[index]),
        "wall_force_peak_N": float(runs.wall_force_peak[index]),
        "wall_force_mean_N": float(runs.wall_force_mean[index]),
        "loop_excess_peak_m": float(runs.loop_excess_peak[index]),
        "simulated_s": float(runs.simulated[index]),
    }
    # What this engine does not measure stays empty.
    return Result(job.id, "finished", scores={column.name: known.get(column.name) for column in SCORES})


def _colon(name: str) -> Colon:
    seed = name.removeprefix("grown-")
    return load_colon(Path(name)) if seed == name else grow_colon(seed=int(seed))


WORLDS = Engine(start=_start, batch=BATCH, most_workers=1)
"""One process: it fills the device by itself."""
