"""`haustra bench agreement`: the backends held against each other, in one table."""

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchAgreement:
    """Bend, drop and insert scopes and run treads on every backend that is installed, and compare with the native one.

    On two cores the first two parts take a minute, insertions on MuJoCo Warp half a minute a seed. A backend agrees in
    a score when the whole 95 % interval of its mean difference lies within 3 % (of shares: 3 of 100).
    """

    parts: str = "free,pads,insertions"
    """What to compare, separated by commas: free (a scope without a wall), pads (of a track), insertions."""
    backends: str = "linear,warp"
    """Backends held against the native one, separated by commas; those that are not installed are skipped."""
    seeds: int = whole(3, 1_000_000, default=256)
    """Number of insertions on each backend; each draws its own colon, friction, stiffness and start."""
    seconds: float = number("s", 0.02, 600.0, default=30.0)
    """Longest insertion, in simulated time [s]."""
    timestep: float = number("s", 0.0005, 0.02, default=0.005)
    """Step of every backend [s]; the time between two decisions, 0.04 s, is a whole number of them."""
    colons: int = whole(1, 100_000, default=8)
    """Number of grown colons."""
    mesentery: Literal["fixed", "mesentery", "both"] = "both"
    """How the colons of insertions stand: fixed in space, on their mesentery, or both."""
    design: str = "adult"
    """Name of a scope design."""
    processes: int = whole(0, 4096, default=0)
    """Number of processes for the native backend and for growing colons; as many as there are cores when 0."""
    device: str | None = None
    """Device of Warp where there is no wall: cuda:0, cpu; its own choice when not given. Insertions run on JAX's."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for agreement.json; finished insertions are kept there, and the next call goes on after them."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Compare."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.children import cores
        from haustra.envs.tasks.bank import grown_bank
        from haustra.errors import InvalidOptionError
        from haustra.files import prepare_folder, write_json
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.agreement.row import table
        from haustra.scripts.bench.agreement.run import BACKENDS, PARTS, compare_backends, devices
        from haustra.scripts.console import progress_bar

        parts = [part.strip() for part in self.parts.split(",")]
        if unknown := [part for part in parts if part not in PARTS]:
            raise InvalidOptionError(f"Part '{unknown[0]}' is not known. Known: {', '.join(PARTS)}.")
        backends = [backend.strip() for backend in self.backends.split(",")]
        if unknown := [backend for backend in backends if backend not in BACKENDS]:
            raise InvalidOptionError(f"Backend '{unknown[0]}' is not known. Known: {', '.join(BACKENDS)}.")
        folder = prepare_folder(self.output) if self.output else None
        processes = self.processes or cores()
        with progress_bar("grow", self.colons, unit="colons") as advance:
            bank = grown_bank(
                range(self.colons if "insertions" in parts else 1),
                named_design(self.design),
                processes=processes,
                progress=lambda done: advance(done, ""),
            )
        bank = replace(bank, options=replace(bank.options, timestep=self.timestep))
        with progress_bar("agreement", len(parts), unit="parts") as advance:
            rows = compare_backends(
                bank,
                parts,
                backends=backends,
                seeds=self.seeds,
                seconds=self.seconds,
                processes=processes,
                folder=folder / "insertions" if folder else None,
                mesentery={"fixed": (False,), "mesentery": (True,), "both": (False, True)}[self.mesentery],
                device=self.device,
                progress=advance,
            )
        where = devices()
        result = {"rows": [row.to_json() for row in rows], "agree": all(row.agrees is not False for row in rows)}
        asked = {"seconds": self.seconds, "timestep": self.timestep, "seeds": self.seeds, "colons": self.colons}
        command = f"haustra bench agreement --parts {self.parts} --backends {self.backends} --seeds {self.seeds}"
        command += f" --timestep {self.timestep:g} --mesentery {self.mesentery} -o DIR --json"
        result |= {**asked, "command": command, "machine": where}
        if folder:
            write_json(folder / "agreement.json", result)
        return result if self.json else {**table(rows), "machine": where}
