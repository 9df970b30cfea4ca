"""`haustra bench contracts`: whether environments are what Gymnasium and Stable-Baselines3 expect."""

from dataclasses import dataclass, field
from typing import Any

from haustra.fields import whole


@dataclass(frozen=True)
class BenchContracts:
    """Check every environment in every mode of observation, over many seeds, and count what breaks its contract."""

    seeds: int = whole(1, 100_000, default=40)
    """Number of episodes of each environment in each checker."""
    only: str = ""
    """Check only environments whose names hold this text; all when empty."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Check all, and list what was found."""
        from haustra.scripts.learning_extra import require_learning

        require_learning("gymnasium", "stable_baselines3", "torch")
        from haustra.scripts.bench.contracts import check, every_environment
        from haustra.scripts.console import progress_bar

        few = {"seeds": (0, 2)}
        found = []
        for name, make in every_environment(scope=few, withdrawal=few):
            if self.only in name:
                with progress_bar(name, self.seeds, unit="seeds") as advance:
                    found.append(check(name, make, seeds=self.seeds, tell=lambda done, tell=advance: tell(done, "")))
        return {
            "episodes": sum(one.episodes for one in found),
            "problems": sum(len(one.problems) for one in found),
            "seconds": sum(one.seconds for one in found),
            **{one.environment: list(one.problems) for one in found},
        }
