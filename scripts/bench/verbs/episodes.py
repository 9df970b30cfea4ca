"""`haustra bench episodes`: speed of the learning environments on this machine, and the slope of memory."""

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchEpisodes:
    """Time environment steps at 25 Hz control in grown colons, the follower driving, and watch memory."""

    worlds: int = whole(1, 1_000_000, default=32)
    """Number of scopes that are stepped at once."""
    threads: int = whole(1, 4096, default=2)
    """Number of threads for physics on the CPU."""
    backend: Literal["native", "linear", "linear-gpu", "warp"] = "native"
    """What computes the physics: MuJoCo on threads (native), the linear-time model on threads (linear) or on an NVIDIA
    GPU (linear-gpu), or MuJoCo Warp on one (warp)."""
    seconds: float = number("s", 0.02, 36_000.0, default=20.0)
    """Simulated time of each world [s]."""
    colons: int = whole(1, 100_000, default=4)
    """Number of grown colons."""
    design: str = "adult"
    """Name of a scope design."""
    observation: Literal["state", "lumen", "depth", "pixels", "dict"] = "state"
    """What environments show: readings of scope and hand, a few distances, a picture of depth or in colour, or the
    first two under names."""
    picture_size: int = whole(8, 512, default=64)
    """Rows and columns of pictures [pixels]."""
    mesentery: bool = False
    """Let colons move on their mesentery."""
    memory_steps: int = whole(0, 10**9, default=0)
    """Number of environment steps over which memory is watched; 0 for none."""
    memory_resets: int = whole(0, 10**9, default=0)
    """Number of resets over which memory is watched; 0 for none."""
    compare: bool = field(default=False)
    """Whether to time the same episodes with numpy in place of the program of 'linear' or 'linear-gpu', too."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Grow, time, watch."""
        from haustra.envs.tasks.bank import grown_bank
        from haustra.envs.tasks.config import TaskConfig
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.episodes import memory_slope, step_rate
        from haustra.scripts.console import progress_bar

        config = TaskConfig(
            design=self.design,
            observation=self.observation,
            picture_size=self.picture_size,
            seeds=(0, self.colons),
            mesentery=self.mesentery,
        )
        with progress_bar("grow", self.colons, unit="colons") as advance:
            bank = grown_bank(range(self.colons), named_design(self.design), progress=lambda done: advance(done, ""))
        rate = step_rate(
            config,
            bank,
            worlds=self.worlds,
            threads=self.threads,
            seconds=self.seconds,
            backend=self.backend,
            compare=self.compare,
        )
        result: dict[str, Any] = {"dofs": int(bank.scene.compile().nv), "spheres": len(bank.scene.samples)}
        result |= asdict(rate)
        if self.memory_steps or self.memory_resets:
            total = self.memory_steps + self.memory_resets
            with progress_bar("watch memory", total, unit="steps") as advance:
                found = memory_slope(
                    config,
                    bank,
                    worlds=self.worlds,
                    steps=self.memory_steps,
                    resets=self.memory_resets,
                    progress=lambda done: advance(done, ""),
                )
            result["memory"] = asdict(found)
        return result
