"""`haustra bench worlds`: how fast many scopes step at once on this machine."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

from haustra.fields import number, whole

_FINE_CELL = 0.0112
"""Distance between joints [m] that makes 140 of an adult scope in a colon of 1.5 m."""


@dataclass(frozen=True)
class BenchWorlds:
    """Step many scopes at once in grown colons, and say how fast."""

    worlds: str = "1,32,128"
    """Numbers of worlds, separated by commas."""
    backend: Literal["linear", "linear-gpu", "native", "warp"] = "linear"
    """What computes: linear time on threads (linear) or on an NVIDIA GPU (linear-gpu), MuJoCo's engine on threads
    (native), or MuJoCo Warp on an NVIDIA GPU (warp)."""
    threads: int = whole(1, 4096, default=1)
    """Number of threads of the CPU that share the worlds."""
    colons: int = whole(1, 1000, default=2)
    """Number of grown colons, from seed 0 on, that the worlds share."""
    design: str = "adult"
    """Name of a scope design, or a file that ends in .toml."""
    insertions: int = whole(0, 1_000_000, default=0)
    """Number of insertions of 30 s by the lumen follower, timed as a whole with compilation; not on 'native'."""
    timestep: float = number("s", 1e-5, 0.02, default=0.005)
    """Integration step [s]."""
    compare: float = number("s", 0.0, 36_000.0, default=0.0)
    """Simulated time over which a scope in each colon is compared with a native one of 140 joints under the same
    inputs [s]; 0 for no comparison."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Build, warm up, time."""
        from haustra.envs.sim.load import backend_of
        from haustra.errors import InvalidOptionError
        from haustra.scripts.bench.verbs.rods import joint_counts
        from haustra.scripts.console import progress_bar

        counts = joint_counts(self.worlds, option="--worlds", low=1, high=1_000_000)
        if self.backend == "native" and self.insertions:
            raise InvalidOptionError("--insertions needs one of the backends linear, linear-gpu, warp.")
        backend_of(self.backend)  # installed?
        from haustra.envs.sim.scope_colon_set import BATCH_OPTIONS, build_bank
        from haustra.models.anatomy.grown import grow_colon
        from haustra.models.devices.scope.files import find_design
        from haustra.scripts.bench.machine import machine
        from haustra.scripts.bench.throughput import Rate, measure_insertions, measure_rates, rate_rows
        from haustra.scripts.bench.worlds_accuracy import compare_with_native

        with progress_bar("grow", self.colons, unit="colons") as advance:
            colons = []
            for seed in range(self.colons):
                colons.append(grow_colon(seed=seed))
                advance(seed + 1, "")
        bank = build_bank(colons, find_design(self.design), replace(BATCH_OPTIONS, timestep=self.timestep))
        where: dict[str, Any] = {"backend": self.backend, "threads": self.threads}
        with progress_bar("time", len(counts), unit="sizes") as advance:
            done: list[float] = []

            def report(rate: Rate) -> None:
                done.append(rate.steps_per_s)
                advance(len(done), f"{rate.steps_per_s:.3g} steps/s")

            rates = measure_rates(bank, counts, **where, progress=report)
        further: dict[str, Any] = {}
        if self.insertions > 0:
            further["insertions"] = measure_insertions(bank, self.insertions, seconds=30.0, **where)
        if self.compare > 0:
            scope = (bank.scene.design, bank.scene.options)
            further["accuracy"] = {
                colon.name: compare_with_native(
                    colon, *scope, cell=_FINE_CELL, seconds=self.compare, backend=self.backend
                ).summary()
                for colon in colons
            }
        return {
            "machine": machine(),
            **where,
            "dofs": int(bank.scene.compile().nv),
            "joints": len(bank.scene.cable.cells),
            "spheres": len(bank.scene.samples),
            "timestep_s": self.timestep,
            "field_error_p95_mm": max(error.depth_p95 for error in bank.errors) * 1e3,
            "rates": rate_rows(rates),
            **further,
        }
