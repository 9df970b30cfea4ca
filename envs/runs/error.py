"""The numerical error of one run: the same run at half the time step, and of a scope with finer joints."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from haustra.envs.runs.outcome import Outcome
from haustra.models.accuracy import NumericalError, Range
from haustra.models.scene import SceneOptions

FINER = 2
"""How many times as many joints the repeat with finer joints has."""

_FORCES = ("push_force", "wall_force_sum", "wall_force")


@runtime_checkable
class Recorded(Protocol):
    """A finished run of any device."""

    @property
    def outcome(self) -> Outcome:
        """How it ended."""
        ...

    @property
    def records(self) -> Mapping[str, Any]:
        """What was recorded at every control interval, by name."""
        ...


def refinements(options: SceneOptions) -> dict[str, SceneOptions]:
    """What a run is repeated with, by name."""
    joints = replace(
        options,
        shaft_cell=options.shaft_cell / FINER,
        bending_cell=options.bending_cell / FINER,
        twist_hinges=options.twist_hinges * FINER,
    )
    return {**half_step(options), "finer joints": joints}


def half_step(options: SceneOptions) -> dict[str, SceneOptions]:
    """What a run of a device whose joints are its own is repeated with, by name."""
    return {"half the time step": replace(options, timestep=options.timestep / 2)}


def own_error(run: Recorded, repeats: Mapping[str, Recorded]) -> NumericalError:
    """Differences of a run from its repeats, and their range; a repeat that diverged is named and counts for nothing.

    The driver is the same and sees each repeat's own state, so that small differences grow as they do for a user. The
    force on one link is given too, though a link of half the length bears less of a spread load.
    """
    sound = {name: other for name, other in repeats.items() if _sound(run) and _sound(other)}
    found = {name: differences(run.records, other.records) for name, other in sound.items()}
    lost = [name for name in repeats if name not in sound]
    return NumericalError(
        wall_force=_range([each["wall_force_sum_mean"] for each in found.values()]),
        push=_range([each.get("push_force_mean") for each in found.values()]),
        tip_mm=_range([each["tip_mm"] for each in found.values()]),
        measured_on=f"this run against {' and '.join(repeats)}" + (f"; diverged: {', '.join(lost)}" if lost else ""),
        differences=found,
    )


def _sound(run: Recorded) -> bool:
    return run.outcome is not Outcome.DIVERGED and len(run.records["time"]) > 0


def differences(run: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, float | None]:
    """Relative differences of the forces that there are, the repeat less the run; lengths in their unit."""
    common = min(len(run["time"]), len(other["time"]))
    away = np.linalg.norm(run["tip"][:common] - other["tip"][:common], axis=1)
    found: dict[str, float | None] = {
        "reach_m": float(other["tip_arc"].max() - run["tip_arc"].max()),
        "tip_mm": float(np.median(away)) * 1e3,
        "tip_peak_mm": float(away.max()) * 1e3,
    }
    for name in (each for each in _FORCES if each in run):
        ours, theirs = np.abs(run[name]), np.abs(other[name])
        found[f"{name}_mean"] = _relative(float(ours.mean()), float(theirs.mean()))
        found[f"{name}_peak"] = _relative(float(ours.max()), float(theirs.max()))
    return found


def _relative(ours: float, theirs: float) -> float | None:
    return theirs / ours - 1 if ours > 0 else None


def _range(values: list[float | None]) -> Range:
    known = [abs(value) for value in values if value is not None]
    return (min(known), max(known)) if known else (None, None)
