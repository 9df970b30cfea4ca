"""What a time step of the backend 'linear' costs, by joints and worlds, and how far it is from the dense one."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.layout import NODE
from haustra.envs.sim.linear.place import forget
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.sim.scope_colon_set import BATCH_OPTIONS, ScopeColonSet, build_bank
from haustra.envs.sim.scope_reading import read_scope, stack_scopes
from haustra.envs.sim.scope_values import Scope
from haustra.envs.sim.serial_chain import Links
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.grown import grow_colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.moving_colon import AxisDisplacement
from haustra.scripts.bench.dense_step import DenseStep

SIZES = {40: (0.11, 0.03, 0.015), 80: (0.047, 0.0165, 0.015), 160: (0.0225, 0.009, 0.015), 400: (0.0086, 0.004, 0.015)}
"""Joints, about, and the cells of shaft and bending section and the spheres' spacing that give them [m]."""

_PUSH, _PULL, _WAY = 0.05, 20.0, 8.0
"""Speed of the hand [m/s], largest pull [N], and seconds that a scope is driven in before it is timed."""
_STILL = 1e-3
"""Where nothing is faster than this [m/s, rad/s], differences are relative to it: rounding of what hardly moves."""
_GATHERED, _SHORTENED = 0.2, 0.85
"""Length of colon that is gathered [m], and by how much of itself its middle is shortened."""
_MISSED = 0.08
"""Colon that a shaft is made to miss [m]."""
_DENSE_STEPS = 40
"""Time steps in which the dense engine is timed."""
_TURN, _TRAVEL = 0.002, 0.012
"""Wire that a wheel takes up more or less at a time, and the most that it takes up [m]."""
_COMPILED = 8
"""Worlds of the backend whose program is compiled to see how long that takes."""
_KINDS = 8
"""Designs that worlds with designs of their own have in turn."""
INTERVAL = 0.125
"""The hand changes its mind so often [s]."""


@dataclass(frozen=True)
class Cost:
    """What a time step costs."""

    dofs: int
    spheres: int
    worlds: int
    device: str
    us_per_step: float
    """Wall-clock time of a step over the worlds that share it [us]."""
    us_per_step_dense: float | None = None
    """What MuJoCo's native batch, whose matrices are dense, takes on as many threads, in the same run [us]."""
    touching: float = 0.0
    """Share of the spheres that press."""
    differ: int = 0
    """Numbers of all states that differ in their bits when the same launch is repeated."""


class Hands:
    """A hand that pushes, rolls and steers at random, the same whenever it is asked in the same order."""

    def __init__(self, worlds: int, seed: int = 0, *, wheels: bool = False) -> None:
        """For that many worlds, whose wires it pulls, or whose wheels it turns."""
        self._random, self._worlds = np.random.default_rng(seed), worlds
        self._pulls, self._wheels = np.zeros((worlds, 4)), np.zeros((worlds, 2)) if wheels else None

    def next(self) -> Controls:
        """What it does in the next `INTERVAL`."""
        self._pulls = np.clip(self._pulls + 2 * self._random.normal(size=self._pulls.shape), 0, _PULL)
        roll = self._random.uniform(-0.5, 0.5, self._worlds)
        if self._wheels is not None:
            more = _TURN * self._random.normal(size=self._wheels.shape)
            self._wheels = np.clip(self._wheels + more, -_TRAVEL, _TRAVEL)
        return Controls(np.full(self._worlds, _PUSH), roll, self._pulls, self._wheels)


def bank_of(dofs: int, *, colons: int = 2, mesentery: bool = False) -> ScopeColonSet:
    """An adult scope of about so many joints, and grown colons, fixed or on their mesentery."""
    options = replace(_options(dofs), mesentery=mesentery)
    return build_bank([grow_colon(seed=seed) for seed in range(colons)], named_design("adult"), options)


def resized(bank: ScopeColonSet, dofs: int) -> ScopeColonSet:
    """A bank of the same colons with a scope of about so many joints."""
    longest = max(bank.colons, key=lambda colon: colon.centreline.length)
    options = replace(_options(dofs), mesentery=bank.scene.options.mesentery)
    return replace(bank, scene=build_scene(longest, None, bank.scene.design, options, show_lumen=False))


def _options(dofs: int) -> SceneOptions:
    shaft, bending, spacing = SIZES[dofs]
    return replace(BATCH_OPTIONS, shaft_cell=shaft, bending_cell=bending, sample_spacing=spacing)


def driven(
    bank: ScopeColonSet,
    worlds: int,
    *,
    seconds: float = _WAY,
    real: type = np.float32,
    device: Literal["cpu", "cuda"] = "cpu",
    threads: int = 1,
    wheels: bool = False,
    designs: bool = False,
) -> tuple[LinearBackend, Hands]:
    """Scopes that were pushed in for a while, worlds differing in friction and hand, and in design if asked for."""
    about: dict[str, Any] = {"worlds": worlds, "real": real, "device": device, "threads": threads}
    backend = LinearBackend(bank.scene, bank.tables, scopes=_designs(bank, worlds) if designs else None, **about)
    all_worlds = np.arange(worlds)
    backend.reset(all_worlds, all_worlds % len(bank.colons), conditions(bank, worlds))
    hands = Hands(worlds, wheels=wheels)
    for _ in range(round(seconds / INTERVAL)):
        backend.step(hands.next(), round(INTERVAL / bank.scene.options.timestep))
    return backend, hands


def _designs(bank: ScopeColonSet, worlds: int) -> Scope:
    """A design a world: bending sections from four fifths as stiff to six fifths, worlds in turn."""
    design, options = bank.scene.design, bank.scene.options
    stiffer, scopes = np.linspace(0.8, 1.2, _KINDS), []
    for share in stiffer:
        bending = replace(design.bending, flexural_rigidity=share * design.bending.flexural_rigidity)
        scene = build_scene(bank.scene.colon, None, replace(design, bending=bending), options, show_lumen=False)
        scopes.append(read_scope(scene))
    each, which = stack_scopes(scopes), np.arange(worlds) % _KINDS
    return Scope(Links(*(part[which] for part in each.links)), *(part[which] for part in each[1:]))


def conditions(bank: ScopeColonSet, worlds: int) -> Conditions:
    """Friction from 0.03 to 0.2, worlds in turn."""
    one = np.ones(worlds)
    return Conditions(np.linspace(0.03, 0.2, worlds), bank.scene.options.wall_stiffness * one, one)


def time_steps(backend: LinearBackend, hands: Hands, *, steps: int, times: int = 5) -> float:
    """Least time of a step of one world, of some runs of so many steps under the same hands [s]."""
    best = np.inf
    for _ in range(times):
        inputs = hands.next()
        began = time.perf_counter()
        backend.step(inputs, steps)
        best = min(best, time.perf_counter() - began)
    return best / steps / backend.worlds


def repeated(backend: LinearBackend, hands: Hands, *, steps: int) -> int:
    """Numbers of all states that differ in their bits when a launch of so many steps is repeated from its beginning."""
    begun, inputs, ends = backend.keep(), hands.next(), []
    for _ in range(2):
        backend.put_back(begun)
        backend.step(inputs, steps)
        ends.append(backend.numbers("state").copy())
    return int((ends[0] != ends[1]).sum())


def compile_cost(bank: ScopeColonSet, **about: Any) -> tuple[float, float]:
    """Seconds until a backend stands: with nothing compiled before, and with the program in haustra's cache.

    A GPU's driver has a cache of its own, which is left as it is.
    """
    named, seconds = os.environ.get("HAUSTRA_CACHE"), []
    with TemporaryDirectory() as folder:
        os.environ["HAUSTRA_CACHE"] = folder
        try:
            for _ in range(2):
                forget()
                began = time.perf_counter()
                LinearBackend(bank.scene, bank.tables, worlds=_COMPILED, **about).close()
                seconds.append(time.perf_counter() - began)
        finally:
            os.environ.pop("HAUSTRA_CACHE")
            os.environ.update({} if named is None else {"HAUSTRA_CACHE": named})
    return seconds[0], seconds[1]


def measure_cost(bank: ScopeColonSet, worlds: Sequence[int], *, threads: int = 1, **device: Any) -> list[Cost]:
    """Cost with these scopes, in those numbers of worlds."""
    rows = []
    for count in worlds:
        backend, hands = driven(bank, count, threads=threads, **device)
        where = device.get("device", "cpu")
        state = backend.state()
        spheres = state.normal.shape[1]
        steps = 40 if where == "cuda" else max(4, min(400, 40_000 // count))
        seconds = time_steps(backend, hands, steps=steps)
        touching, differ = float((state.normal > 0).mean()), repeated(backend, hands, steps=steps)
        about = {"touching": touching, "differ": differ}
        rows.append(Cost(state.qpos.shape[1], spheres, count, where, seconds * 1e6, **about))
        backend.close()
    return rows


def exponent(costs: Sequence[Cost]) -> float:
    """By which power of the number of joints a step's cost grows."""
    return float(np.polyfit(np.log([row.dofs for row in costs]), np.log([row.us_per_step for row in costs]), 1)[0])


def dense_cost(bank: ScopeColonSet, worlds: int, *, threads: int = 1) -> float:
    """Time of a step of MuJoCo's own dense engine, the native batch, from where the same hands bring it [s]."""
    backend = NativeBackend(bank.scene, bank.tables, worlds=worlds, threads=threads)
    all_worlds = np.arange(worlds)
    backend.reset(all_worlds, all_worlds % len(bank.colons), conditions(bank, worlds))
    hands, best = Hands(worlds), np.inf
    for _ in range(4):
        began = time.perf_counter()
        backend.step(hands.next(), _DENSE_STEPS)
        best = min(best, time.perf_counter() - began)
    backend.close()
    return best / _DENSE_STEPS / worlds


def largest_difference(
    bank: ScopeColonSet,
    *,
    worlds: int = 20,
    instants: int = 10,
    wheels: bool = False,
    before_step: Callable[[LinearBackend], None] | None = None,
) -> float:
    """How far speeds lie from the dense step after one step, relative to each world's fastest, in double precision.

    States are those of scopes pushed in by random hands, from straight to deep inside; `wheels`: which steer by them;
    `before_step` changes them first: `gather`, or `miss`.
    """
    dense = DenseStep(bank, np.arange(worlds) % len(bank.colons), conditions(bank, worlds))
    backend, hands = driven(bank, worlds, seconds=INTERVAL, real=np.float64, wheels=wheels)
    worst = 0.0
    for _ in range(instants):
        for _ in range(6):
            backend.step(hands.next(), round(INTERVAL / bank.scene.options.timestep))
        driven_in = backend.keep()
        if before_step:
            before_step(backend)
        before, inputs = backend.state(), hands.next()
        sound = backend.step(inputs, 1)
        assert sound.mean() > 0.9, "what breaks tells nothing"
        want, after = dense.step(before, inputs), backend.state()
        for found, known in zip(_speeds(after.qvel, after.displacement), _speeds(*want), strict=True):
            apart = np.abs(found - known).max(axis=1) / np.maximum(np.abs(known).max(axis=1), _STILL)
            worst = max(worst, float(apart[sound].max()))
        if before_step:
            backend.put_back(driven_in)
    return worst


def gather(backend: LinearBackend) -> None:
    """Gather each world's colon about the middle of what is inserted, to less than `SHORTEST` of its length."""
    own = backend.tables.mesentery
    assert own is not None, "colons that are fixed cannot gather"
    inserted = backend.read().insertion
    for world, middle in enumerate(0.5 * inserted):
        now = backend.snapshot(world)
        case = world % len(own.nodes)
        arcs = own.spacing[case] * np.arange(own.nodes.shape[1])
        beside = np.clip((arcs - middle) / _GATHERED, -0.5, 0.5)
        # Towards the middle from either side, over lengths that are left as they are: a bend of sine.
        from_there = arcs - _SHORTENED * _GATHERED / (2 * np.pi) * np.sin(2 * np.pi * beside)
        nodes = np.stack([np.interp(from_there, arcs, own.nodes[case, :, axis]) for axis in range(3)], axis=1)
        axis = now.state[-len(arcs) * NODE :].reshape(-1, NODE)
        axis[:, :3] += nodes - own.nodes[case]
        backend.restore(world, now)


def miss(backend: LinearBackend) -> None:
    """Let the shaft of each world miss `_MISSED` of colon between two spheres half-way in, as if behind a loop."""
    first = 2 * backend.positions().shape[1]
    for world, middle in enumerate(0.5 * backend.read().insertion):
        now = backend.snapshot(world)
        arcs = now.state[first : first + len(now.arcs)]
        arcs[arcs > middle] += _MISSED
        backend.restore(world, now)


def _speeds(joints: np.ndarray, axis: AxisDisplacement | None) -> list[np.ndarray]:
    """Speeds of joints, and of the colon's axis where it moves: (worlds, numbers) each."""
    return [joints] if axis is None else [joints, axis.speed.reshape(len(joints), -1)]
