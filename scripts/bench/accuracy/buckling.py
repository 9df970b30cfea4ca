"""Question: at what push does a rod in a tube buckle, to a wave and to a helix? Bounds: 10 % of Dawson-Paslay, Chen."""

import numpy as np

from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, processor_seconds, timed_front
from haustra.scripts.bench.accuracy.tube import UNIT, TubeRod
from haustra.scripts.bench.result import Criterion

BOUND = 0.1
"""Relative error of either load at the finest number of joints."""


def answer(effort: Effort) -> Answer:
    """Sweep the number of joints in four metres of rod."""
    counts = (40, 80) if effort.quick else (40, 60, 80, 120)
    loads = {"sinusoidal": ("sinusoidal_load", 2.0), "helical": ("helical_load", np.sqrt(8))}
    fronts, criteria = [], []
    rods = {count: TubeRod(count) for count in counts}
    for title, (method, units) in loads.items():
        candidates = []
        for count, rod in rods.items():
            effort.tell(f"{title}: {count} joints")
            load = getattr(rod, method)
            error = abs(float(load() / (units * UNIT)) - 1)
            block = lambda load=load: processor_seconds(load)  # noqa: E731
            candidates.append(Candidate(f"joints={count}", error, "joints", block))
        fronts.append(
            timed_front(
                f"{title} buckling load",
                candidates,
                reference=f"{units:.4g} sqrt(EI w / r), itself for a long rod",
                error_unit="relative error of the push",
                cost_unit="processor s / load",
                repeats=1,
            )
        )
        error = next(each.error for each in candidates if each.setting == f"joints={counts[-1]}")
        criteria.append(
            Criterion(f"error of the {title} buckling load, {counts[-1]} joints", error, BOUND, "1", "at most")
        )
    return Answer(fronts, criteria=criteria)
