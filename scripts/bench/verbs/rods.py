"""`haustra bench rods`: the cable against a folder of measured or computed rods."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number


@dataclass(frozen=True)
class BenchRods:
    """Compare the cable with a rod's static shapes and tip releases. Errors are fractions of the rod's length."""

    folder: tyro.conf.Positional[Path]
    """Folder with rod.toml, *_dataStatics.csv and *_N.txt."""
    joints: str = "25,50,100"
    """Numbers of joints, separated by commas."""
    timestep: float | None = number("s", 1e-6, 0.1, default=None)
    """Time step of the releases [s]; what is stable and accurate when not given."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for rows.json and pictures of the releases, among them what larger time steps cost."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run every shape and every release at every number of joints."""
        # Newton's matrices are small: several threads on them cost ten times more than they give. Read by numpy's BLAS
        # when it is first imported.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.rod_data import load_rod_data
        from haustra.scripts.bench.rods import bench_rods
        from haustra.scripts.console import progress_bar

        counts = joint_counts(self.joints)
        data = load_rod_data(self.folder)
        folder = prepare_folder(self.output) if self.output else None
        total = len(counts) * (len(data.shapes.tip) + len(data.releases))
        with progress_bar("rods", total, unit="cases") as advance:
            result = bench_rods(data, counts, timestep=self.timestep, progress=advance)
        if folder:
            from haustra.scripts.bench.pictures import release_pictures

            write_json(folder / "rods.json", result)
            release_pictures(folder, data, joints=counts[len(counts) // 2])
        return result


def joint_counts(text: str, *, option: str = "--joints", low: int = 2, high: int = 1000) -> list[int]:
    """Numbers of joints, or of something else, from text such as '25,50,100', smallest first.

    Raises:
        InvalidOptionError: when it is anything else.
    """
    from haustra.errors import InvalidOptionError

    try:
        counts = sorted({int(part) for part in text.split(",")})
    except ValueError:
        raise InvalidOptionError(f"{option} is '{text}'; give whole numbers such as 25,50,100.") from None
    if not all(low <= count <= high for count in counts):
        raise InvalidOptionError(f"{option} is '{text}'; give numbers from {low} to {high}.")
    return counts
