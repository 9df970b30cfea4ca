"""What the paper printed, and the shipped results of the finite-element reference that stand beside it."""

import csv
from dataclasses import dataclass

from haustra.assets import asset
from haustra.models.devices.tracked.tread import NUMBERS

SPEEDS = (16.25e-3, 26e-3, 32.5e-3, 43.3e-3, 65e-3)
"""Tread speeds [m/s]. Published."""
SURFACES = {surface: NUMBERS[f"tracked.friction.{surface}"].value for surface in ("tissue", "plastic")}
"""Coulomb's coefficients. Published."""
FORCE = {"tissue": 3.0, "plastic": 1.5}
"""Simulated propulsion of four tracks [N]: "~3 N", "~1.5 N"."""
RIPPLE = 0.2
"""Largest amplitude of a track's friction [N]; "roughly 25 % of the average"."""
RIPPLE_FRACTION = 0.25
STRESSES_KPA = {
    "front": {"high": 64.6, "low": 109.0},
    "rear": {"high": 60.2, "low": 92.5},
    "between": {"high": 57.6, "low": 88.7},
}
"""Tread stress at the front and rear tip, means over the passage, and where it has levelled out with both ends 40 mm
away, in the high- and low-force state."""

_NEAREST = 1 / 16 + 1e-6
"""Positions of the reference stand an eighth of a pitch apart, so one a pitch lies this near to a phase."""


@dataclass(frozen=True)
class TreadStress:
    """Mean stress of the belt in the high- and the low-force state [kPa]."""

    high: float
    low: float

    def to_json(self) -> dict[str, float]:
        """As plain JSON values."""
        return {"high": self.high, "low": self.low}


def tread_stresses() -> dict[str, TreadStress]:
    """Stress at the front tip, the rear tip and levelled out, from the shipped reference at the calibrated load.

    Front and rear are means over the passage of a finite tread; 'between' is the mean of both tips under a tread whose
    ends are at least 40 mm away. A state is high or low by the track's force.
    """
    passage, long = _rows("tracked/passage.csv"), _rows("tracked/two_tips.csv")
    long = [row for row in long if row["spacing_pitches"] == 3.0]
    high, low = (pick(long, key=lambda row: row["contact_N"])["phase"] for pick in (max, min))
    found = {}
    for tip in ("front", "rear"):
        found[tip] = TreadStress(*(_mean(passage, phase, f"stress_{tip}_kPa") for phase in (high, low)))
    found["between"] = TreadStress(
        *((_mean(long, phase, "stress_front_kPa") + _mean(long, phase, "stress_rear_kPa")) / 2 for phase in (high, low))
    )
    return found


def _rows(name: str) -> list[dict[str, float]]:
    with asset(name).open(encoding="utf-8") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def _mean(rows: list[dict[str, float]], phase: float, name: str) -> float:
    chosen = [row[name] for row in rows if abs((row["phase"] - phase + 0.5) % 1.0 - 0.5) <= _NEAREST]
    return sum(chosen) / len(chosen)
