"""The largest stable time step of each scene, integrator and preset, and how far below it the preset stays."""

import json
from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from haustra.assets import asset
from haustra.models.presets import PRESETS
from haustra.scripts.bench.result import Criterion, Table
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.random_runs import prepare_colons
from haustra.scripts.bench.stability.rows import Answer, Row, Rows, fill
from haustra.scripts.bench.stability.step_scenes import INTEGRATORS, SCENES, Setting, stays_stable

LONGEST = 0.02
"""The longest time step that scenes take [s]."""
SHORTEST = 0.0003
"""No shorter one is looked for [s]."""
RESOLUTION = 1.05
"""Bisection ends when the least unstable step is less than that many times the largest stable one."""
BELOW = (0.9, 0.75, 0.5)
"""Shares of a limit at which a run must be stable too: locks and contacts depend on the time step, so that a longer one
can be stable where a shorter is not."""
MARGIN = 2.0
"""A preset's time step is that many times below its limit."""
FALLEN = 0.9
"""A limit below that share of its reference has fallen."""
SHIPPED = "implicitfast"
"""The integrator of scenes; of others it is told what they would stand."""
TABLE = "Largest stable time steps"
"""Title of the table."""
REFERENCE = "stability/steps.json"
"""Limits found earlier, with date and versions; `haustra.scripts.bench.pages.steps_file` writes it."""


def settings(*, quick: bool) -> tuple[Setting, ...]:
    """All that are looked at; quick runs leave out other integrators, and the grown colon."""
    scenes = [scene for scene in SCENES if not (quick and scene.startswith("insertion"))]
    integrators = [SHIPPED] if quick else list(INTEGRATORS)
    # Presets that meet tangent planes anyway have no business with pieces.
    return tuple(
        Setting(scene, integrator, preset)
        for scene, integrator, preset in product(scenes, integrators, PRESETS)
        if not (scene.endswith("pieces") and PRESETS[preset].modelling["wall_law"] != "pieces")
    )


def largest_steps(order: RunOptions, progress: Progress) -> Part:
    """Bisect the time step of every setting."""
    folder = order.folder / "colons"
    if not order.quick:
        prepare_colons(folder, 1, lambda seed: progress(0.0, "growing colon 0"))
    asked = settings(quick=order.quick)
    rows = Rows(order.folder / "step.jsonl", {"settings": [list(each) for each in asked]})
    given = (str(folder / "grown-0"), order.quick)
    fill(rows, len(asked), begin, given, workers=order.workers, deadline=order.deadline, progress=progress)
    return judge(rows.first(len(asked)), asked, references())


def begin(folder: str, quick: bool) -> Answer:
    """What answers rows in one process."""

    def answer(number: int) -> Row:
        setting = settings(quick=quick)[number]
        limit = find_limit(lambda step: stays_stable(setting, step, Path(folder)))
        return {"number": number, "outcome": "", "limit_s": limit}

    return answer


def find_limit(stable: Callable[[float], bool]) -> float:
    """Largest time step, to 5 %, at which and somewhat below which runs are stable; 0 when there is none [s]."""
    bad = None
    good = LONGEST
    while True:
        while not stable(good):
            bad, good = good, good / 2
            if good < SHORTEST:
                return 0.0
        while bad and bad / good > RESOLUTION:
            middle = float(np.sqrt(good * bad))
            good, bad = (middle, bad) if stable(middle) else (good, middle)
        below = next((share * good for share in BELOW if not stable(share * good)), None)
        if below is None:
            return good
        bad, good = below, below / 2


def references() -> Mapping[Setting, float]:
    """Limits found earlier [s]."""
    kept = json.loads(asset(REFERENCE).read_text(encoding="utf-8"))
    return {Setting(row["scene"], row["integrator"], row["preset"]): row["limit_s"] for row in kept["limits"]}


def judge(rows: list[Row], asked: tuple[Setting, ...], before: Mapping[Setting, float]) -> Part:
    """Bars and table of the limits that were found."""
    found: list[dict[str, Any]] = []
    for row in rows:
        setting = asked[row["number"]]
        limit = row.get("limit_s", 0.0)  # none when its process died
        step = PRESETS[setting.preset].modelling["timestep"]
        reference = before.get(setting)
        found.append(
            {
                **setting._asdict(),
                "limit_ms": limit * 1e3,
                "at_least": limit >= LONGEST,
                "preset_ms": step * 1e3,
                "limit_over_preset": limit / step,
                "margin": "kept" if limit >= MARGIN * step else "not kept",
                "reference_ms": None if reference is None else reference * 1e3,
                "fallen": reference is not None and limit < FALLEN * reference,
            }
        )
    shipped = [each for each in found if each["integrator"] == SHIPPED]
    close = sum(each["margin"] != "kept" for each in shipped)
    fallen = sum(each["fallen"] for each in found)
    criteria = (
        Criterion(f"presets above half of their largest stable step, {SHIPPED}", close, 0, "presets", "at most"),
        Criterion("largest stable steps more than a tenth below the reference", fallen, 0, "limits", "at most"),
    )
    return Part(
        criteria,
        (Table(TABLE, tuple(found), note=_NOTE),),
        summary=_SUMMARY,
        counts={"largest steps": len(rows)},
        planned={"largest steps": len(asked)},
    )


_NOTE = f"Scenes take no more than {LONGEST * 1e3:g} ms: a limit of that is one at least."
_SUMMARY = (
    "The largest time step is found by bisection, to 5 %: no divergence, no generalised speed beyond reason, in either "
    "of two runs that differ in the pull of a wire by a tenth, nor at 0.9, 0.75 and 0.5 times that step. Damping, "
    "armature and contacts are those of the step."
)
