"""Endoscopists who work differently, each with the same patients: which of them comes nearest to published figures."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from haustra.assets import asset
from haustra.children import cores
from haustra.envs.study.cohort import cohort_study
from haustra.envs.study.cohort_table import Observable, observables, published, rows_of, verdicts
from haustra.envs.study.run import Computing, run_sweep
from haustra.envs.study.store import read_store
from haustra.files import write_atomically

LAW = "endoscopist"


def settings_files(folder: Path, count: int, *, seed: int) -> list[Path]:
    """Files of endoscopists' settings: the usual ones, and others by a Latin hypercube over their bounds.

    Args:
        folder: for the files.
        count: how many in all.
        seed: of the hypercube.
    """
    bounds = tomllib.loads(asset("clinic/endoscopists.toml").read_text(encoding="utf-8"))
    low, high = (np.array([float(each[end]) for each in bounds.values()]) for end in ("low", "high"))
    drawn = qmc.LatinHypercube(len(bounds), rng=np.random.default_rng(seed)).random(count - 1)
    rows = [{}, *(dict(zip(bounds, map(float, row), strict=True)) for row in low + drawn * (high - low))]
    files = []
    for number, row in enumerate(rows):
        text = "\n".join([f'law = "{LAW}"', *(f"{name} = {value:.6g}" for name, value in row.items())]) + "\n"
        files.append(folder / f"{LAW}-{number:03d}.toml")
        write_atomically(files[-1], lambda place, text=text: place.write_text(text, encoding="utf-8"))
    return files


def bench_drivers(
    folder: Path, files: Sequence[Path], *, patients: int, seconds: float, seed: int, backend: str, progress: Any
) -> list[dict[str, Any]]:
    """Examine the same patients by every driver, and hold each against published figures; the nearest comes first.

    Args:
        folder: for the store; one that is there goes on.
        files: settings of each driver.
        patients: how many.
        seconds: longest examination [s].
        seed: of the patients.
        backend: what steps them, linear or linear-gpu.
        progress: told (done, note, total).
    """
    drivers = tuple(map(str, files))
    study = cohort_study("quick", drivers=drivers, patients=patients, seconds=seconds, seed=seed)
    run_sweep(
        study,
        folder,
        Computing(backend=backend, workers=cores()),
        resume=True,
        tables=False,
        progress=lambda done, total, note: progress(done, note, total),
    )
    with read_store(folder) as store:
        found = [_row(driver, observables(rows_of(store, driver=driver))) for driver in drivers]
    return sorted(found, key=lambda row: (-row["inside_choose"], -row["caecum"]))


def _row(driver: str, found: list[Observable]) -> dict[str, Any]:
    halves: dict[str, str] = {}
    for each in published():
        halves.setdefault(each.group or each.name, each.half)
    inside = verdicts(found)
    return {
        "driver": driver,
        "settings": tomllib.loads(Path(driver).read_text(encoding="utf-8")),
        **{
            f"inside_{half}": sum(ok for name, ok in inside.items() if halves[name] == half)
            for half in ("choose", "judge")
        },
        "caecum": next(each.value or 0.0 for each in found if each.name == "caecal_intubation"),
        "observables": {each.name: each.value for each in found},
    }
