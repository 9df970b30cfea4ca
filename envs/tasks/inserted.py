"""Scopes that are already in the caecum, for withdrawal: somebody brings each colon's there once.

In linear time the shipped policy `insertion` drives, some times in each colon, and the farthest counts; in MuJoCo,
where that would take too long, the lumen follower does, once.
"""

import json
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np

from haustra.envs.sim.conditions import Snapshot
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import Drive, Limits, Randomisation, TaskConfig, Weights
from haustra.files import write_atomically
from haustra.models.wall.cache import cache_folder
from haustra.provenance import content_hash, package_versions

_SECONDS = 240.0
"""Longest insertion [s]."""
_POLICY, _TRIES = "insertion", 6
"""Who drives in linear time, and how often in each colon."""
_PARTS = tuple(entry.name for entry in fields(Snapshot))
_SLIPPERY = Randomisation(
    friction=(0.01, 0.01),
    wall_stiffness=(1500.0, 1500.0),
    shaft_stiffness=(1.0, 1.0),
    wire_gain=(1.0, 1.0),
    wire_slack=(0.0, 0.0),
    start_roll=(0.0, 0.0),
)
"""How insertion was is no matter of a withdrawal: it is made as easy as can be."""


def inserted_starts(config: TaskConfig, bank: ColonSet, backend: str) -> tuple[Snapshot, ...]:
    """For each colon of the bank a scope as far in as its driver brings it, kept in the cache.

    Args:
        config: of the withdrawal.
        bank: the colons.
        backend: that steps it: snapshots are its own, those of 'linear' and 'linear-gpu' the same.
    """
    kind = "linear" if backend == "linear-gpu" else backend
    key = [content_hash(np.ascontiguousarray(case.wall).tobytes()) for case in bank.cases]
    made_by = json.dumps(
        [_PARTS, kind, key, config.design, str(bank.options), _SECONDS, _TRIES, package_versions()], sort_keys=True
    )
    path = cache_folder() / "starts" / f"{content_hash(made_by.encode())}.npz"
    if path.exists():
        with np.load(path, allow_pickle=False) as file:
            kept = [file[name] for name in _PARTS]
        return tuple(Snapshot(*rows) for rows in zip(*kept, strict=True))
    starts = _insert(config, bank, backend)
    path.parent.mkdir(parents=True, exist_ok=True)
    columns: dict[str, Any] = {name: np.stack([getattr(start, name) for start in starts]) for name in _PARTS}

    def write(temporary):
        with temporary.open("wb") as file:
            np.savez_compressed(file, **columns)

    write_atomically(path, write)
    return starts


def _insert(config: TaskConfig, bank: ColonSet, backend: str) -> tuple[Snapshot, ...]:
    from haustra.envs.tasks.scope_task import ScopeTask

    about, make, tries = _driver(config, backend)
    rules = replace(about, randomisation=_SLIPPERY, limits=Limits(seconds=_SECONDS))
    worlds = tries * len(bank.cases)
    colon = np.arange(worlds) % len(bank.cases)
    task = ScopeTask(rules, worlds=worlds, bank=bank, backend=backend)
    seen = task.reset(seeds=list(range(worlds)), case=colon)
    driver = make(task)
    driver.begin(np.ones(worlds, bool))
    best = np.full(len(bank.cases), -1.0)
    starts: list[Snapshot] = [task.backend.snapshot(world) for world in range(len(bank.cases))]
    for _ in range(round(_SECONDS / task.interval)):
        done = task.step(driver.act(seen))
        seen, told = done.observation, done.info
        place = np.where(told["diverged"] | told["perforated"], -1.0, told["progress"])
        for world in np.flatnonzero((place > best[colon] + 0.02) | ((place == 1) & (best[colon] < 1))):
            if place[world] > best[colon[world]]:
                starts[colon[world]] = task.backend.snapshot(int(world))
                best[colon[world]] = place[world]
        if (best >= 0.98).all():
            break
    task.close()
    return tuple(starts)


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
