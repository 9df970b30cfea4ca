"""The protocol by which drivers are compared: the same held-out colons, the same draws, the same limits for all."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.learning.dealing import deal, planned
from haustra.envs.learning.recording import Recorder, Recording
from haustra.envs.learning.statistics import bootstrap, wilson
from haustra.envs.runs.outcome import LEFT_OUTSIDE, Outcome
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.drivers import Driver
from haustra.envs.tasks.polyps import EACH, Polyps
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import UnsupportedSceneError
from haustra.models.gas.law import MMHG

FELT = 2.0
"""Wall force above which a step counts as pressing [N]."""
_SHARES = (
    ("completion", "reached"),
    ("intubation", "in_caecum"),
    ("safe_completion", "safe"),
    ("perforated", "perforated"),
)
"""Shares of episodes in a summary, and the column that each counts."""
_GAS = {"gas_pressure_peak_mmHg": ("gas_pressure_peak", 1 / MMHG), "gas_volume_mL": ("gas_volume", 1e6)}
"""Columns of gas, what `Step.info` calls each, and what of them one of its units is."""
MOST_WORLDS = {"cpu": 40, "gpu": 8192}
"""Episodes that run at once on a device. A world whose episode is over is stepped on in vain once none is waiting: a
CPU pays for it, a GPU does not."""


@dataclass(frozen=True)
class Episode:
    """One finished episode. Forces are the largest on one link, read at each decision."""

    colon: str
    seed: int
    friction: float
    reached: bool
    in_caecum: bool
    """The tip came behind the ileocaecal valve, which guidelines call caecal intubation (Rex 2015, Gastrointest Endosc
    81:31, from memory); `reached` asks for more, the caecum's end but for `Limits.caecum_margin`."""
    progress: float
    coverage: float
    """Share of the mucosa seen [1], in withdrawals (`haustra.envs.tasks.coverage`)."""
    seconds: float
    peak_force_N: float
    mean_force_N: float
    share_over_2N: float
    share_over_safe: float
    perforated: bool
    p_perforation: float
    """Share of people whose colon would have been perforated [1] (`haustra.models.injury`)."""
    perforation_arc_m: float
    """Where along the colon that is likeliest [m]."""
    pain: float
    """Largest tension of wall or mesentery over that which hurts [1] (`haustra.models.injury.pain`)."""
    safe: bool
    """Reached, not perforated, and never over `Limits.safe_force`."""
    reason: str
    """reached, perforated, diverged, fully inserted (no shaft is left outside), stuck (no progress in the last
    20 s) or time up."""
    failed_at_m: float
    """Where the tip was when it failed [m]; the way's end when it did not."""
    tip_ahead_m: float
    """How far the tip's arc length was ahead of the inserted length at most [m]. Cutting corners gains a little; where
    loops touch, several centimetres mean that the tip went through a wall from one loop to the next."""
    polyps_found: float | None
    """Share of the polyps that were found [1], in withdrawals (`haustra.envs.tasks.polyps`); None in insertions."""
    gas_pressure_peak_mmHg: float | None
    """Highest pressure of gas in any segment [mmHg]; None without gas."""
    gas_volume_mL: float | None
    """Gas in the colon at the end [mL]; None without gas."""


@dataclass(frozen=True)
class Evaluation:
    """All episodes of one driver."""

    driver: str
    episodes: tuple[Episode, ...]
    colons: int
    recording: Recording | None = None
    """Recording of the best episode, when it was asked for."""

    def summary(self) -> dict[str, Any]:
        """Figures with 95 % intervals, and why episodes failed, as JSON values."""
        found = {name: np.array([getattr(one, name) for one in self.episodes]) for name in Episode.__annotations__}
        rows: dict[str, Any] = {"driver": self.driver, "colons": self.colons, "episodes": len(self.episodes)}
        for name, column in _SHARES:
            low, high = wilson(int(found[column].sum()), len(self.episodes))
            rows[name] = float(found[column].mean())
            rows[f"{name}_wilson"] = [low, high]
            rows[f"{name}_bootstrap"] = self._over_colons(found[column])
        forces = "peak_force_N", "mean_force_N", "share_over_2N", "share_over_safe"
        for column in ("progress", "coverage", *forces, "p_perforation", "pain", "tip_ahead_m"):
            rows[column] = float(found[column].mean())
            rows[f"{column}_bootstrap"] = self._over_colons(found[column])
        if all(value is not None for value in found["polyps_found"]):
            rows["polyps"] = EACH * len(self.episodes)
            rows["polyps_found"] = float(found["polyps_found"].mean())
            rows["polyps_found_bootstrap"] = self._over_colons(found["polyps_found"])
            rows["coverage_median"] = float(np.median(found["coverage"]))
            rows["coverage_median_when_reached"] = _median(found["coverage"][found["reached"]])
        for column in _GAS:
            known = [value for value in found[column] if value is not None]
            rows[column] = float(np.mean(known)) if known else None
        rows["seconds_when_reached"] = _median(found["seconds"][found["reached"]])
        reasons, counts = np.unique(found["reason"], return_counts=True)
        rows["reasons"] = {str(reason): int(count) for reason, count in zip(reasons, counts, strict=True)}
        return rows

    def polyps_more_than(self, other: "Evaluation") -> dict[str, Any]:
        """Share of polyps found, less another driver's in the same withdrawals, and its interval, as JSON values."""
        own, others = (np.array([one.polyps_found for one in who.episodes], float) for who in (self, other))
        more = own - others
        return {"driver": other.driver, "more": float(more.mean()), "bootstrap": self._over_colons(more)}

    def by_colon(self) -> dict[str, dict[str, float]]:
        """Shares of episodes and means, colon by colon, as JSON values."""
        each = len(self.episodes) // self.colons
        groups = [self.episodes[k * each : (k + 1) * each] for k in range(self.colons)]
        return {
            own[0].colon: {
                "completion": float(np.mean([one.reached for one in own])),
                "safe_completion": float(np.mean([one.safe for one in own])),
                "progress": float(np.mean([one.progress for one in own])),
                "peak_force_N": float(np.mean([one.peak_force_N for one in own])),
                "tip_ahead_m": float(np.mean([one.tip_ahead_m for one in own])),
            }
            for own in groups
        }

    def _over_colons(self, values: np.ndarray) -> list[float] | None:
        """Interval of the mean; none from a single colon, which says nothing of others."""
        return list(bootstrap(values.astype(float).reshape(self.colons, -1))) if self.colons > 1 else None

    def rows(self) -> list[dict[str, Any]]:
        """Every episode as JSON values."""
        return [asdict(one) for one in self.episodes]


def evaluate(
    make_driver: Callable[[ScopeTask], Driver],
    name: str,
    config: TaskConfig,
    bank: ColonSet,
    *,
    episodes: int = 5,
    threads: int = 2,
    backend: str = "native",
    most_worlds: int | None = None,
    record: bool = False,
    progress: Callable[[int, int], None] = lambda done, all_of_them: None,
) -> Evaluation:
    """Let a driver drive `episodes` times in every colon of a bank.

    Episode e in colon k draws friction, stiffness, wires and roll by the seed 1000 k + e, whoever drives, and on
    whichever backend.

    Args:
        make_driver: given the task.
        name: of the driver.
        config: the rules, among them what the driver sees.
        bank: the colons.
        episodes: in each.
        threads: for physics on the CPU.
        backend: 'native', MuJoCo on threads; 'linear', linear time on them, or 'linear-gpu'; 'warp', MuJoCo Warp.
        most_worlds: stepped at once; what suits the backend and its device when None.
        record: keep the states of the best episode.
        progress: told episodes done and their number.

    Raises:
        UnsupportedSceneError: when episodes under gas are to be recorded, or the backend cannot honour the task.
    """
    if record and config.gas is not None:
        raise UnsupportedSceneError(
            "Recordings do not hold how wide gas held the lumen: record none, or leave gas out."
        )
    plan = planned(len(bank.cases), episodes)
    worlds = min(most_worlds or MOST_WORLDS[_platform(backend)], len(plan))
    task = ScopeTask(config, worlds=worlds, threads=threads, backend=backend, bank=bank)
    ended, history = dict[int, Episode](), list[np.ndarray]()
    recorder = Recorder(task) if record else None
    polyps = Polyps(task) if config.task == "withdrawal" else None
    for turn in deal(task, make_driver(task), plan):
        history.append(_followed(turn.info))
        if polyps:
            for world, number in turn.begun.items():
                polyps.begin(world, *plan[number])
            polyps.look()
        if recorder:
            recorder.begin(list(turn.begun))
            recorder.look(turn.info, [one.world for one in turn.ended])
        for one in turn.ended:
            last = one.last | ({"polyps_found": polyps.found[one.world].mean()} if polyps else {})
            rows = np.array([column[:, one.world] for column in history[-one.steps :]]).T
            ended[one.number] = _episode(plan[one.number][1], last, rows, task)
            if recorder:
                recorder.end(one.world, one.number, ended[one.number])
        if turn.ended:
            progress(len(ended), len(plan))
    task.close()
    kept = recorder.best if recorder else None
    return Evaluation(name, tuple(ended[number] for number in range(len(plan))), len(bank.cases), kept)


def _median(values: np.ndarray) -> float | None:
    return float(np.median(values)) if len(values) else None


def _platform(backend: str) -> str:
    """What a backend computes on."""
    if backend != "warp":
        return "gpu" if backend == "linear-gpu" else "cpu"
    from haustra.envs.sim.jax_setup import use_jax

    return "cpu" if use_jax()[0].platform == "cpu" else "gpu"


def _followed(info: dict[str, np.ndarray]) -> Float[np.ndarray, "3 worlds"]:
    """Largest wall force [N], not a number where the world has diverged; progress; how far the tip is ahead [m]."""
    return np.stack([np.where(info["diverged"], np.nan, info["wall_force"]), info["progress"], -info["excess"]])


def _episode(seed: int, last: dict[str, Any], history: Float[np.ndarray, "3 steps"], task: ScopeTask) -> Episode:
    """An episode by what was said of its world at last, and what was followed at each step."""
    limits = task.config.limits
    force = history[0][np.isfinite(history[0])] if np.isfinite(history[0]).any() else np.zeros(1)
    reached, perforated = bool(last["reached"]), bool(last["perforated"])
    return Episode(
        colon=task.bank.cases[int(last["case"])].name,
        seed=seed,
        friction=float(last["friction"]),
        reached=reached,
        in_caecum=reached or bool(last["in_caecum"]),
        progress=float(last["progress"]),
        coverage=float(last["coverage"]),
        seconds=float(last["time"]),
        peak_force_N=float(force.max()),
        mean_force_N=float(force.mean()),
        share_over_2N=float((force > FELT).mean()),
        share_over_safe=float((force > limits.safe_force).mean()),
        perforated=perforated,
        p_perforation=float(last["p_perforation"]),
        perforation_arc_m=float(last["perforation_arc"]),
        pain=float(last["pain"]),
        safe=reached and not perforated and bool(force.max() <= limits.safe_force),
        reason=_reason(last, history[1], task),
        failed_at_m=float(last["tip_arc"]),
        tip_ahead_m=float(history[2].max()),
        polyps_found=float(last["polyps_found"]) if "polyps_found" in last else None,
        **{column: unit * float(last[name]) if name in last else None for column, (name, unit) in _GAS.items()},
    )


def _reason(last: dict[str, Any], progress: np.ndarray, task: ScopeTask) -> str:
    for name in ("diverged", "perforated", "reached"):
        if last[name]:
            return name
    if last["tip_arc"] + last["excess"] > task.bank.scene.cable.length - LEFT_OUTSIDE:
        return Outcome.FULLY_INSERTED.value.replace("_", " ")
    recent = progress[-round(20 / task.interval) :]
    return "stuck" if recent[-1] - recent[0] < 1e-3 else "time up"
