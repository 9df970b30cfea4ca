"""Whether what virtual patients show comes of the time step or of rounding: the same ones, stepped in several ways."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from haustra.children import cores
from haustra.envs.study.cohort import cohort_study
from haustra.envs.study.cohort_table import rows_of
from haustra.envs.study.run import Computing, run_sweep
from haustra.envs.study.sampling import designs_of
from haustra.envs.study.store import read_store
from haustra.envs.study.study import Sampler, Study
from haustra.errors import InvalidOptionError

WAYS = ((5e-3, "single"), (5e-3, "double"), (2.5e-3, "double"), (1e-3, "double"))
"""Time steps [s] and precisions: a cohort's own first."""


def bench_steps(
    folder: Path,
    *,
    patients: int,
    only: Sequence[int],
    seconds: float,
    seed: int,
    backend: str,
    progress: Callable[[int, int, str], None] = lambda done, total, note: None,
) -> list[dict[str, Any]]:
    """Examine the same patients at every time step and precision of `WAYS`, by the endoscopist with the adult scope.

    Args:
        folder: for the stores, one a way; those that are there go on.
        patients: how many the cohort has.
        only: numbers of those of them who are examined; all of them when empty.
        seconds: longest examination [s].
        seed: of the cohort.
        backend: what steps them, linear or linear-gpu.
        progress: told how many examinations of a way are done, of how many, and a note.

    Raises:
        InvalidOptionError: when the cohort has no patient of a number.
    """
    study = _with(cohort_study("full", devices=("adult",), patients=patients, seconds=seconds, seed=seed), only)
    found = []
    for timestep, precision in WAYS:
        way = replace(study, options={**study.options, "timestep": timestep, "precision": precision})
        store = folder / f"{1e3 * timestep:g}-ms-{precision}"
        computing = Computing(backend=backend, workers=cores())
        run_sweep(way, store, computing, resume=True, tables=False, progress=progress)
        with read_store(store) as read:
            rows = rows_of(read)
        found.append({"timestep": timestep, "precision": precision, "patients": len(rows), **_shown(rows)})
    return found


def _with(study: Study, only: Sequence[int]) -> Study:
    """The study with some of its patients alone."""
    if not only:
        return study
    designs = designs_of(study)
    if missing := [number for number in only if not 0 <= number < len(designs)]:
        raise InvalidOptionError(f"--only: patient {missing[0]} is not of the {len(designs)}: 0 to {len(designs) - 1}.")
    listed = tuple({"name": f"patient-{number}", **designs[number]} for number in sorted(set(only)))
    return replace(study, sampler=Sampler(kind="list", designs=listed))


def _shown(rows: Sequence[Any]) -> dict[str, float | None]:
    """What patients show: caeca, time to them, the largest load and P(perforation); nothing of nobody."""
    if not rows:
        return dict.fromkeys(("caeca", "time_s", "load_peak", "p_perforation"))
    return {
        "caeca": float(np.mean([row["caecum"] for row in rows])),
        "time_s": float(np.mean([row["time_s"] for row in rows])),
        "load_peak": float(max(row["load_peak"] for row in rows)),
        "p_perforation": float(np.mean([row["p_perforation"] for row in rows])),
    }
