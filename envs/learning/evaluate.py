"""The protocol by which drivers are compared: the same held-out colons, the same draws, the same limits for all."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from haustra.envs.learning.statistics import bootstrap, wilson
from haustra.envs.tasks.bank import Bank
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.drivers import Driver
from haustra.envs.tasks.scope_task import ScopeTask

FELT = 2.0
"""Wall force above which a step counts as pressing [N]."""


@dataclass(frozen=True)
class Episode:
    """One finished episode. Forces are the largest on one link, read 25 times a second."""

    colon: str
    seed: int
    friction: float
    reached: bool
    progress: float
    seconds: float
    peak_force_N: float
    mean_force_N: float
    share_over_2N: float
    share_over_safe: float
    perforated: bool
    safe: bool
    """Reached, not perforated, and never over `Limits.safe_force`."""
    reason: str
    """reached, perforated, diverged, stuck (no progress in the last 20 s) or time up."""
    failed_at_m: float
    """Where the tip was when it failed [m]; the way's end when it did not."""


@dataclass(frozen=True)
class Evaluation:
    """All episodes of one driver."""

    driver: str
    episodes: tuple[Episode, ...]
    colons: int

    def summary(self) -> dict[str, Any]:
        """Figures with 95 % intervals, and why episodes failed, as JSON values."""
        found = {name: np.array([getattr(one, name) for one in self.episodes]) for name in Episode.__annotations__}
        rows: dict[str, Any] = {"driver": self.driver, "colons": self.colons, "episodes": len(self.episodes)}
        for name, column in (("completion", "reached"), ("safe_completion", "safe"), ("perforated", "perforated")):
            low, high = wilson(int(found[column].sum()), len(self.episodes))
            by_colon = bootstrap(found[column].astype(float).reshape(self.colons, -1))
            rows[name] = float(found[column].mean())
            rows[f"{name}_wilson"] = [low, high]
            rows[f"{name}_bootstrap"] = list(by_colon)
        for column in ("progress", "peak_force_N", "mean_force_N", "share_over_2N", "share_over_safe"):
            rows[column] = float(found[column].mean())
            rows[f"{column}_bootstrap"] = list(bootstrap(found[column].astype(float).reshape(self.colons, -1)))
        done = found["seconds"][found["reached"]]
        rows["seconds_when_reached"] = float(np.median(done)) if len(done) else None
        reasons, counts = np.unique(found["reason"], return_counts=True)
        rows["reasons"] = {str(reason): int(count) for reason, count in zip(reasons, counts, strict=True)}
        return rows

    def rows(self) -> list[dict[str, Any]]:
        """Every episode as JSON values."""
        return [asdict(one) for one in self.episodes]


def evaluate(
    make_driver: Callable[[ScopeTask], Driver],
    name: str,
    config: TaskConfig,
    bank: Bank,
    *,
    episodes: int = 5,
    threads: int = 2,
    most_worlds: int = 40,
    progress: Callable[[int, int], None] = lambda done, all_of_them: None,
) -> Evaluation:
    """Let a driver drive `episodes` times in every colon of a bank.

    Episode e in colon k draws friction, stiffness, wires and roll by the seed 1000 k + e, whoever drives.

    Args:
        make_driver: given the task.
        name: of the driver.
        config: the rules, among them what the driver sees.
        bank: the colons.
        episodes: in each.
        threads: for physics.
        most_worlds: stepped at once.
        progress: told episodes done and their number.
    """
    plan = [(case, episode) for case in range(len(bank.cases)) for episode in range(episodes)]
    worlds = min(most_worlds, len(plan))
    task = ScopeTask(config, worlds=worlds, threads=threads, bank=bank)
    driver, ended = make_driver(task), {}
    waiting = list(range(len(plan)))[::-1]
    running: dict[int, _Record] = {}

    def begin(places: list[int]) -> None:
        for world in places:
            if not waiting:
                running.pop(world, None)
                continue
            number = waiting.pop()
            case, episode = plan[number]
            task.reset(np.array([world]), [1000 * case + episode], case=case)
            running[world] = _Record(number, 1000 * case + episode)
        mask = np.zeros(worlds, bool)
        mask[places] = True
        driver.begin(mask)

    begin(list(range(worlds)))
    seen = task.observe()
    while running:
        done = task.step(driver.act(seen))
        over = []
        for world, record in running.items():
            record.add({key: values[world] for key, values in done.info.items()})
            if done.terminated[world] or done.truncated[world]:
                ended[record.number] = record.episode(task, bank)
                over.append(world)
        seen = done.observation
        if over:
            begin(over)
            seen = task.observe()
            progress(len(ended), len(plan))
    task.close()
    return Evaluation(name, tuple(ended[number] for number in range(len(plan))), len(bank.cases))


class _Record:
    """What is kept of a running episode."""

    def __init__(self, number: int, seed: int) -> None:
        self.number, self._seed = number, seed
        self._forces: list[float] = []
        self._progress: list[float] = []
        self._last: dict[str, Any] = {}

    def add(self, info: dict[str, Any]) -> None:
        self._last = info
        if not info["diverged"]:
            self._forces.append(float(info["wall_force"]))
        self._progress.append(float(info["progress"]))

    def episode(self, task: ScopeTask, bank: Bank) -> Episode:
        info, limits = self._last, task.config.limits
        force = np.array(self._forces or [0.0])
        reached, perforated = bool(info["reached"]), bool(info["perforated"])
        return Episode(
            colon=bank.cases[int(info["case"])].name,
            seed=self._seed,
            friction=float(info["friction"]),
            reached=reached,
            progress=float(info["progress"]),
            seconds=float(info["time"]),
            peak_force_N=float(force.max()),
            mean_force_N=float(force.mean()),
            share_over_2N=float((force > FELT).mean()),
            share_over_safe=float((force > limits.safe_force).mean()),
            perforated=perforated,
            safe=reached and not perforated and bool(force.max() <= limits.safe_force),
            reason=self._reason(task.interval),
            failed_at_m=float(info["tip_arc"]),
        )

    def _reason(self, interval: float) -> str:
        for name in ("diverged", "perforated", "reached"):
            if self._last[name]:
                return name
        recent = self._progress[-round(20 / interval) :]
        return "stuck" if recent[-1] - recent[0] < 1e-3 else "time up"
