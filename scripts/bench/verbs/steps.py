"""`haustra bench steps`: whether what virtual patients show comes of the time step or of rounding."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, several, whole

TABLE = "steps.json"


@dataclass(frozen=True)
class BenchSteps:
    """Examine the same virtual patients at several time steps, in single and in double precision.

    Tells whether caeca, times, loads of the wall and P(perforation) come of either, for a cohort or for some patients
    of it. Goes on where it was cut short.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the patients and steps.json."""
    patients: int = whole(1, 100_000, default=24)
    """How many virtual patients the cohort has."""
    only: tuple[int, ...] = several("1", 0, 99_999, default=(), whole=True)
    """Numbers of those of them who are examined, from 0; all of them when none is given."""
    seconds: float = number("s", 1.0, 3600.0, default=960.0)
    """Longest examination [s]."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of the cohort."""
    backend: Literal["linear", "linear-gpu"] = "linear"
    """What steps the patients: every core, or an NVIDIA GPU."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Examine, tell, write."""
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.steps import bench_steps
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        asked = {name: getattr(self, name) for name in ("patients", "only", "seconds", "seed", "backend")}
        with progress_bar("patients", 1, unit="examinations") as advance:
            rows = bench_steps(folder, **asked, progress=lambda done, total, note: advance(done, note, total))
        write_json(folder / TABLE, {"asked": asked, "ways": rows})
        if self.json:
            return {"ways": rows}
        return {f"{1e3 * row['timestep']:g} ms, {row['precision']}": _in_words(row) for row in rows}


def _in_words(row: dict[str, Any]) -> str:
    if not row["patients"]:
        return "nobody could be examined to the end"
    return (
        f"{row['caeca']:.3f} of caeca after {row['time_s']:.0f} s; largest load {row['load_peak']:.3g} times the "
        f"median person's strength; P(perforation) {row['p_perforation']:.2g} ({row['patients']} examined)"
    )
