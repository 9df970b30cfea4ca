"""How far shipped devices are off by their time step: the same driver at half of it, over grown colons."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from haustra.envs.runs.device_batch import run_devices
from haustra.envs.runs.error import differences, half_step
from haustra.envs.runs.outcome import Outcome
from haustra.models.accuracy import LEAST_COLONS
from haustra.models.anatomy.colon import Colon
from haustra.models.device_scene import device_options
from haustra.models.devices.base import Device
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.scripts.bench.reach import first_place


@dataclass(frozen=True)
class Differences:
    """Runs of one design at half its time step, from those at its own."""

    device: str
    kind: str
    mesentery: bool
    seconds: float
    rows: tuple[Mapping[str, float | None], ...]
    """One a colon that the design fits into (`haustra.envs.runs.error.differences`)."""
    lost: int
    """Runs that diverged, at either step."""


def measure(device: Device, colons: Sequence[Colon], *, seconds: float, mesentery: bool) -> Differences:
    """Let a device's own driver drive it in those colons that it fits into, at its time step and at half of it."""
    starts: list[float] | None = None
    if isinstance(device, TrackedRobot):
        places = [first_place(device, colon) for colon in colons]
        colons = [colon for colon, place in zip(colons, places, strict=True) if place is not None]
        starts = [place for place in places if place is not None]
    options = device_options(device, mesentery=mesentery)
    finer = next(iter(half_step(options).values()))
    asked = {"seconds": seconds, "starts": starts, "patience": np.inf}
    runs, repeats = (run_devices(device, colons, each, **asked) for each in (options, finer))
    rows, lost = [], 0
    for (outcome, records), (other, repeated) in zip(runs, repeats, strict=True):
        if Outcome.DIVERGED in (outcome, other) or not records or not repeated:
            lost += 1
        else:
            rows.append(differences(records, repeated))
    return Differences(device.name, device.kind, mesentery, seconds, tuple(rows), lost)


def ranges(found: Sequence[Differences]) -> dict[str, tuple[float, float]]:
    """Lowest and highest difference of the mean sum of wall forces, where the wall was touched, and of the tip."""
    rows = [row for each in found for row in each.rows]
    names = {"wall_force": "wall_force_sum_mean", "tip_mm": "tip_mm"}
    each = {name: [abs(value) for row in rows if (value := row[key]) is not None] for name, key in names.items()}
    return {name: (min(values), max(values)) for name, values in each.items() if values}


def accuracy_toml(found: Sequence[Differences], where: Mapping[str, Any]) -> str:
    """Text of assets/device_accuracy.toml: kinds that ran in enough colons, and diverged in none."""
    lines = [
        "# How far devices are off by their time step, over grown colons: relative error of the mean sum of wall",
        "# forces, and the median distance of the tip in mm. Written by `haustra bench device-errors`.",
    ]
    for kind, moves in sorted({(each.kind, each.mesentery) for each in found}):
        own = [each for each in found if (each.kind, each.mesentery) == (kind, moves)]
        spans, colons = ranges(own), min(len(each.rows) for each in own)
        if len(spans) < 2 or colons < LEAST_COLONS or any(each.lost for each in own):
            continue
        names = ", ".join(each.device for each in own)
        source = (
            f"measured by `haustra bench device-errors` on {where['date']}: {colons} grown colons, {names}, "
            f"{own[0].seconds:g} s by their own drivers, against half the time step; nobody pushes these devices"
        )
        lines += ["", "[[measured]]", f'device = "{kind}"', f"mesentery = {str(moves).lower()}", f"colons = {colons}"]
        lines += [f"{name} = [{low:.2g}, {high:.2g}]" for name, (low, high) in spans.items()]
        lines += [f'source = "{source}"']
    return "\n".join(lines) + "\n"
