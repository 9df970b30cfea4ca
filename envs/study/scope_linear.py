"""Studies of scopes in linear time: designs that differ in their numbers only share one program."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from haustra.envs.runs.linear_insertions import LinearInsertions
from haustra.envs.runs.tally import Insertions
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.scope_reading import stack_scopes
from haustra.envs.study.questions import Backend, Runner
from haustra.envs.study.scope_batch import World, options_of, prepare, runner
from haustra.envs.study.scope_colons import StudyColons
from haustra.envs.study.study import Study

_FEW, _MANY = 32, 8192
"""Jobs in one call: so many that a CPU's registers are full and progress shows; a GPU is full with thousands."""


def _start(study: Study, folder: Path, *, device: Literal["cpu", "cuda"]) -> Runner:
    return runner(
        study,
        folder,
        backend="linear",
        answer=partial(_answer, device=device),
        can_share=_can_share,
        threads=1 if device == "cpu" else os.cpu_count() or 1,
        together=device == "cuda",
    )


def _can_share(one: World, first: World) -> bool:
    alike = one.scene.options.timestep == first.scene.options.timestep
    return alike and one.driver.straighten == first.driver.straighten and one.chain.same_structure(first.chain)


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


LINEAR = Backend(start=partial(_start, device="cpu"), batch=_FEW, prepare=prepare)
LINEAR_GPU = Backend(start=partial(_start, device="cuda"), batch=_MANY, most_workers=1, prepare=prepare)
"""One process: it fills the device by itself."""
