"""Snare and biopsy forceps through a scope's channel: what they reach, grip and cut.

Assumptions, named: an instrument leaves the channel's mouth along the tip's axis and stays straight; it weighs and
resists nothing, so the scope does not notice it; a loop closes round whatever lies within it; a cold snare goes through
tissue up to a width, and then always; forceps always hold what they touch. Numbers: assets/numbers/instruments.toml.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.models.anatomy.colon import Lesion
from haustra.models.anatomy.lesion_shapes import STALK_WIDTH
from haustra.quantity import load_quantities

Instrument = Literal["snare", "forceps"]

TOO_FAR = "too far"
"""Why what lies beyond an instrument's reach is out of it."""


def instrument_number(name: str) -> float:
    """Value of a number of assets/numbers/instruments.toml, by its name behind 'instrument.'."""
    return float(load_quantities(asset("numbers/instruments.toml"))[f"instrument.{name}"].value)


@dataclass(frozen=True)
class PolypPose:
    """Where a polyp is."""

    top: Float[np.ndarray, "3"]
    """Its highest place [m]."""
    foot: Float[np.ndarray, "3"]
    """Middle of its foot on the wall [m]."""
    lesion: Lesion
    """What it is."""


def channel_mouth(tip: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3"]:
    """Where instruments leave a tip [m], whose frame is that of `Readings.tip_frame`."""
    return tip - instrument_number("channel_offset_down") * frame[:, 0]


def out_of_reach(
    instrument: Instrument, mouth: Float[np.ndarray, "3"], ahead: Float[np.ndarray, "3"], polyp: PolypPose
) -> str | None:
    """Why an instrument cannot take a polyp from here; None when it can.

    Args:
        instrument: which.
        mouth: of the channel [m].
        ahead: direction of the tip's axis.
        polyp: where it is.
    """
    if instrument == "snare" and (width := cut_width(polyp.lesion)) > instrument_number("snare.largest_cut"):
        return f"{1e3 * width:.0f} mm of tissue are too wide for a cold snare"
    middle = (polyp.top + polyp.foot) / 2
    along = float((middle - mouth) @ ahead)
    aside = float(np.linalg.norm(middle - mouth - along * ahead))
    if not instrument_number("least_extension") <= along <= instrument_number(f"{instrument}.reach"):
        return "too near" if along < instrument_number("least_extension") else TOO_FAR
    loop = instrument_number("snare.loop")
    room = (loop - polyp.lesion.size) / 2 if instrument == "snare" else polyp.lesion.size / 2
    if room < 0:
        return "wider than the loop"
    if aside > room:
        return "beside the instrument's way"
    down = polyp.foot - polyp.top
    angle = np.degrees(np.arccos(np.clip(ahead @ down / max(float(np.linalg.norm(down)), 1e-12), -1.0, 1.0)))
    return "at too wide an angle" if angle > instrument_number(f"{instrument}.angle") else None


def cut_width(lesion: Lesion) -> float:
    """Width of tissue that a snare must go through [m]: a pedunculated polyp's stalk, any other's base."""
    return STALK_WIDTH * lesion.size if lesion.type == "pedunculated" else lesion.size
