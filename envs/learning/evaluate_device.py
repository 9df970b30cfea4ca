"""The protocol by which drivers of one device that is no scope are compared: the same colons and draws for all."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from haustra.envs.learning.dealing import deal, planned
from haustra.envs.learning.statistics import bootstrap
from haustra.envs.tasks.device_task import DeviceTask
from haustra.envs.tasks.drivers import Driver


@dataclass(frozen=True)
class DeviceEpisode:
    """One finished episode of a device. Forces are the largest on one body, read at each decision."""

    colon: str
    seed: int
    friction: float
    reached: bool
    progress: float
    seconds: float
    peak_force_N: float
    mean_force_N: float
    p_perforation: float
    """Share of people whose colon would have been perforated [1] (`haustra.models.injury`)."""
    outcome: str
    """completed, escaped or diverged; time_up when the time was over."""


@dataclass(frozen=True)
class DeviceEvaluation:
    """All episodes of one driver, colon by colon."""

    driver: str
    device: str
    episodes: tuple[DeviceEpisode, ...]
    colons: int

    def summary(self) -> dict[str, Any]:
        """Means with 95 % intervals over colons, and how episodes ended, as JSON values."""
        rows: dict[str, Any] = {"driver": self.driver, "device": self.device, "colons": self.colons}
        rows["episodes"] = len(self.episodes)
        for name in _MEANS:
            values = np.array([float(getattr(one, name)) for one in self.episodes])
            rows[name] = float(values.mean())
            if self.colons > 1:
                rows[f"{name}_bootstrap"] = list(bootstrap(values.reshape(self.colons, -1)))
        outcomes, counts = np.unique([one.outcome for one in self.episodes], return_counts=True)
        return rows | {"outcomes": {str(one): int(count) for one, count in zip(outcomes, counts, strict=True)}}

    def rows(self) -> list[dict[str, Any]]:
        """Every episode as JSON values."""
        return [asdict(one) for one in self.episodes]

    def further_than(self, other: "DeviceEvaluation") -> dict[str, Any]:
        """Share of the way that this driver came further than another in the same episodes, as JSON values."""
        pairs = zip(self.episodes, other.episodes, strict=True)
        more = np.array([one.progress - the_other.progress for one, the_other in pairs])
        interval = list(bootstrap(more.reshape(self.colons, -1))) if self.colons > 1 else None
        return {"driver": other.driver, "more": float(more.mean()), "bootstrap": interval}


_MEANS = tuple(one.name for one in fields(DeviceEpisode) if one.name not in ("colon", "seed", "friction", "outcome"))


def evaluate_device(
    make_driver: Callable[[DeviceTask], Driver],
    name: str,
    task: DeviceTask,
    *,
    episodes: int = 5,
    progress: Callable[[int, int], None] = lambda done, all_of_them: None,
) -> DeviceEvaluation:
    """Let a driver drive `episodes` times in every colon of a task.

    Episode e in colon k draws friction and stiffness of the wall by the seed 1000 k + e, whoever drives.

    Args:
        make_driver: given the task.
        name: of the driver.
        task: its worlds; reset by this.
        episodes: in each colon.
        progress: told episodes done and their number.
    """
    plan = planned(len(task.colons), episodes)
    ended, forces = dict[int, DeviceEpisode](), list[np.ndarray]()
    for turn in deal(task, make_driver(task), plan):
        forces.append(np.array(turn.info["wall_force"], float))
        for one in turn.ended:
            case, seed = plan[one.number]
            felt = np.array([force[one.world] for force in forces[-one.steps :]])
            ended[one.number] = _episode(one.last, felt, task.colons[case].name, seed)
        if turn.ended:
            progress(len(ended), len(plan))
    return DeviceEvaluation(name, task.device.name, tuple(ended[k] for k in range(len(plan))), len(task.colons))


def _episode(last: dict[str, Any], forces: np.ndarray, colon: str, seed: int) -> DeviceEpisode:
    felt = forces[np.isfinite(forces)]
    return DeviceEpisode(
        colon=colon,
        seed=seed,
        friction=float(last["friction"]),
        reached=bool(last["reached"]),
        progress=float(last["progress"]),
        seconds=float(last["time"]),
        peak_force_N=float(felt.max(initial=0.0)),
        mean_force_N=float(felt.mean()) if len(felt) else 0.0,
        p_perforation=float(last["p_perforation"]),
        outcome=str(last["outcome"]) or "time_up",
    )
