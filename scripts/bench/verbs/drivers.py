"""`haustra bench drivers`: endoscopists who work differently, held against published figures."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from haustra.fields import whole
from haustra.scripts.bench.verbs.patients import PatientBench


@dataclass(frozen=True)
class BenchDrivers(PatientBench):
    """Let endoscopists who work differently examine the same patients, and tell who comes nearest to published figures.

    Goes on where it was cut short. Whoever is chosen by this must be judged on patients of another seed.
    """

    drivers: int = whole(2, 10_000, default=32)
    """How many endoscopists: the usual one, and others by a Latin hypercube over assets/clinic/endoscopists.toml."""
    patients: int = whole(1, 10_000, default=32)
    """How many virtual patients each of them examines."""
    seed: int = whole(0, 2**32 - 1, default=1000)
    """Seed of patients and settings."""

    def __call__(self) -> dict[str, Any]:
        """Examine, rank, write."""
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.drivers import bench_drivers, settings_files
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        files = settings_files(prepare_folder(folder / "drivers"), self.drivers, seed=self.seed)
        asked = {"patients": self.patients, "seconds": self.seconds, "seed": self.seed, "backend": self.backend}
        with progress_bar("drivers", self.drivers * self.patients, unit="patients") as advance:
            rows = bench_drivers(folder / "store", files, **asked, progress=advance)
        write_json(folder / "drivers.json", rows)
        if self.json:
            return {"drivers": rows}
        return {
            Path(row["driver"]).stem: f"{row['inside_choose']} of the chosen half inside, {row['inside_judge']} of the "
            f"other; caecum {row['caecum']:.2f}"
            for row in rows
        }
