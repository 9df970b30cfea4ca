"""`haustra bench linear`: what a step of the backend 'linear' costs, and how far it is from the dense step."""

from dataclasses import dataclass, field
from typing import Any, Literal

from haustra.fields import whole


@dataclass(frozen=True)
class BenchLinear:
    """Time steps in linear time by joints and worlds, and compare with the dense step in double precision."""

    worlds: str = "1,128"
    """Numbers of worlds, separated by commas."""
    dofs: str = "40,80,160,400"
    """Approximate numbers of joints of the scopes, separated by commas: some of 40, 80, 160, 400."""
    threads: int = whole(1, 4096, default=1)
    """Number of threads of the CPU that share the worlds."""
    device: Literal["cpu", "cuda"] = "cpu"
    """Where steps are computed: on threads of the CPU, or on the first NVIDIA GPU."""
    mesentery: bool = False
    """Let the colons move on their mesentery."""
    designs: bool = False
    """Give each world a scope design of its own, instead of one to all."""
    dense: bool = True
    """Time MuJoCo's native batch with 80 joints too, and compare with a dense step by MuJoCo's matrices."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Build, drive in, time, compare."""
        from dataclasses import replace

        from haustra.errors import InvalidOptionError
        from haustra.scripts.bench import linear
        from haustra.scripts.bench.verbs.rods import joint_counts
        from haustra.scripts.console import progress_bar

        counts = joint_counts(self.worlds, option="--worlds", low=1, high=1_000_000)
        sizes = joint_counts(self.dofs, option="--dofs", low=1, high=10_000)
        if unknown := set(sizes) - set(linear.SIZES):
            raise InvalidOptionError(
                f"--dofs {min(unknown)} is not known: give some of {', '.join(map(str, linear.SIZES))}."
            )
        rows: list[linear.Cost] = []
        bank = linear.bank_of(80, mesentery=self.mesentery)
        found: dict[str, Any] = {}
        found["compile_s"], found["cached_s"] = linear.compile_cost(bank, device=self.device)
        with progress_bar("time", len(sizes), unit="sizes") as advance:
            for done, size in enumerate(sizes, 1):
                own = linear.resized(bank, size)
                about: dict[str, Any] = {"threads": self.threads, "device": self.device, "designs": self.designs}
                rows += linear.measure_cost(own, counts, **about)
                advance(done, f"{rows[-1].us_per_step:.3g} us a step")
        if self.dense:
            rows = [
                replace(row, us_per_step_dense=linear.dense_cost(bank, row.worlds, threads=self.threads) * 1e6)
                if _is_80(row)
                else row
                for row in rows
            ]
            found["largest_difference"] = linear.largest_difference(bank)
            if self.mesentery:
                found["largest_difference_gathered"] = linear.largest_difference(bank, before_step=linear.gather)
        most = [row for row in rows if row.worlds == max(counts)]
        found["exponent"] = linear.exponent(most) if len(most) > 1 else None
        return {"rows": [vars(row) for row in rows], **found}


def _is_80(row: Any) -> bool:
    return 70 <= row.dofs <= 90
