"""`haustra bench rigs`: many rigs of the tracked robot at once, against the native backend."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import whole


@dataclass(frozen=True)
class BenchRigs:
    """Step one track and the whole tracked robot in many worlds by MuJoCo Warp, and compare with the native backend."""

    worlds: str = "1,64,1024,8192,32768"
    """Numbers of worlds, separated by commas."""
    rigs: str = "track,device"
    """Names of rigs, separated by commas: track, device."""
    study: int = whole(0, 10**9, default=0)
    """Number of jobs of the shipped propulsion study, spread over all of it, that are timed; 10000 is all, 0 none."""
    device: str | None = None
    """Device that Warp uses: cuda:0, cpu; its own choice when not given."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for rigs.json."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure."""
        from haustra.errors import InvalidOptionError, MissingDependencyError
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.verbs.rods import joint_counts
        from haustra.scripts.console import progress_bar

        try:
            from haustra.scripts.bench.rigs import RIGS, bench_rigs
        except ImportError as error:
            raise MissingDependencyError("Many rigs at once need MuJoCo Warp: pip install 'haustra[warp]'.") from error
        counts = joint_counts(self.worlds, option="--worlds", low=1, high=1_000_000)
        kinds = [kind.strip() for kind in self.rigs.split(",")]
        if unknown := [kind for kind in kinds if kind not in RIGS]:
            raise InvalidOptionError(f"Rig '{unknown[0]}' is not known. Known: {', '.join(RIGS)}.")
        folder = prepare_folder(self.output) if self.output else None
        with progress_bar("rigs", len(counts) * len(kinds), unit="sizes") as advance:
            result = bench_rigs(kinds, counts, device=self.device, progress=advance)
        if self.study > 0:
            from haustra.scripts.bench.rigs import time_study

            result["study"] = time_study(self.study)
        if folder:
            write_json(folder / "rigs.json", result)
        return result
