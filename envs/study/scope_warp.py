"""Studies of scopes by MuJoCo's own dynamics on MuJoCo Warp: each design has a batch of its own."""

from collections.abc import Sequence
from pathlib import Path

import jax
import numpy as np

from haustra.envs.control.follower_worlds import WorldsFollower
from haustra.envs.runs.insertions import InsertionBatch
from haustra.envs.runs.measure.containment import stack_widths
from haustra.envs.runs.tally import Insertions
from haustra.envs.sim.device_arrays import on_device
from haustra.envs.sim.warp_setup import use_warp
from haustra.envs.study.questions import Backend, Runner
from haustra.envs.study.scope_batch import World, options_of, prepare, runner
from haustra.envs.study.scope_colons import StudyColons
from haustra.envs.study.study import Study

BATCH = 4096
"""Jobs in one call; a GPU is full with 1,000 to 8,000 scopes."""
_OUT_OF_MEMORY = "RESOURCE_EXHAUSTED"


def _start(study: Study, folder: Path) -> Runner:
    return runner(study, folder, backend="warp", answer=_answer, can_share=_can_share, out_of_memory=_out_of_memory)


def _out_of_memory(error: Exception) -> bool:
    return isinstance(error, jax.errors.JaxRuntimeError) and _OUT_OF_MEMORY in str(error)


def _can_share(one: World, first: World) -> bool:
    alike = one.driver == first.driver and one.scene.options.timestep == first.scene.options.timestep
    return alike and jax.tree.all(jax.tree.map(np.array_equal, one.scope, first.scope))


def _answer(colons: StudyColons, worlds: Sequence[World], seconds: float) -> Insertions:
    first = worlds[0]
    # Few sizes of batch, so that few programs are compiled; the last world fills up.
    count = 1 << (len(worlds) - 1).bit_length()
    filled = [*worlds, *[worlds[-1]] * (count - len(worlds))]
    tables, own, which = colons.stacked([(one.colon, one.scene.cable.radius) for one in filled])
    use_warp()
    from haustra.envs.sim.warp_scopes import WarpScopes

    dynamics = WarpScopes.of(first.scene)
    parameters = dynamics.parameters(first.scene, count, colon=which, **options_of(filled))
    follower = WorldsFollower(first.driver, first.scene.cable.tip_links)
    return InsertionBatch(dynamics, follower, on_device(tables), stack_widths(own)).run(parameters, seconds=seconds)


WARP = Backend(start=_start, batch=BATCH, together=True, most_workers=1, prepare=prepare)
