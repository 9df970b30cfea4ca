"""Scopes that are already in the caecum, for withdrawal: somebody brings each colon's there once, and straightens it.

In linear time the shipped policy `insertion` drives, some times in each colon, and who comes to lie straightest counts;
in MuJoCo, where that would take too long, the lumen follower does, once. Who has arrived lets go of the wheels and
pulls until the tip comes out of the caecum's pole: a scope that has just arrived lies in loops, its tip pressed into
the pole, and takes the colon along when it is withdrawn.
"""

import json
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.sim.conditions import Snapshot
from haustra.envs.tasks.actions import ACTIONS, actions_of
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import Drive, Limits, Randomisation, TaskConfig, Weights
from haustra.files import write_atomically
from haustra.models.wall.cache import cache_folder
from haustra.models.wall.threads import PACKED
from haustra.provenance import content_hash, file_hash, package_versions

_SECONDS = 150.0
"""Longest insertion [s]; engineering choice."""
_POLICY, _TRIES = "insertion", 4
"""Who drives in linear time, and how often in each colon."""
_STRAIGHTENING = 40.0
"""Longest time that straightening takes [s]; engineering choice."""
_PULL, _MOST_TENSION = 0.02, 12.0
"""Rate at which the shaft is pulled straight [m/s], and the tension at which the hand stands still [N];
engineering choices, the second within the 17.7 N that clinics' hands pulled at most (Appleyard 2000)."""
_POLE = 0.045
"""Who is no farther from the end of the centreline [m] has arrived: a tip that goes on is pressed into the pole, where
it hooks, or slips behind the colon's end; from here the pole is in view. Engineering choice."""
_GIVEN_WAY = 0.01
"""The shaft is straight once the tip has come back by this [m]; engineering choice."""
_FARTHER = 0.02
"""Tries that differ by less of the way are as good as each other [1]."""
_PARTS = tuple(entry.name for entry in fields(Snapshot))
_PLAIN = Randomisation(
    friction=(0.1, 0.1),
    wall_stiffness=(1500.0, 1500.0),
    shaft_stiffness=(1.0, 1.0),
    wire_gain=(1.0, 1.0),
    wire_slack=(0.0, 0.0),
    start_roll=(0.0, 0.0),
)
"""A wall on the middle of what episodes draw, but rubbing as hard as any: where it is slippery the tip slides out of
the caecum before the shaft is straight."""
_HOW: tuple = (
    _SECONDS,
    _TRIES,
    _STRAIGHTENING,
    _PULL,
    _MOST_TENSION,
    _POLE,
    _GIVEN_WAY,
    _FARTHER,
    _PLAIN.friction,
    "straightest",
    PACKED,
)
"""What starts that are kept hang on."""


def inserted_starts(config: TaskConfig, bank: ColonSet, backend: str, *, threads: int = 1) -> tuple[Snapshot, ...]:
    """For each colon of the bank a scope as far in as its driver brings it, kept in the cache.

    Args:
        config: of the withdrawal.
        bank: the colons.
        backend: that steps it: snapshots are its own, those of 'linear' and 'linear-gpu' the same.
        threads: for physics on the CPU.
    """
    kind = "linear" if backend == "linear-gpu" else backend
    key = [content_hash(np.ascontiguousarray(case.wall).tobytes()) for case in bank.cases]
    made_by = json.dumps(
        [_PARTS, kind, key, config.design, str(bank.options), _HOW, _weights(kind), package_versions()], sort_keys=True
    )
    path = cache_folder() / "starts" / f"{content_hash(made_by.encode())}.npz"
    if path.exists():
        with np.load(path, allow_pickle=False) as file:
            kept = [file[name] for name in _PARTS]
        return tuple(Snapshot(*rows) for rows in zip(*kept, strict=True))
    starts = _insert(config, bank, backend, threads)
    path.parent.mkdir(parents=True, exist_ok=True)
    columns: dict[str, Any] = {name: np.stack([getattr(start, name) for start in starts]) for name in _PARTS}

    def write(temporary):
        with temporary.open("wb") as file:
            np.savez_compressed(file, **columns)

    write_atomically(path, write)
    return starts


def _weights(kind: str) -> str:
    """Hash of the policy that brings scopes in; nothing where the follower does."""
    if kind != "linear":
        return ""
    from haustra.envs.learning.policy import WEIGHTS, policy_folder

    return file_hash(policy_folder(_POLICY) / WEIGHTS)


def _insert(config: TaskConfig, bank: ColonSet, backend: str, threads: int) -> tuple[Snapshot, ...]:
    from haustra.envs.tasks.scope_task import ScopeTask

    about, make, tries = _driver(config, backend)
    rules = replace(about, randomisation=_PLAIN, limits=Limits(seconds=_SECONDS, caecum_margin=_POLE))
    worlds = tries * len(bank.cases)
    colon = np.arange(worlds) % len(bank.cases)
    task = ScopeTask(rules, worlds=worlds, threads=threads, bank=bank, backend=backend)
    seen = task.reset(seeds=list(range(worlds)), case=colon)
    driver = make(task)
    driver.begin(np.ones(worlds, bool))
    arrived, lost = np.full(worlds, np.nan), np.zeros(worlds, bool)
    kept = _Straightest(task, colon)
    for step in range(round((_SECONDS + _STRAIGHTENING) / task.interval)):
        pulls = np.isfinite(arrived)
        done = task.step(np.where(pulls[:, None], _straighten(task), driver.act(seen)))
        seen, told = done.observation, done.info
        lost |= told["diverged"] | told["perforated"]
        there = told["reached"] | (task.interval * step >= _SECONDS)
        arrived = np.where(there & ~pulls, told["tip_arc"], arrived)
        inside = ~lost & (told["tip_arc"] < bank.lengths[colon])
        kept.offer(inside & ~pulls, told, straight=False)
        kept.offer(inside & (told["tip_arc"] < arrived - _GIVEN_WAY), told, straight=True)
        if kept.enough:
            break
    task.close()
    return tuple(kept.starts)


def _straighten(task: Any) -> Float[np.ndarray, "worlds actions"]:
    """Wheels let go, the hand pulls as long as the shaft gives way."""
    tension = np.maximum(-task.seen.push_force, 0.0)
    push = -_PULL * np.clip(3.0 * (1.0 - tension / _MOST_TENSION), -0.5, 1.0) / task.config.drive.push_rate
    action = np.zeros((task.worlds, len(actions_of(task.config))))
    action[:, ACTIONS.index("push")] = np.clip(push, -1.0, 1.0)
    return action


class _Straightest:
    """For each colon, of the tries that came to lie straight, the one with the least shaft inside; or the farthest."""

    def __init__(self, task: Any, colon: Int[np.ndarray, " worlds"]) -> None:
        """Nothing yet."""
        self._task, self._colon, count = task, colon, colon.max() + 1
        self._straight, self._inside = np.zeros(task.worlds, bool), np.full(count, np.inf)
        self._place = np.full(count, -1.0)
        self.starts = [task.backend.snapshot(world) for world in range(count)]

    def offer(self, fit: Bool[np.ndarray, " worlds"], told: dict[str, Any], *, straight: bool) -> None:
        """Look at who lies in the colon, on the way or just straight: who is farther, then who is straighter."""
        place = told["progress"]
        inside = told["tip_arc"] + told["excess"] if straight else np.full(len(fit), np.inf)
        for world in np.flatnonzero(fit & ~self._straight).tolist():
            colon = self._colon[world]
            more = place[world] - self._place[colon]
            shorter = inside[world] < self._inside[colon] and more > -_FARTHER
            if shorter or (more > 5 * _FARTHER and (straight or np.isinf(self._inside[colon]))):
                self._inside[colon], self._place[colon] = inside[world], place[world]
                self.starts[colon] = self._task.backend.snapshot(world)
        if straight:
            self._straight |= fit

    @property
    def enough(self) -> bool:
        """Whether half of the tries in each colon are straight."""
        straight = np.bincount(self._colon, self._straight)
        return bool((2 * straight >= np.bincount(self._colon)).all())


def _driver(config: TaskConfig, backend: str) -> tuple[TaskConfig, Callable[[Any], Any], int]:
    """Rules of the insertion, who drives, and how often in each colon."""
    if not backend.startswith("linear"):
        from haustra.envs.tasks.drivers import FollowerDriver

        own = replace(config, task="insertion", observation="state", privileged=False, imager=False, memory=())
        return replace(own, drive=Drive(), weights=Weights()), FollowerDriver, 1
    from haustra.envs.learning.drivers import PolicyDriver
    from haustra.envs.learning.policy import load_policy, policy_folder

    policy = load_policy(policy_folder(_POLICY))
    filled = "gas", "gas_flow", "gas_start", "water"
    around = {name: getattr(config, name) for name in ("design", "mesentery", *filled)}
    own = replace(policy.config, **around)
    return own, lambda task: PolicyDriver(policy, sampled=True), _TRIES
