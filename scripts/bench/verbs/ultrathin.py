"""`haustra bench ultrathin`: what keeps an ultrathin scope from the caecum."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from haustra.fields import whole
from haustra.scripts.bench.verbs.patients import PatientBench

TABLE = "ultrathin.json"
"""What a folder holds for docs/validation/trials.md, beside its store."""


@dataclass(frozen=True)
class BenchUltrathin(PatientBench):
    """Examine the same patients with an ultrathin scope, a standard one, and scopes that lie between them.

    Each is driven by the usual endoscopist, who sucks gas out, and by one who leaves it in the colon. Goes on where it
    was cut short.
    """

    patients: int = whole(3, 10_000, default=96)
    """How many virtual patients each scope examines."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of the patients; 0 has those of the trials' page."""

    def __call__(self) -> dict[str, Any]:
        """Examine, count, write."""
        from haustra.scripts.bench.ultrathin import bench_ultrathin

        rows = self._examined(bench_ultrathin, table=TABLE, rows="scopes", asks=("patients", "seed"))
        if self.json:
            return {"scopes": rows}
        return {row["scope"]: "; with gas left ".join(map(_in_words, list(row.values())[1:])) for row in rows}


def _in_words(caeca: Mapping[str, float]) -> str:
    return f"{caeca['share']:.3f} of caeca, {caeca['more']:+.3f} ({caeca['low']:+.3f} to {caeca['high']:+.3f})"
