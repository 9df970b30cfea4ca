"""What benchmarks have in common that examine the same virtual patients in several ways."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number


@dataclass(frozen=True)
class PatientBench:
    """Numbers that all of them ask for; each says itself how many patients it examines, and of which seed."""

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the patients, what else is needed, and what is found; goes on with what it holds."""
    seconds: float = number("s", 1.0, 3600.0, default=960.0)
    """Longest examination [s]."""
    backend: Literal["linear", "linear-gpu"] = "linear"
    """What steps the patients: every core, or an NVIDIA GPU."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def _examined(
        self, bench: Callable[..., list[dict[str, Any]]], *, table: str, rows: str, asks: Sequence[str]
    ) -> list[dict[str, Any]]:
        """What a benchmark finds, written beside what it was asked.

        Args:
            bench: takes the folder, numbers that are asked for, and `progress`.
            table: name of the file in the folder.
            rows: name of what is found in that file.
            asks: names of fields that the benchmark takes besides those of all.
        """
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        asked = {name: getattr(self, name) for name in (*asks, "seconds", "backend")}
        with progress_bar(rows, 1, unit="examinations") as advance:
            found = bench(folder, **asked, progress=lambda done, total, note: advance(done, note, total))
        write_json(folder / table, {"asked": asked, rows: found})
        return found
