"""Whether demonstrations help: PPO that first imitates recordings of a driver, and PPO that does not, at equal steps.

The episodes are those of a shipped training: a long paediatric scope in grown colons of its band, which move. Drivers
are recorded in training colons, one episode a colon; every arm then learns in the same colons for the same number of
steps, with several seeds; all are judged in held-out colons by the same draws.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.learning.settings import Training, shipped
from haustra.envs.tasks.config import HELD_OUT_SEEDS, TaskConfig

TEACHERS = ("endoscopist", "follower")
"""Drivers that are recorded."""
_FIGURES = ("progress", "completion", "safe_completion", "peak_force_N", "share_over_safe")
"""Figures of an evaluation that are compared."""
_BARE, _WIDE = "rewards alone", "rewards alone, as shipped trainings explore"
_CRITIC = 0.1
"""Share of the steps in which the critic of a policy that has imitated learns alone."""

Progress = Callable[[str], None]
"""Told what is done."""


@dataclass(frozen=True)
class Lesson:
    """What is compared, and how much of it."""

    training: str
    """Shipped training whose episodes they are."""
    episodes: int
    """Demonstrations of each driver, in as many training colons."""
    steps: int
    """Environment steps of each training."""
    seeds: int
    """Trainings of each arm."""
    held_out: int
    """Colons that policies are judged in, twice each."""
    seconds: float
    """Longest episode, of demonstrations, trainings and judgements [s]."""

    @property
    def task(self) -> TaskConfig:
        """Rules of the episodes."""
        own = shipped(self.training).task
        return replace(own, seeds=(0, self.episodes), limits=replace(own.limits, seconds=self.seconds))

    def bare(self, seed: int) -> Training:
        """PPO on one thread, without demonstrations."""
        leg = max(1, round(_CRITIC * self.steps))
        numbers = {"worlds": 16, "rollout": 128, "batch": 512, "epochs": 6, "layers": (128, 128), "leg": leg}
        asked: dict[str, Any] = {"backend": "linear", "imitate": 0, "steps": self.steps, "seed": seed, **numbers}
        return Training(task=self.task, **asked)

    def arms(self, shown: Path) -> Mapping[str, Mapping[str, Any]]:
        """What each arm changes of that."""
        found: dict[str, dict[str, Any]] = {}
        for teacher in TEACHERS:
            given = {"demonstrations": str(shown / teacher)}
            alone = {"steps": 1, "leg": 1, "learning_rate": 1e-9}
            found |= {f"{teacher}, then rewards": given, f"{teacher} alone": given | alone}
        own = shipped(self.training)
        wide = {name: getattr(own, name) for name in ("log_std", "normalise", "first_push", "entropy", "learning_rate")}
        return found | {_BARE: {}, _WIDE: wide | {"stagger": True}}


def bench_teaching(folder: Path, lesson: Lesson, *, processes: int, progress: Progress) -> dict[str, Any]:
    """Record, train, judge, compare.

    Args:
        folder: for recordings and policies; what is there already is kept.
        lesson: what is compared.
        processes: that work beside each other, a thread each.
        progress: told what is done.
    """
    with _beside(processes) as do:
        seeds = [*range(lesson.episodes), *range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + lesson.held_out)]
        do(_grow, [(lesson.task, seed) for seed in seeds], lambda _: progress("colon grown"))
        plan = [(folder / "shown", lesson, teacher, seed) for teacher in TEACHERS for seed in range(lesson.episodes)]
        shown = do(_show, plan, lambda _: progress("episode recorded"))
        arms, runs = lesson.arms(folder / "shown"), range(lesson.seeds)
        trainings = [
            (folder / "policies" / f"{number}-{seed}", replace(lesson.bare(seed), **changed))
            for number, changed in enumerate(arms.values())
            for seed in runs
        ]
        do(_train, trainings, lambda _: progress("policy trained"))
        judged = [(str(place), lesson) for place, _ in trainings] + [(teacher, lesson) for teacher in TEACHERS]
        found = do(_judge, judged, lambda _: progress("driver judged"))
    figures = {
        arm: {name: [found[number * lesson.seeds + seed][name] for seed in runs] for name in _FIGURES}
        for number, arm in enumerate(arms)
    }
    teachers = {
        teacher: {"shown_steps": sum(steps for name, steps in shown if name == teacher), **judgement}
        for teacher, judgement in zip(TEACHERS, found[-len(TEACHERS) :], strict=True)
    }
    return {"lesson": vars(lesson), "teachers": teachers, "arms": figures, "gains": gains(figures)}


def gains(figures: Mapping[str, Mapping[str, Sequence[float]]]) -> dict[str, dict[str, list[float]]]:
    """Progress of each arm less that of rewards alone, seed by seed: mean and 95 % interval [1]."""
    bare = [_BARE, _WIDE]
    return {
        arm: {other: interval(np.subtract(own["progress"], figures[other]["progress"])) for other in bare}
        for arm, own in figures.items()
        if arm not in bare
    }


def interval(differences: Any) -> list[float]:
    """Mean of differences of independent runs, and its 95 % interval by Student's t."""
    from scipy.stats import t

    values = np.asarray(differences, float)
    spread = 0.0
    if len(values) > 1:
        spread = float(t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values)))
    return [float(values.mean()), float(values.mean()) - spread, float(values.mean()) + spread]


@contextmanager
def _beside(processes: int) -> Iterator[Callable[..., list[Any]]]:
    """A way to call a function with many arguments in processes, results in the arguments' order."""
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:

        def do(act: Callable[..., Any], calls: Sequence[tuple[Any, ...]], tell: Callable[[Any], None]) -> list[Any]:
            waiting = [pool.submit(act, *call) for call in calls]
            for one in as_completed(waiting):
                tell(one.result())
            return [one.result() for one in waiting]

        yield do


def _bank(task: TaskConfig, seeds: Sequence[int]) -> Any:
    from haustra.envs.tasks.bank import grown_bank
    from haustra.models.devices.scope.library import named_design

    return grown_bank(seeds, named_design(task.design), difficulty=task.difficulty)


def _grow(task: TaskConfig, seed: int) -> None:
    """One colon into the cache."""
    _bank(task, [seed])


def _show(folder: Path, lesson: Lesson, teacher: str, seed: int) -> tuple[str, int]:
    """One recording of a driver: who, and how many steps."""
    from haustra.envs.console.episode_vehicle import EpisodeVehicle
    from haustra.envs.console.recording import ABOUT, Recorder, load_recording
    from haustra.envs.console.session import Session
    from haustra.models.anatomy.grown import grow_colon
    from haustra.models.anatomy.store import save_colon

    place = folder / teacher / f"episode-{seed:04d}"
    if not (place / ABOUT).exists():
        colon = folder / f"colon-{teacher}-{seed}"
        save_colon(grow_colon(seed=seed, difficulty=lesson.task.difficulty), colon)
        vehicle = EpisodeVehicle(colon, lesson.task, seed=seed, policy=teacher)
        session = Session(vehicle, Recorder(place, vehicle, driver=teacher, seed=seed), assisted=True)
        while not (session.look.row["terminated"] or session.look.row["truncated"]) and session.tick():
            pass
        session.close()
    return teacher, len(load_recording(place).rows["step"]) - 1


def _train(folder: Path, training: Training) -> None:
    from haustra.envs.learning.train import train

    if not (folder / "policy.json").exists():
        train(training, folder, bank=_bank(training.task, range(*training.task.seeds)), threads=1)


def _judge(driver: str, lesson: Lesson) -> dict[str, float]:
    """How a policy of a folder, or a driver of that name, does in held-out colons."""
    from haustra.envs.learning.drivers import PolicyDriver
    from haustra.envs.learning.evaluate import evaluate
    from haustra.envs.learning.policy import load_policy
    from haustra.envs.tasks.drivers import FollowerDriver

    bank = _bank(lesson.task, range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + lesson.held_out))

    def make(task: Any) -> Any:
        if driver in TEACHERS:
            return FollowerDriver(task, law=driver)
        return PolicyDriver(load_policy(Path(driver)), sampled=True)

    found = evaluate(make, driver, lesson.task, bank, episodes=2, threads=1, backend="linear").summary()
    return {name: float(found[name]) for name in _FIGURES}
