"""`haustra bench cost`: what a step costs, against the number of joints."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from haustra.fields import number


@dataclass(frozen=True)
class BenchCost:
    """Steps per second of the cable, the plugin cable, a 1D flex and a plain chain, alone and in a colon."""

    colon: Path | None = None
    """Folder of a colon to run scopes in; only rods alone are timed when not given."""
    design: str = "adult"
    """Name of a scope design, or a file that ends in .toml."""
    joints: str = "20,40,60,100,140"
    """Numbers of joints, separated by commas."""
    seconds: float = number("s", 0.02, 36_000.0, default=10.0)
    """Simulated time in the colon [s]."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Time everything in one run, so that figures compare."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.models.anatomy.store import load_colon
        from haustra.models.devices.scope.files import find_design
        from haustra.models.wall.pieces.folder import wall_of
        from haustra.scripts.bench.cost import TIMESTEP, cost_alone, cost_in_colon
        from haustra.scripts.bench.verbs.rods import joint_counts
        from haustra.scripts.console import progress_bar

        counts = joint_counts(self.joints)
        design = find_design(self.design)
        result: dict[str, Any] = {"timestep_s": TIMESTEP, "design": design.name}
        with progress_bar("cost", len(counts) * (2 if self.colon else 1), unit="sizes") as advance:
            result["alone"] = cost_alone(design, counts, progress=advance)
            if self.colon:
                colon = load_colon(self.colon)
                wall = wall_of(self.colon, colon, "prism")
                result["in_colon"] = cost_in_colon(
                    colon,
                    wall,
                    design,
                    counts,
                    seconds=self.seconds,
                    progress=lambda done, note: advance(len(counts) + done, note),
                )
        return result
