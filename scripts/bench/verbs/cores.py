"""`haustra bench cores`: what further cores are worth to many scopes at once."""

from dataclasses import asdict, dataclass, field
from typing import Any

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchCores:
    """Step scopes in grown colons on one core and on several, beside MuJoCo alone in processes and on threads."""

    cores: int = whole(1, 4096, default=2)
    """Number of threads, and of the processes beside them."""
    worlds: int = whole(1, 1_000_000, default=32)
    """Number of scopes that are stepped at once."""
    colons: int = whole(1, 100_000, default=4)
    """Number of grown colons."""
    design: str = "adult"
    """Name of a scope design."""
    before: float = number("s", 0.02, 1000.0, default=10.0)
    """Time that the follower drives the scopes in first [s]."""
    repeats: int = whole(1, 10_000, default=7)
    """Number of pairs of timings of each kind; their median is the result."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Grow, drive in, time."""
        from haustra.envs.tasks.bank import grown_bank
        from haustra.errors import InvalidOptionError
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.cores import measure_cores
        from haustra.scripts.bench.machine import machine
        from haustra.scripts.console import progress_bar

        if self.worlds < self.cores:
            raise InvalidOptionError(f"--worlds is {self.worlds}; give at least a world a core, {self.cores}.")
        with progress_bar("grow", self.colons, unit="colons") as advance:
            bank = grown_bank(range(self.colons), named_design(self.design), progress=lambda done: advance(done, ""))
        with progress_bar("time", self.repeats, unit="pairs") as advance:
            found = measure_cores(
                bank,
                cores=self.cores,
                worlds=self.worlds,
                before=self.before,
                repeats=self.repeats,
                progress=advance,
            )
        return {**asdict(found), "machine": machine()}
