"""Studies of scopes in linear time: designs that differ in their numbers only share one program."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from haustra.children import cores
from haustra.envs.runs.linear_insertions import LinearInsertions
from haustra.envs.runs.tally import Insertions
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.scope_reading import stack_scopes
from haustra.envs.study.questions import Backend, Runner
from haustra.envs.study.scope_batch import World, options_of, prepare, runner
from haustra.envs.study.scope_colons import StudyColons
from haustra.envs.study.study import Study

_JOBS = 512
"""Jobs between two reports of progress on a CPU."""
_MANY = 8192
"""Jobs in one call on a GPU, which is full with thousands."""
_PER_THREAD = 32
"""Worlds that a thread steps: the lanes of a register, four times."""
_ALIKE = ("timestep", "gas", "gas_flow", "gas_start", "water")
"""Options of scenes that all worlds of a batch have in common."""
_BATCHES = 16
"""Batches of a GPU at a time: each alone would wait for its memory."""


def _start(study: Study, folder: Path) -> Runner:
    processes = cores()
    answer = partial(_answer, device="cpu")
    own: dict[str, Any] = {"answer": answer, "can_share": _can_share, "threads": processes, "side_by_side": processes}
    return runner(study, folder, backend="linear", largest=_PER_THREAD, **own)


def _start_gpu(study: Study, folder: Path) -> Runner:
    answer = partial(_answer, device="cuda")
    own: dict[str, Any] = {"answer": answer, "can_share": _can_share, "side_by_side": _BATCHES}
    return runner(study, folder, backend="linear", threads=cores(), **own)


def _can_share(one: World, first: World) -> bool:
    alike = all(getattr(one.scene.options, name) == getattr(first.scene.options, name) for name in _ALIKE)
    drivers = [(type(world.driver), world.driver.straighten) for world in (one, first)]
    return alike and drivers[0] == drivers[1] and one.chain.same_structure(first.chain)


def _answer(
    colons: StudyColons, worlds: Sequence[World], seconds: float, *, device: Literal["cpu", "cuda"]
) -> Insertions:
    tables, own, which = colons.stacked([(one.colon, one.scene.cable.radius) for one in worlds])
    batch = LinearInsertions(
        worlds[0].scene,
        tables,
        own,
        worlds=len(worlds),
        settings=[one.driver for one in worlds],
        device=device,
        scopes=stack_scopes([one.scope for one in worlds]),
    )
    options = options_of(worlds)
    conditions = Conditions(options.pop("friction"), options.pop("stiffness"), np.ones(len(worlds)))
    batch.begin(which, conditions, options)
    return batch.run(seconds=seconds)


LINEAR = Backend(start=_start, batch=_JOBS, together=True, most_workers=1, prepare=prepare)
"""One process, whose threads share its colons, tables and program."""
LINEAR_GPU = Backend(start=_start_gpu, batch=_MANY, together=True, most_workers=1, prepare=prepare)
"""One process: it fills the device by itself."""
