"""Derivatives in linear time: against finite differences, and what they cost."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.gradients import Direction, Gradients
from haustra.envs.sim.scope_colon_set import ScopeColonSet
from haustra.envs.sim.state import Controls, Readings
from haustra.scripts.bench.linear import Hands, conditions

PARAMETERS = {
    "pull": (Direction(pulls=(1.0, 0.0, 0.0, 0.0)), 1.0),
    "push_rate": (Direction(push_rate=1.0), 0.01),
    "shaft_stiffness": (Direction(shaft_stiffness=1.0), 1.0),
    "friction": (Direction(friction=1.0), 0.1),
    "wall_stiffness": (Direction(wall_stiffness=1.0), 1000.0),
}
"""Parameters by name: the direction, and how large each is, about."""

READINGS = ("tip", "bend", "insertion", "push_force", "wall_force_sum", "link_forces", "displacement")

STEPS = (1e-3, 1e-5, 1e-6, 1e-7)
"""Steps of central differences over a parameter's size."""
_LEAST_PULL = 1.0
"""No wire is slack [N]: a pull that is clipped at 0 has another derivative on each side."""
_INTERVAL = 0.125
"""The hand changes its mind so often [s]; `Hands`."""


@dataclass(frozen=True)
class Agreement:
    """Derivatives of all readings by one parameter, against central differences."""

    parameter: str
    error: float
    """Largest difference over the largest derivative of that reading; of each world, that with the best of `STEPS`:
    of longer ones what switches and curves shows, of shorter ones rounding [1]."""
    reading: str
    """Which reading that is."""
    errors: tuple[float, ...]
    """Largest difference over the largest derivative of that reading with each of `STEPS` [1]."""


@dataclass(frozen=True)
class SlopeCost:
    """What a time step with derivatives takes."""

    directions: int
    """Along how many; 0 is the plain program in double precision, the worlds in lanes."""
    us_per_step: float
    """Processor time of a step of one world [us]."""
    plain_steps: float
    """Processor time over the plain program's in the same run [1]; central differences take 2 of those a direction."""


def costs(bank: ScopeColonSet, directions: Sequence[int], *, worlds: int = 16, seconds: float = 4.0) -> list[SlopeCost]:
    """Along so many directions, on one core, from where random hands have brought scopes.

    Programs take turns, so that what else the machine does falls on all of them.
    """
    count, case = round(_INTERVAL / bank.scene.options.timestep), np.arange(worlds) % len(bank.colons)
    own, friction = conditions(bank, worlds), Direction(friction=1.0)
    plain = LinearBackend(bank.scene, bank.tables, worlds=worlds, real=np.float64)
    plain.reset(np.arange(worlds), case, own)
    steps: dict[int, Callable[[Controls, int], object]] = {0: plain.step}
    for number in directions:
        scopes = Gradients(bank.scene, bank.tables, worlds=worlds, directions=[friction] * number)
        scopes.reset(case, own)
        steps[number] = scopes.step
    best = dict.fromkeys(steps, np.inf)
    for inputs in random_script(worlds, seconds + 4.0):
        timed = plain.read().time[0] > seconds
        for number, step in steps.items():
            began = time.process_time()
            step(inputs, count)
            best[number] = min(best[number], time.process_time() - began if timed else np.inf)
    return [SlopeCost(number, taken / count / worlds * 1e6, taken / best[0]) for number, taken in sorted(best.items())]


def random_script(worlds: int, seconds: float) -> list[Controls]:
    """A hand that pushes and pulls at random, with no wire slack, for intervals of `_INTERVAL`."""
    hands = Hands(worlds)
    inputs = [hands.next() for _ in range(round(seconds / _INTERVAL))]
    return [each._replace(pulls=each.pulls + _LEAST_PULL) for each in inputs]


def agreement(bank: ScopeColonSet, *, worlds: int = 8, seconds: float = 4.0) -> list[Agreement]:
    """Derivatives at the end of insertions by random hands, by each parameter, against central differences."""
    script, case = random_script(worlds, seconds), np.arange(worlds) % len(bank.colons)
    own, count = conditions(bank, worlds), round(_INTERVAL / bank.scene.options.timestep)
    directions = [direction for direction, _ in PARAMETERS.values()]
    scopes = Gradients(bank.scene, bank.tables, worlds=worlds, directions=directions)
    scopes.reset(case, own)
    *_, (_, slopes) = scopes.rollout(script, count)
    scopes.close()

    backend = LinearBackend(bank.scene, bank.tables, worlds=worlds, real=np.float64)

    def ended(direction: Direction, by: float) -> Readings:
        names = ("friction", "wall_stiffness", "shaft_stiffness")
        moved = {name: getattr(own, name) + by * getattr(direction, name) for name in names}
        backend.reset(np.arange(worlds), case, replace(own, **moved))
        for inputs in script:
            pulls, rate = inputs.pulls + by * np.array(direction.pulls), inputs.push_rate + by * direction.push_rate
            backend.step(inputs._replace(pulls=pulls, push_rate=rate), count)
        return backend.read()

    found = []
    for number, (name, (direction, size)) in enumerate(PARAMETERS.items()):
        along = Readings(*(None if each is None else each[:, number] for each in slopes))
        apart = np.array([_differences(along, ended, direction, step * size) for step in STEPS])
        best = apart.min(axis=0).max(axis=1)
        worst = int(best.argmax())
        found.append(Agreement(name, float(best[worst]), READINGS[worst], tuple(apart.max(axis=(1, 2)).tolist())))
    return found


def _differences(
    slopes: Readings, ended: Callable[[Direction, float], Readings], direction: Direction, step: float
) -> list[np.ndarray]:
    """How far each reading's derivatives are from central differences, in each world (readings, worlds)."""
    high, low = ended(direction, step), ended(direction, -step)
    return [_apart(name, slopes, high, low, 2 * step) for name in READINGS]


def _apart(name: str, slopes: Readings, high: Readings, low: Readings, width: float) -> np.ndarray:
    """Largest difference of a reading's derivatives in each world, over the largest in any."""
    found = getattr(slopes, name)
    if found is None:
        return np.zeros(len(slopes.tip))
    found = found.reshape(len(found), -1)
    known = (getattr(high, name) - getattr(low, name)).reshape(found.shape) / width
    return np.abs(found - known).max(axis=1) / np.abs(found).max()
