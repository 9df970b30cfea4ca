"""`haustra bench gradients`: derivatives in linear time, held against differences, timed, and put to use."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchGradients:
    """Measure derivatives of scopes in linear time: how exact, at what cost, until when; and a search by them."""

    seconds: float = number("s", 0.02, 36_000.0, default=60.0)
    """Processor time of the search by gradient [s]."""
    seeds: int = whole(0, 100_000, default=4)
    """Number of searches by Optuna, each with a seed of its own; 0: no search at all."""
    patience: float = number("1", 1.0, 1000.0, default=2.0)
    """Time that Optuna may search, over that of the search by gradient [1]."""
    colons: int = whole(1, 100_000, default=2)
    """Number of grown colons that are searched in."""
    until: float = number("s", 0.02, 36_000.0, default=20.0)
    """Duration of the insertions that are searched, in simulated time [s]."""
    picture: Path | None = None
    """PNG file to draw the searches, their profiles and the horizons in."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Fixed colons, then colons on their mesentery."""
        found = {"fixed": self._of(mesentery=False), "mesentery": self._of(mesentery=True)}
        if self.picture:
            from haustra.scripts.bench.pages.gradients_figure import draw

            draw(found, self.picture)
        return found

    def _of(self, *, mesentery: bool) -> dict[str, Any]:
        import numpy as np

        from haustra.scripts.bench import gradients, stiffness_profile
        from haustra.scripts.bench.linear import bank_of
        from haustra.scripts.console import progress_bar

        with progress_bar("mesentery" if mesentery else "fixed", 3 + 1 + self.seeds, unit="parts") as advance:
            exact = gradients.agreement(bank_of(40, mesentery=mesentery))
            advance(1, f"derivatives within {max(each.error for each in exact):.1g}")
            bank = bank_of(80, mesentery=mesentery)
            cost = gradients.costs(bank, (1, 4, 8))
            advance(2, f"{cost[-1].plain_steps:.1f} plain steps a step along 8 directions")
            wide = stiffness_profile.Problem(bank, frictions=np.linspace(0.05, 0.12, 8), seconds=24.0)
            far = stiffness_profile.horizons(wide, (8.0, 12.0, 16.0, 20.0, 24.0))
            advance(3, f"{far[-1].off_mean:.2g} off after {far[-1].seconds:.0f} s")
            searches, unseen = [], []
            if self.seeds:
                problem = stiffness_profile.Problem(stiffness_profile.searched(bank, self.colons), seconds=self.until)
                searches.append(stiffness_profile.by_gradient(problem, seconds=self.seconds))
                advance(4, f"{searches[0].best[-1]:.2f} N by gradient")
                for seed in range(self.seeds):
                    longer = self.seconds * self.patience
                    searches.append(stiffness_profile.by_optuna(problem, seconds=longer, seed=seed))
                    advance(5 + seed, f"{searches[-1].best[-1]:.2f} N by Optuna")
                unseen = stiffness_profile.elsewhere(bank, searches, seconds=self.until)
        return {
            "agreement": [vars(each) for each in exact],
            "cost": [vars(each) for each in cost],
            "horizon": [vars(each) for each in far],
            "search": [vars(each) | {"profile": each.profile.tolist()} for each in searches],
            "elsewhere": unseen,
        }
