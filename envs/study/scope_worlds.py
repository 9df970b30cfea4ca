"""Thousands of scopes at once for studies: designs of one kind share a batch, whatever their numbers."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.control.follower_worlds import WorldsFollower
from haustra.envs.runs.insertions import InsertionBatch
from haustra.envs.runs.measure.containment import LumenWidths, stack_widths
from haustra.envs.runs.outcome import Outcome
from haustra.envs.runs.tally import Insertions
from haustra.envs.sim.capabilities import require_supported
from haustra.envs.sim.device_arrays import on_device
from haustra.envs.sim.device_backends import device_backend
from haustra.envs.sim.scope_bank import BATCH_OPTIONS
from haustra.envs.sim.scope_reading import read_scope, stack_scopes
from haustra.envs.sim.scope_values import Scope
from haustra.envs.sim.scope_worlds import JaxScopes
from haustra.envs.study.halving import halved
from haustra.envs.study.questions import Backend, Runner
from haustra.envs.study.scope import SCORES, Setup, build_setup
from haustra.envs.study.study import Job, Result, Study
from haustra.errors import HaustraError, UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.files import find_design
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import Tables, lumen_table, stack
from haustra.models.wall.signed_distance import LumenDistance

BATCH = 4096
"""Jobs in one call; a GPU is full with 1,000 to 8,000 scopes."""
RADIUS_STEP = 1e-4
"""Tables are made for the base design's radius and for steps of this from it [m]. A scope takes the nearest and touches
sooner by what is missing, at most half of this: depths are 1.8 um off then (p95, grown seed 0), where the base
design's table shifted by 1 mm was 38 um off outwards and 98 um inwards."""
_OPTIONS = {
    "stiffness": "wall_stiffness",
    "damping_time": "wall_damping_time",
    "friction": "friction",
    "push_limit": "push_limit",
    "torque_limit": "torque_limit",
    "gravity": "gravity",
}
"""Options of scenes that are numbers of each world, by their names among `Parameters`."""
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
    """The study's colons, tabulated for the radii that are asked for, each when it is first needed."""

    def __init__(self, study: Study) -> None:
        self.colons = {name: _colon(name) for name in map(str, study.conditions["colon"])}
        self.longest = max(self.colons.values(), key=lambda colon: colon.centreline.length)
        self._base = find_design("adult" if study.base == "default" else study.base).diameter / 2
        self._moves = bool(study.options["mesentery"])
        self._surfaces = {name: LumenDistance(colon) for name, colon in self.colons.items()}
        self._tables: dict[tuple[str, int], Tables] = {}

    def stacked(self, worlds: Sequence[_World]) -> tuple[Tables, LumenWidths, np.ndarray]:
        """Tables and widths of what the worlds need, and which of them each world's is."""
        asked = [(str(one.job.conditions["colon"]), self._step_of(one.scene.cable.radius)) for one in worlds]
        rows = sorted(set(asked))
        tables = stack([self._tabulated(*row) for row in rows])
        widths = stack_widths([self.colons[name] for name, _ in rows])
        return tables, widths, np.array([rows.index(one) for one in asked])

    def _step_of(self, radius: float) -> int:
        return round((radius - self._base) / RADIUS_STEP)

    def _tabulated(self, name: str, step: int) -> Tables:
        if (name, step) not in self._tables:
            colon, radius = self.colons[name], self._base + step * RADIUS_STEP
            found = lumen_table(
                colon, device_radius=radius, surface=self._surfaces[name], with_mesentery=self._moves
            ).seen_from(*entry_of(colon))
            self._tables[name, step] = found
        return self._tables[name, step]


def _start(study: Study, folder: Path, *, backend: str) -> Runner:
    colons = _Colons(study)
    seconds = float(study.options["seconds"])

    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        worlds: list[_World] = []
        for job in jobs:
            try:
                worlds.append(_world(study, colons, job, backend))
            except HaustraError as error:
                yield Result(job.id, "failed", reason=" ".join(str(error).split()))
        share = device_backend(backend).designs_share
        for group in _groups(worlds, designs_share=share):
            yield from halved(lambda some: _answer(colons, some, seconds, backend), group, full=_out_of_memory)

    return run


def _world(study: Study, colons: _Colons, job: Job, backend: str) -> _World:
    setup: Setup = build_setup(study, job.variables, job.conditions)
    scene = build_scene(colons.longest, None, setup.design, _options(setup.options), show_lumen=False)
    require_supported(scene, backend)
    return _World(job, JaxScopes.of(scene), read_scope(scene), scene, setup.driver)


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


def _groups(worlds: Sequence[_World], *, designs_share: bool) -> Iterator[list[_World]]:
    """Worlds that can share a batch."""
    left = list(worlds)
    while left:
        first = left[0]
        same = [one for one in left if _can_share(one, first, designs_share)]
        yield same
        taken = {one.job.id for one in same}
        left = [one for one in left if one.job.id not in taken]


def _can_share(one: _World, first: _World, designs_share: bool) -> bool:
    if one.driver != first.driver or not one.kind.same_topology(first.kind):
        return False
    return designs_share or jax.tree.all(jax.tree.map(np.array_equal, one.scope, first.scope))


def _answer(colons: _Colons, worlds: Sequence[_World], seconds: float, backend: str) -> list[Result]:
    first = worlds[0]
    # Few sizes of batch, so that few programs are compiled; the last world fills up.
    count = 1 << (len(worlds) - 1).bit_length()
    filled = [*worlds, *[worlds[-1]] * (count - len(worlds))]
    tables, widths, which = colons.stacked(filled)
    dynamics = device_backend(backend).of(first.scene)
    scope = stack_scopes([one.scope for one in filled]) if dynamics.designs_share else None
    options = {name: np.array([getattr(one.scene.options, own) for one in filled]) for name, own in _OPTIONS.items()}
    parameters = dynamics.parameters(first.scene, count, scope=scope, colon=which, **options)
    follower = WorldsFollower(first.driver, first.scene.cable.tip_links)
    runs = InsertionBatch(dynamics, follower, on_device(tables), widths).run(parameters, seconds=seconds)
    lengths = [colons.colons[str(one.job.conditions["colon"])].centreline.length for one in worlds]
    return [_result(one.job, runs, index, lengths[index]) for index, one in enumerate(worlds)]


def _result(job: Job, runs: Insertions, index: int, length: float) -> Result:
    outcome = runs.outcome[index]
    if outcome is Outcome.DIVERGED:
        return Result(job.id, "diverged", reason=outcome.advice)
    known: dict[str, Any] = {
        "outcome": outcome.value,
        "escaped": float(outcome is Outcome.ESCAPED),
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
    # What this backend does not measure stays empty.
    return Result(job.id, "finished", scores={column.name: known.get(column.name) for column in SCORES})


def _colon(name: str) -> Colon:
    seed = name.removeprefix("grown-")
    return load_colon(Path(name)) if seed == name else grow_colon(seed=int(seed))


def _prepare_warp(study: Study, folder: Path, tell: Callable[[str], None]) -> None:
    if study.options["mesentery"]:
        raise UnsupportedSceneError("Colons that move on their mesentery need the backend 'jax': name it.")


WORLDS = Backend(start=partial(_start, backend="jax"), batch=BATCH, most_workers=1)
"""One process: it fills the device by itself."""
WARP_WORLDS = Backend(start=partial(_start, backend="warp"), batch=BATCH, most_workers=1, prepare=_prepare_warp)
"""MuJoCo's own dynamics; each design has a batch of its own."""
