"""`haustra bench ultrathin`: what keeps an ultrathin scope from the caecum."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, whole

TABLE = "ultrathin.json"
"""What a folder holds for docs/validation/trials.md, beside its store."""


@dataclass(frozen=True)
class BenchUltrathin:
    """Examine the same patients with an ultrathin scope, a standard one, and scopes that lie between them.

    Each is driven by the usual endoscopist, who sucks gas out, and by one who leaves it in the colon. Goes on where it
    was cut short.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the scopes, the patients and ultrathin.json."""
    patients: int = whole(3, 10_000, default=96)
    """How many virtual patients each scope examines."""
    seconds: float = number("s", 1.0, 3600.0, default=960.0)
    """Longest examination [s]."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of the patients; 0 has those of the trials' page."""
    backend: Literal["linear", "linear-gpu"] = "linear"
    """What steps the patients: every core, or an NVIDIA GPU."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Examine, count, write."""
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.ultrathin import bench_ultrathin
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        asked = {name: getattr(self, name) for name in ("patients", "seconds", "seed", "backend")}
        with progress_bar("scopes", 1, unit="examinations") as advance:
            rows = bench_ultrathin(folder, **asked, progress=lambda done, total, note: advance(done, note, total))
        write_json(folder / TABLE, {"asked": asked, "scopes": rows})
        if self.json:
            return {"scopes": rows}
        return {row["scope"]: "; with gas left ".join(map(_in_words, list(row.values())[1:])) for row in rows}


def _in_words(caeca: Mapping[str, float]) -> str:
    return f"{caeca['share']:.3f} of caeca, {caeca['more']:+.3f} ({caeca['low']:+.3f} to {caeca['high']:+.3f})"
