"""What comes of the same episodes with a finer and finer scope: does a driver get stuck, tear and hurt by the cells?"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.evaluate import evaluate
from haustra.envs.learning.policy import load_policy, policy_folder
from haustra.envs.tasks.bank import TASK_OPTIONS, make_bank
from haustra.envs.tasks.bank import grown_bank as grown
from haustra.envs.tasks.config import HELD_OUT_SEEDS, Limits
from haustra.models.devices.scope.library import named_design

CELLS: Mapping[str, Mapping[str, Any]] = {
    "62.5, 34, 31.5": {"shaft_cell": 0.0625, "bending_cell": 0.034, "sample_spacing": 0.0315},
    "62.5, 34, 8.4": {"shaft_cell": 0.0625, "bending_cell": 0.034},
    "50, 17, 15": {"shaft_cell": 0.05, "bending_cell": 0.017, "sample_spacing": 0.015},
    "35, 11.4, 8.4": {"shaft_cell": 0.035, "bending_cell": 0.0114},
    "25, 8.5, 8.4": {"shaft_cell": 0.025, "bending_cell": 0.0085},
    "16.7, 8.5, 8.4": {"shaft_cell": 0.0167, "bending_cell": 0.0085},
    "35, 11.4, 8.4 at 2.5 ms": {"shaft_cell": 0.035, "bending_cell": 0.0114, "timestep": 0.0025},
}
"""Cells of shaft and bending section, and distance of spheres [mm], by what they are called; the first is what episodes
had until 24 November 2026."""
_KEPT = ("completion", "intubation", "progress", "p_perforation", "pain", "peak_force_N", "mean_force_N")


def bench_cells(
    drivers: Sequence[str],
    *,
    cells: Sequence[str] = tuple(CELLS),
    colons: int,
    seconds: float,
    threads: int,
    processes: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict[str, Any]]:
    """Let policies drive an episode in each of the same held-out colons, of any difficulty, with every scope.

    Args:
        drivers: names or folders of policies.
        cells: names of `CELLS`.
        colons: how many.
        seconds: longest episode [s].
        threads: that step.
        processes: that grow colons.
        progress: told how many evaluations are done, and of how many.
    """
    found: list[dict[str, Any]] = []
    for driver in drivers:
        policy = load_policy(policy_folder(driver))
        task = replace(policy.config, difficulty="any", limits=Limits(seconds=seconds))
        seeds = range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + colons)
        cases = grown(seeds, named_design(task.design), processes=processes).cases
        for name in cells:
            changes = {"sample_spacing": None, **CELLS[name]}
            bank = make_bank(cases, named_design(task.design), replace(TASK_OPTIONS, **changes))
            bank, began = bank.with_mesentery(task.mesentery), time.process_time()
            done = evaluate(
                lambda scopes, policy=policy: PolicyDriver(policy, sampled=policy.deviation is not None),
                driver,
                task,
                bank,
                episodes=1,
                threads=threads,
                backend="linear",
            )
            spent = time.process_time() - began
            told = done.summary()
            found.append(
                {
                    "driver": driver,
                    "cells": name,
                    "episodes": told["episodes"],
                    "dofs": bank.scene.compile().nv,
                    **{key: told[key] for key in _KEPT},
                    **{f"{key}_95": told[f"{key}_bootstrap"] for key in _KEPT},
                    "s_per_s": spent / sum(one.seconds for one in done.episodes),
                }
            )
            progress(len(found), len(drivers) * len(cells))
    return found
