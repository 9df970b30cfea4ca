"""What keeps an ultrathin scope from the caecum: scopes that differ from it in one thing, each in the same patients.

Each is driven by the usual endoscopist, who sucks gas out, and by one who leaves it in the colon.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from haustra.assets import asset
from haustra.children import cores
from haustra.envs.learning.statistics import mean_interval
from haustra.envs.study.cohort import cohort_study
from haustra.envs.study.cohort_table import Row, by_patient
from haustra.envs.study.run import Computing, run_sweep
from haustra.envs.study.store import read_store
from haustra.envs.study.trials import RESAMPLES
from haustra.files import prepare_folder, write_atomically
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.files import load_design, save_design
from haustra.models.devices.scope.library import named_design

STANDARD, ULTRATHIN = "standard", "ultrathin"
LONGER = 0.3
"""By how much more shaft than others one of the scopes has [m]; engineering choice."""


def scopes() -> dict[str, ScopeDesign]:
    """Both arms of the trial 'ultrathin', and what lies between them, by what each is."""
    standard, thin = named_design("adult"), load_design(asset(f"trials/designs/{ULTRATHIN}.toml"))
    (paediatric,) = named_design("paediatric").shaft
    (stiff,), (soft, section) = standard.shaft, thin.shaft
    firmer = replace(
        soft, flexural_rigidity=paediatric.flexural_rigidity, torsional_rigidity=paediatric.torsional_rigidity
    )
    plain = soft.length + section.length
    found = {
        STANDARD: standard,
        "standard, with the extra bending section": replace(
            standard, shaft=(replace(stiff, length=stiff.length - section.length), section)
        ),
        ULTRATHIN: thin,
        "ultrathin, without the extra bending section": replace(thin, shaft=(replace(soft, length=plain),)),
        "ultrathin, with a paediatric scope's shaft": replace(thin, shaft=(firmer, section)),
        "ultrathin, with a paediatric scope's shaft and no extra section": replace(
            thin, shaft=(replace(firmer, length=plain),)
        ),
        f"ultrathin, {LONGER:g} m longer": replace(thin, shaft=(replace(soft, length=soft.length + LONGER), section)),
    }
    return {what: replace(design, name=f"scope-{number}") for number, (what, design) in enumerate(found.items())}


def bench_ultrathin(
    folder: Path,
    *,
    patients: int,
    seconds: float,
    seed: int,
    backend: str,
    progress: Callable[[int, int, str], None] = lambda done, total, note: None,
) -> list[dict[str, Any]]:
    """Examine the same patients with every scope, by who sucks gas out and who leaves it.

    Tells how many caeca are reached, and how many more than with the standard scope and the same endoscopist.

    Args:
        folder: for designs and store; a store that is there goes on.
        patients: how many.
        seconds: longest examination [s].
        seed: of the patients.
        backend: what steps them, linear or linear-gpu.
        progress: told how many examinations are done, of how many, and a note.
    """
    designs = prepare_folder(folder / "designs").resolve()
    files = {what: str(save_design(design, designs / f"{design.name}.toml")) for what, design in scopes().items()}
    leaves = str(gas_leaving_driver(designs / "gas-left.toml"))
    drivers = {"endoscopist": "caecum", leaves: "caecum_with_gas_left"}
    about: dict[str, Any] = {"patients": patients, "seconds": seconds, "seed": seed}
    study = cohort_study("full", drivers=tuple(drivers), devices=tuple(files.values()), **about)
    store = folder / "store"
    computing = Computing(backend=backend, workers=cores())
    run_sweep(study, store, computing, resume=True, tables=False, progress=progress)
    with read_store(store) as read:
        seen = {
            driver: {what: by_patient(read, driver=driver, device=file) for what, file in files.items()}
            for driver in drivers
        }
    return [
        {
            "scope": what,
            **{name: _caeca(seen[driver][what], seen[driver][STANDARD]) for driver, name in drivers.items()},
        }
        for what in files
    ]


def gas_leaving_driver(path: Path) -> Path:
    """A file of an endoscopist who never sucks gas out."""
    never = 'law = "endoscopist"\nsuck_after = 1000\nsuck_from = 100\n'
    write_atomically(path, lambda temporary: temporary.write_text(never, "utf-8"))
    return path


def _caeca(rows: Mapping[int, Row], standard: Mapping[int, Row]) -> dict[str, Any]:
    """How many caeca a scope reached, how many more than the standard one, and with how much shaft inside."""
    both = sorted(set(rows) & set(standard))
    more = np.array([rows[one]["caecum"] - standard[one]["caecum"] for one in both], float)
    low, high = mean_interval(more, resamples=RESAMPLES)
    inside = [row["inserted_m"] for row in rows.values() if row["caecum"]]
    return {
        "patients": len(both),
        "share": float(np.mean([row["caecum"] for row in rows.values()])),
        "more": float(more.mean()),
        "low": low,
        "high": high,
        "inserted_m": float(np.mean(inside)) if inside else None,
    }
