"""What settings cost: processor time, every setting in turn, several times, medians.

Processor time does not count what other programs take, and turns put what they do to caches and clocks on every setting
alike. Ratios within one answer are therefore sound on a machine that is shared; absolute values are upper bounds.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from haustra.scripts.bench.result import Ended, ParetoFront, Point

REPEATS = 5
"""Turns of every setting; the median of five is not moved by two that were disturbed."""

Block = Callable[[], float]
"""Does some work and returns its cost in the front's unit."""


@dataclass(frozen=True)
class Candidate:
    """A setting whose error is known and whose cost is still to be measured."""

    setting: str
    error: float
    group: str
    block: Block | None
    """None for a setting that was refused or diverged."""
    outcome: Ended = "completed"


def processor_seconds(work: Callable[[], object]) -> float:
    """Processor time of this process that a call takes [s]."""
    began = time.process_time()
    work()
    return time.process_time() - began


def in_turns(blocks: Sequence[Block], *, repeats: int = REPEATS, warm_up: bool = True) -> list[float]:
    """Median cost of each block, all run in turn `repeats` times, by default after one turn that does not count."""
    costs = [[block() for block in blocks] for _ in range(repeats + warm_up)]
    return [float(np.median(column)) for column in zip(*costs[-repeats:], strict=True)]


def timed_front(
    question: str,
    candidates: Sequence[Candidate],
    *,
    reference: str,
    error_unit: str,
    cost_unit: str = "processor s / simulated s",
    repeats: int = REPEATS,
    warm_up: bool = True,
) -> ParetoFront:
    """Time what ran, in turns, and make a front of it all."""
    ran = [candidate for candidate in candidates if candidate.block is not None]
    blocks = [candidate.block for candidate in ran if candidate.block is not None]
    costs = dict(
        zip((id(candidate) for candidate in ran), in_turns(blocks, repeats=repeats, warm_up=warm_up), strict=True)
    )
    points = tuple(
        Point(each.setting, each.error, costs.get(id(each), np.inf), each.group, each.outcome) for each in candidates
    )
    return ParetoFront(question, reference, error_unit, cost_unit, points)


def stepping(model: mujoco.MjModel, data: mujoco.MjData, *, steps: int = 50) -> Block:
    """Steps from the state that `data` is in now, again and again: processor seconds per simulated second."""
    kept = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, kept))
    mujoco.mj_getState(model, data, state, kept)

    def block() -> float:
        mujoco.mj_setState(model, data, state, kept)
        return processor_seconds(lambda: mujoco.mj_step(model, data, steps)) / (steps * model.opt.timestep)

    return block


def sound(data: mujoco.MjData) -> bool:
    """Whether a state is finite and MuJoCo has not warned that it is unstable."""
    kinds = mujoco.mjtWarning
    bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC, kinds.mjWARN_INERTIA)
    finite = np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()
    return bool(finite and not any(data.warning[int(kind)].number for kind in bad))
