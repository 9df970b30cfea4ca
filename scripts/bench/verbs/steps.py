"""`haustra bench steps`: whether what virtual patients show comes of the time step or of rounding."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from haustra.fields import several, whole
from haustra.scripts.bench.verbs.patients import PatientBench

TABLE = "steps.json"
"""What a folder holds beside its stores."""


@dataclass(frozen=True)
class BenchSteps(PatientBench):
    """Examine the same virtual patients at several time steps, in single and in double precision.

    Tells whether caeca, times, loads of the wall and P(perforation) come of either, for a cohort or for some patients
    of it. Goes on where it was cut short.
    """

    patients: int = whole(1, 100_000, default=24)
    """How many virtual patients the cohort has."""
    only: tuple[int, ...] = several("1", 0, 99_999, default=(), whole=True)
    """Numbers of those of them who are examined, from 0; all of them when none is given."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of the cohort."""

    def __call__(self) -> dict[str, Any]:
        """Examine, tell, write."""
        from haustra.scripts.bench.steps import bench_steps

        rows = self._examined(bench_steps, table=TABLE, rows="ways", asks=("patients", "only", "seed"))
        if self.json:
            return {"ways": rows}
        return {f"{1e3 * row['timestep']:g} ms, {row['precision']}": _in_words(row) for row in rows}


def _in_words(row: Mapping[str, Any]) -> str:
    if not row["patients"]:
        return "nobody could be examined to the end"
    return (
        f"{row['caeca']:.3f} of caeca after {row['time_s']:.0f} s; largest load {row['load_peak']:.3g} times the "
        f"median person's strength; P(perforation) {row['p_perforation']:.2g} ({row['patients']} examined)"
    )
