"""`haustra bench agreement`: the engines held against each other, in one table."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class BenchAgreement:
    """Bend, drop and insert scopes and run treads on every engine that is installed, and compare with the native one.

    On two cores the first two parts take a minute, insertions on MuJoCo Warp half a minute a seed.
    """

    parts: str = "free,pads,insertions"
    """What to compare, separated by commas: free (a scope without a wall), pads (of a track), insertions."""
    engines: str = "jax,warp"
    """That are held against the native one, of those that are installed, separated by commas."""
    seeds: int = 32
    """Insertions on each engine; each draws its own colon, friction, stiffness and start."""
    seconds: float = 60.0
    """Longest insertion [s]."""
    colons: int = 4
    """Grown colons."""
    design: str = "adult"
    """Scope design."""
    threads: int = 2
    """Of the native engine, and of growing."""
    device: str | None = None
    """Of Warp where there is no wall: cuda:0, cpu; its own choice when not given. Insertions run where JAX does."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for agreement.json."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Compare."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.envs.sim.device_engines import DEVICE_ENGINES
        from haustra.envs.tasks.bank import grown_bank
        from haustra.errors import InvalidOptionError
        from haustra.files import prepare_folder, write_json
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.agreement.row import table
        from haustra.scripts.bench.agreement.run import PARTS, compare_engines, devices
        from haustra.scripts.console import progress_bar

        parts = [part.strip() for part in self.parts.split(",")]
        if unknown := [part for part in parts if part not in PARTS]:
            raise InvalidOptionError(f"Part '{unknown[0]}' is not known. Known: {', '.join(PARTS)}.")
        engines = [engine.strip() for engine in self.engines.split(",")]
        if unknown := [engine for engine in engines if engine not in DEVICE_ENGINES]:
            raise InvalidOptionError(f"Engine '{unknown[0]}' is not known. Known: {', '.join(DEVICE_ENGINES)}.")
        if self.seeds < 3 or min(self.colons, self.threads) < 1 or not 0 < self.seconds <= 600:
            raise InvalidOptionError("Give at least 3 seeds, 1 colon and 1 thread, and a time of up to 600 s.")
        folder = prepare_folder(self.output) if self.output else None
        with progress_bar("grow", self.colons, unit="colons") as advance:
            bank = grown_bank(
                range(self.colons if "insertions" in parts else 1),
                named_design(self.design),
                processes=self.threads,
                progress=lambda done: advance(done, ""),
            )
        with progress_bar("agreement", len(parts), unit="parts") as advance:
            rows = compare_engines(
                bank,
                parts,
                engines=engines,
                seeds=self.seeds,
                seconds=self.seconds,
                threads=self.threads,
                device=self.device,
                progress=advance,
            )
        where = devices()
        result = {"rows": [row.to_json() for row in rows], "agree": all(row.agrees is not False for row in rows)}
        result["machine"] = where
        if folder:
            write_json(folder / "agreement.json", result)
        return result if self.json else {**table(rows), "machine": where}
