"""`haustra bench sight`: distances by every renderer against exact rays, and the picture beside a path tracer's."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchSight:
    """Measure every renderer of the tip's view against exact rays, and its light against Mitsuba's path tracer.

    What is not there, such as a GPU, is named. Leaves sight-reference.md, sight-reference.json and, with Mitsuba,
    reference.webp.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the page, the figure and the numbers."""
    size: int = whole(16, 512, default=128)
    """Rows and columns of a picture [pixels]."""
    samples: int = whole(2, 4096, default=32)
    """Number of Mitsuba's samples of each pixel."""
    worlds: int = whole(1, 64, default=4)
    """Number of tips whose distances are compared."""
    seconds: float = number("s", 0.1, 600.0, default=8.0)
    """Simulated time for which the follower has driven them [s]."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure, draw, write."""
        import os

        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.envs.tasks.bank import grown_bank
        from haustra.files import prepare_folder, write_atomically, write_json
        from haustra.models.anatomy.grown import grow_colon
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.machine import machine
        from haustra.scripts.bench.pages.reference_figure import draw_reference
        from haustra.scripts.bench.pages.sight_page import sight_page
        from haustra.scripts.bench.sight.depths import bench_depths
        from haustra.scripts.bench.sight.mitsuba_light import has_mitsuba
        from haustra.scripts.bench.sight.reference import PLACES, SEED, bench_reference
        from haustra.scripts.console import progress_bar

        folder, bank = prepare_folder(self.output), grown_bank((0, 1), named_design("adult"))
        with progress_bar("depths", 15, unit="renderers") as advance:
            own = {"worlds": self.worlds, "size": self.size, "seconds": self.seconds}
            depths = bench_depths(bank, progress=advance, **own)
        reference: list[dict[str, Any]] = []
        if has_mitsuba():
            with progress_bar("light", len(PLACES), unit="places") as advance:
                seen, reference = bench_reference(
                    grow_colon(seed=SEED), size=self.size, samples=self.samples, progress=advance
                )
            draw_reference(folder / "reference.webp", seen)
        about = {"size": self.size, "samples": self.samples, "worlds": self.worlds, "seconds": self.seconds}
        kept = {"about": about, "depths": depths, "reference": reference, "machine": machine()}
        write_json(folder / "sight-reference.json", kept)
        page = sight_page(kept)
        write_atomically(folder / "sight-reference.md", lambda temporary: temporary.write_text(page, encoding="utf-8"))
        return kept
