"""Scopes that are already in the caecum, for withdrawal: the lumen follower brings each colon's there once."""

import json
from dataclasses import fields, replace
from typing import Any

import numpy as np

from haustra.envs.sim.conditions import Snapshot
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import Limits, Randomisation, TaskConfig
from haustra.files import write_atomically
from haustra.models.wall.cache import cache_folder
from haustra.provenance import content_hash

_SECONDS = 120.0
"""Longest insertion [s]."""
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


def inserted_starts(config: TaskConfig, bank: ColonSet) -> tuple[Snapshot, ...]:
    """For each colon of the bank a scope as far in as the follower brings it, kept in the cache.

    Args:
        config: of an insertion, whose drive is used.
        bank: the colons.
    """
    key = [content_hash(np.ascontiguousarray(case.wall).tobytes()) for case in bank.cases]
    made_by = json.dumps([_PARTS, key, config.design, str(bank.options), str(config.drive)], sort_keys=True)
    path = cache_folder() / "starts" / f"{content_hash(made_by.encode())}.npz"
    if path.exists():
        with np.load(path, allow_pickle=False) as file:
            kept = [file[name] for name in _PARTS]
        return tuple(Snapshot(*rows) for rows in zip(*kept, strict=True))
    starts = _insert(replace(config, randomisation=_SLIPPERY, limits=Limits(seconds=_SECONDS)), bank)
    path.parent.mkdir(parents=True, exist_ok=True)
    columns: dict[str, Any] = {name: np.stack([getattr(start, name) for start in starts]) for name in _PARTS}

    def write(temporary):
        with temporary.open("wb") as file:
            np.savez_compressed(file, **columns)

    write_atomically(path, write)
    return starts


def _insert(config: TaskConfig, bank: ColonSet) -> tuple[Snapshot, ...]:
    from haustra.envs.tasks.drivers import FollowerDriver
    from haustra.envs.tasks.scope_task import ScopeTask

    worlds = len(bank.cases)
    task = ScopeTask(config, worlds=worlds, bank=bank)
    for world in range(worlds):
        task.reset(np.array([world]), [world], case=world)
    driver = FollowerDriver(task)
    driver.begin(np.ones(worlds, bool))
    best = np.full(worlds, -1.0)
    starts: list[Snapshot] = [task.backend.snapshot(world) for world in range(worlds)]
    for _ in range(round(_SECONDS / task.interval)):
        done = task.step(driver.act({})).info
        further = (done["progress"] > best + 0.02) & ~done["diverged"]
        for world in np.flatnonzero(further | (done["reached"] & (best < 1))):
            starts[world], best[world] = task.backend.snapshot(int(world)), done["progress"][world]
        if (best >= 0.98).all():
            break
    task.close()
    return tuple(starts)
