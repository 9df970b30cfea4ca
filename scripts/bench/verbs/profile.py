"""`haustra bench profile`: where the time of a step goes."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class BenchProfile:
    """Time the stages of a step in the standard scenes: an insertion against pieces and planes, the tracked robot."""

    colon: Path | None = None
    """Folder of a colon; grown seed 0 with a wall of prisms when not given."""
    quick: bool = False
    """Time 2 s of simulated time after 5 s instead of 5 s after 15 s."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for profile.json."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_json
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.profile import bench_profile
        from haustra.scripts.bench.verbs.skip import colon_and_wall
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output) if self.output else None
        colon, wall = colon_and_wall(self.colon)
        before, seconds = (5.0, 2.0) if self.quick else (15.0, 5.0)
        with progress_bar("profile", 1, unit="benches") as advance:
            bench = bench_profile(
                colon,
                wall,
                named_design("adult"),
                before=before,
                seconds=seconds,
                progress=lambda note: advance(0, note),
            )
        result = bench.to_json()
        if folder:
            write_json(folder / "profile.json", result)
        if self.json:
            return result
        stages, whole = result["tables"][0]["rows"], result["tables"][2]["rows"][0]
        pace = f"{whole['real_time_factor']:.1f} x real time over {whole['simulated_s']:.0f} s"
        return {row["scene"]: _said(row) for row in stages} | {"a run at the defaults": pace}


def _said(row: dict[str, Any]) -> str:
    return (
        f"{row['step_us']:.0f} us a step: {row['collision_narrow_us']:.0f} collision, "
        f"{row['constraint_solver_us']:.0f} solver ({row['dofs']} dofs, {row['contacts']} contacts)"
    )
