"""A worked design by gradient: how an insertion tube of given mean stiffness is to spread it along its length.

EI in eight zones behind the bending section, of the same geometric mean as in the design that ships, for the least mean
wall force over an insertion by given hands in grown colons, with no less reach. Derivatives say in which direction the
profile is to change; Optuna must find that out by trying.
"""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from haustra.envs.control import follower
from haustra.envs.control.follower import FollowerSettings, Steering
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.gradients import Direction, Gradients
from haustra.envs.sim.scope_colon_set import ScopeColonSet, build_bank
from haustra.envs.sim.scope_reading import read_chain, read_scope, stack_scopes
from haustra.envs.sim.scope_values import Scope
from haustra.envs.sim.state import Controls, Readings
from haustra.models.anatomy.grown import grow_colon

ZONES = 8
"""Zones of the profile, each of one EI."""
BEHIND = 0.1, 0.7
"""Zones begin and end so far behind the tip [m]; beyond, EI is that of the last zone. Some 0.7 m go in in `SECONDS`."""
BOUND = 1.0
"""Largest logarithm of EI over the design's that is tried, before the mean is taken away [1]."""
SECONDS = 20.0
"""Length of an insertion [s]."""
FRICTIONS = 0.06, 0.1
"""Each colon is entered with each of these coefficients [1]."""
SHORTFALL = 200.0
"""What a metre of reach less than that of the design that ships costs [N/m]: as much as 0.2 N of force a millimetre.
Engineering choice."""

_INTERVAL = 0.04
"""The hand changes its mind so often [s]."""
_UNSEEN = 2, 3
"""Seeds of the colons in which what was found is tried out."""
_RATE, _DECAY = 0.2, 0.9
"""Step of Adam in logarithms of EI, and what is left of it after each step."""


@dataclass
class Search:
    """What one way of searching came to, trial after trial."""

    name: str
    seconds: list[float] = field(default_factory=list)
    """Processor time after each trial [s]: what else the machine does is in no one's favour."""
    best: list[float] = field(default_factory=list)
    """Least objective found by then [N]."""
    profile: Float[np.ndarray, " zones"] = field(default_factory=lambda: np.zeros(ZONES))
    """EI of the best over the design's [1]."""

    def tried(self, objective: float, profile: Float[np.ndarray, " zones"], since: float) -> None:
        """Note a trial."""
        if not self.best or objective < self.best[-1]:
            self.profile = profile
        self.best.append(min([objective, *self.best[-1:]]))
        self.seconds.append(time.process_time() - since)


class Problem:
    """Insertions by given hands, in all colons of a bank with each friction."""

    def __init__(
        self, bank: ScopeColonSet, *, frictions: Iterable[float] = FRICTIONS, seconds: float = SECONDS
    ) -> None:
        """Let the lumen follower drive the design that ships for so long [s]; the same hands go for every profile."""
        self.bank, colons = bank, len(bank.colons)
        friction = np.repeat(list(frictions), colons)
        self.worlds = len(friction)
        self.case, one = np.arange(self.worlds) % colons, np.ones(self.worlds)
        self.conditions = Conditions(friction, bank.scene.options.wall_stiffness * one, one)
        self._count = round(_INTERVAL / bank.scene.options.timestep)
        self._chain, self._scope = read_chain(bank.scene), read_scope(bank.scene)
        self.script, self.reach = self._drive(round(seconds / _INTERVAL))

    @cached_property
    def plain(self) -> LinearBackend:
        """Worlds without derivatives."""
        return LinearBackend(
            self.bank.scene, self.bank.tables, worlds=self.worlds, real=np.float64, scopes=self._with()
        )

    @cached_property
    def dual(self) -> Gradients:
        """Worlds with derivatives by the logarithm of each zone's EI."""
        directions = [Direction(joint_stiffness=zone.astype(float)) for zone in self.zones]
        about = {"worlds": self.worlds, "directions": directions, "scopes": self._with()}
        return Gradients(self.bank.scene, self.bank.tables, **about)

    @cached_property
    def zones(self) -> list[np.ndarray]:
        """Joints of each zone."""
        behind = np.zeros(len(self._chain.scale))
        behind[self._chain.lock_dofs.ravel()] = np.repeat(self._scope.behind[0], 2)
        edges = np.linspace(*BEHIND, ZONES + 1)
        edges[0], edges[-1] = 0.0, np.inf
        shaft = self._chain.scale == 1
        return [shaft & (behind >= near) & (behind < far) for near, far in pairwise(edges)]

    def profile(self, x: Float[np.ndarray, " zones"]) -> Float[np.ndarray, " zones"]:
        """EI of the zones over the design's, of geometric mean 1."""
        return np.exp(x - x.mean())

    def value(self, x: Float[np.ndarray, " zones"]) -> tuple[float, Float[np.ndarray, "records worlds"]]:
        """Objective [N], and the sums of wall forces over time [N]."""
        self.plain.redesign(self._with(self.profile(x)))
        self.plain.reset(np.arange(self.worlds), self.case, self.conditions)
        forces = []
        for inputs in self.script:
            self.plain.step(inputs, self._count)
            forces.append(self.plain.read().wall_force_sum)
        missing = self._missing(self.plain.read())
        return float(np.mean(forces) + SHORTFALL * missing.mean()), np.array(forces)

    def gradient(self, x: Float[np.ndarray, " zones"]) -> tuple[float, Float[np.ndarray, " zones"]]:
        """Objective [N], and its derivatives, none of which is longer in any world than `held_back` lets it be."""
        forces, slopes, seen, rates = self.sensitivity(x)
        missing = self._missing(seen)
        short = held_back(self.reach, rates.tip_arc)[missing > 0].sum(axis=0) / self.worlds
        found = held_back(forces, slopes).mean(axis=(0, 1)) - SHORTFALL * short
        return float(forces.mean() + SHORTFALL * missing.mean()), found - found.mean()

    def sensitivity(
        self, x: Float[np.ndarray, " zones"]
    ) -> tuple[Float[np.ndarray, "records worlds"], Float[np.ndarray, "records worlds zones"], Readings, Readings]:
        """Sums of wall forces over time [N], their derivatives as they are, and all readings at the end with theirs."""
        self.dual.redesign(self._with(self.profile(x)))
        self.dual.reset(self.case, self.conditions)
        forces, slopes = [], []
        for seen, rates in self.dual.rollout(self.script, self._count):
            forces.append(seen.wall_force_sum)
            slopes.append(rates.wall_force_sum)
        return np.array(forces), np.array(slopes), *self.dual.read()

    def _missing(self, seen: Readings) -> Float[np.ndarray, " worlds"]:
        return np.maximum(self.reach - seen.tip_arc, 0.0)

    def _with(self, profile: Float[np.ndarray, " zones"] | None = None) -> Scope:
        scope, scale = self._scope, np.ones(len(self._chain.scale))
        for zone, value in zip(self.zones, profile if profile is not None else np.ones(ZONES), strict=True):
            scale[zone] = value
        parts = {name: getattr(scope, name) * scale for name in ("stiffness", "damping", "armature")}
        return stack_scopes([scope._replace(**parts)] * self.worlds)

    def _drive(self, decisions: int) -> tuple[list[Controls], Float[np.ndarray, " worlds"]]:
        scene, backend, script = self.bank.scene, self.plain, []
        settings = FollowerSettings(straighten=scene.options.mesentery)
        steering, memory = Steering.of(scene.design, settings), settings.law().begin(np, self.worlds, np.float64)
        backend.reset(np.arange(self.worlds), self.case, self.conditions)
        for _ in range(decisions):
            seen, ahead = backend.read(), backend.way_ahead(np.array([settings.look_ahead]))[:, 0]
            about = {"time": seen.time, "arc": seen.tip_arc, "target": ahead, "interval": _INTERVAL}
            links = scene.cable.tip_links
            asked, memory = follower.decide(np, settings, steering, seen, memory, **about, tip_links=links)
            script.append(Controls(*(np.array(part) for part in asked)))
            backend.step(script[-1], self._count)
        return script, backend.read().tip_arc


def searched(bank: ScopeColonSet, colons: int) -> ScopeColonSet:
    """A bank of the first so many grown colons, without those of `_UNSEEN`."""
    return _grown(bank, [seed for seed in range(colons + len(_UNSEEN)) if seed not in _UNSEEN][:colons])


def elsewhere(bank: ScopeColonSet, searches: Sequence[Search], *, seconds: float = SECONDS) -> list[float]:
    """Objectives in colons that were not searched in [N]: of the design that ships, then of what each search found."""
    problem = Problem(_grown(bank, _UNSEEN), seconds=seconds)
    profiles = [np.ones(ZONES), *(each.profile for each in searches)]
    return [problem.value(np.log(profile))[0] for profile in profiles]


def _grown(bank: ScopeColonSet, seeds: Iterable[int]) -> ScopeColonSet:
    return build_bank([grow_colon(seed=seed) for seed in seeds], bank.scene.design, bank.scene.options)


def held_back(
    value: Float[np.ndarray, "..."], slopes: Float[np.ndarray, "... zones"]
) -> Float[np.ndarray, "... zones"]:
    """Derivatives, each no longer than the value that it is of.

    A longer one says that a hundredth more of stiffness makes more than a hundredth more of everything, which is true
    only where a scope is about to slip, and for no longer than that lasts.

    Args:
        value: what is differentiated.
        slopes: its derivatives by logarithms of parameters.
    """
    size = np.linalg.norm(slopes, axis=-1)
    return slopes * np.minimum(1.0, np.abs(value) / np.maximum(size, 1e-12))[..., None]


@dataclass(frozen=True)
class Horizon:
    """How well derivatives of the mean wall force until some time say what a change of 10 % of EI does."""

    seconds: float
    """Until when [s]."""
    off_median: float
    """Distance of a world's derivatives by all zones from the secants over ±10 %, over their length: median [1]."""
    good: float
    """Share of worlds where it is below a half: the derivatives point the right way and are about as long."""
    off_mean: float
    """Distance of the derivatives averaged over all worlds from the secants, over their length [1]."""
    off_mean_held_back: float
    """Distance of derivatives each held back (`held_back`) before they are averaged, over the secants' length [1]."""


def horizons(problem: Problem, seconds: Sequence[float]) -> list[Horizon]:
    """From the design that ships, until each of those times."""
    nothing = np.zeros(ZONES)
    forces, slopes, *_ = problem.sensitivity(nothing)
    step = np.log(1.1)
    sides = [[problem.value(sign * step * unit)[1] for sign in (1, -1)] for unit in np.eye(ZONES)]
    secants = np.stack([(high - low) / (2 * step) for high, low in sides], axis=-1)

    def off(found: np.ndarray, known: np.ndarray) -> np.ndarray:
        found = found - found.mean(axis=-1, keepdims=True)  # as the profile's mean is taken away
        return np.linalg.norm(found - known, axis=-1) / np.linalg.norm(known, axis=-1)

    rows = []
    for until in seconds:
        own = slice(round(until / _INTERVAL))
        known, found = secants[own].mean(axis=0), slopes[own].mean(axis=0)
        each, back = off(found, known), held_back(forces[own], slopes[own]).mean(axis=(0, 1))
        both = off(np.stack([found.mean(axis=0), back]), known.mean(axis=0))
        rows.append(Horizon(until, float(np.median(each)), float((each < 0.5).mean()), *map(float, both)))
    return rows


def by_gradient(problem: Problem, *, seconds: float) -> Search:
    """Adam (Kingma & Ba 2015), from the design that ships."""
    search, x, began = Search("gradient"), np.zeros(ZONES), time.process_time()
    first, second, step, rate = np.zeros(ZONES), np.zeros(ZONES), 0, _RATE
    while time.process_time() - began < seconds:
        objective, slopes = problem.gradient(x)
        search.tried(objective, problem.profile(x), began)
        step += 1
        first, second = 0.7 * first + 0.3 * slopes, 0.9 * second + 0.1 * slopes**2
        way = first / (1 - 0.7**step) / np.sqrt(second / (1 - 0.9**step) + 1e-12)
        x, rate = np.clip(x - rate * way, -BOUND, BOUND), rate * _DECAY
    return search


def by_optuna(problem: Problem, *, seconds: float, seed: int) -> Search:
    """Tree-structured Parzen estimators as in `haustra optimise`, the design that ships first."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed))
    study.enqueue_trial({f"x{zone}": 0.0 for zone in range(ZONES)})
    search, began = Search(f"Optuna, seed {seed}"), time.process_time()
    while time.process_time() - began < seconds:
        trial = study.ask()
        x = np.array([trial.suggest_float(f"x{zone}", -BOUND, BOUND) for zone in range(ZONES)])
        objective, _ = problem.value(x)
        study.tell(trial, objective)
        search.tried(objective, problem.profile(x), began)
    return search
