"""Polyps taken on the way out: a scope stops before each, steers for it, and snare or forceps take it within reach.

Whoever steers knows where polyps are: a bound from above of what is reached by that tip, not of what is found. The
scope does not notice the instrument, and the table that the physics go by keeps its radii; the surface that is saved
loses what was taken (`haustra.models.anatomy.resection`), and every cut bleeds (`haustra.models.injury.bleeding`).
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.moved_colon import current_colon
from haustra.envs.sim.state import Readings
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.lesion_surface import lesion_axis
from haustra.models.anatomy.resection import bitten, resected
from haustra.models.devices.scope.instrument import (
    TOO_FAR,
    Instrument,
    PolypPose,
    channel_mouth,
    instrument_number,
    out_of_reach,
)
from haustra.models.injury.bleeding import wound_area
from haustra.models.scene import Scene

BEFORE = 0.025
"""The scope stops when its tip is so far before a polyp along the colon, on the anal side [m]; engineering choice."""
PATIENCE = 10.0
"""It steers for a polyp for so long at most [s]; engineering choice."""
_BETWEEN = (0.3, 0.45, 0.6, 0.75)
"""Places between the channel's mouth and a polyp's top that must lie in the lumen [1]: the tip itself may be pressed
into the wall, and the polyp stands in the lumen's radius."""
_GIVES_WAY = 0.002
"""Wall that an instrument pushes aside on its way [m]; engineering choice."""
_PASSED = 0.02
"""A polyp farther than this behind the place where the scope would stop is left [m]."""


@dataclass(frozen=True)
class TreatmentEvent:
    """What was done to one polyp."""

    lesion: int
    """Index in the colon's lesions."""
    time: float
    """When [s]."""
    arc: float
    """Where along the colon it is [m]."""
    taken: bool
    """Whether tissue was taken."""
    reason: str
    """Why not, or 'reached'."""
    bleeding_mm2: float
    """Raw surface that bleeds [mm^2]; 0 where nothing was taken."""


class Reach:
    """What an instrument through a scope's channel can take of a colon's polyps, and what is left of the colon."""

    def __init__(self, scene: Scene) -> None:
        """Look for polyps of a scene."""
        self.colon, self._moved = scene.colon, current_colon(scene)
        self.polyps = tuple(number for number, lesion in enumerate(scene.colon.lesions) if lesion.kind == "polyp")
        """Indices of polyps in the colon's lesions."""

    def why_not(self, instrument: Instrument, index: int, seen: Readings, arc: float) -> str | None:
        """Why an instrument cannot take a polyp from here; None when it can.

        Args:
            instrument: which.
            index: of the polyp in the colon's lesions.
            seen: where the tip is, and the colon.
            arc: arc length of the tip [m].
        """
        polyp, mouth = self.pose(index, seen), channel_mouth(seen.tip, seen.tip_frame)
        why = out_of_reach(instrument, mouth, seen.tip_frame[:, 2], polyp)
        return "behind a fold" if why is None and not self._clear(seen, mouth, polyp, arc) else why

    def wound(self, instrument: Instrument, index: int) -> float:
        """Raw surface where a polyp was taken, which bleeds [mm^2]."""
        bite, margin = instrument_number("forceps.bite"), instrument_number("snare.margin")
        return 1e6 * wound_area(bite if instrument == "forceps" else self.colon.lesions[index].size + 2 * margin)

    def pose(self, index: int, seen: Readings) -> PolypPose:
        """Where a polyp is now."""
        lesion = self.colon.lesions[index]
        foot = np.array(lesion.position)
        places = foot, foot + lesion.extent * lesion_axis(self.colon, lesion)
        if self._moved is not None:
            moved = self._moved.from_scene(seen.displacement)
            places = tuple(self._moved.to_current(moved, place, lesion.arc) for place in places)
        return PolypPose(top=places[1], foot=places[0], lesion=lesion)

    def _clear(self, seen: Readings, mouth: np.ndarray, polyp: PolypPose, arc: float) -> bool:
        """Whether the way from the channel's mouth to a polyp's top lies in the lumen, as the centreline sees it."""
        for share in _BETWEEN:
            place, guess = mouth + share * (polyp.top - mouth), arc + share * (polyp.lesion.arc - arc)
            if self._moved is not None:
                place = self._moved.to_reference(self._moved.from_scene(seen.displacement), place, guess)
            if beyond_wall(self.colon, place, guess) > _GIVES_WAY:
                return False
        return True


def beyond_wall(colon: Colon, place: Float[np.ndarray, "3"], arc: float, *, width: float = 1.0) -> float:
    """How far a place is outside the wall as the centreline sees it, across the lumen; negative within it [m].

    Args:
        colon: at rest.
        place: where it would be had the colon not moved [m].
        arc: about where along the colon it is [m].
        width: of the lumen there, over that at rest [1].
    """
    line = colon.centreline
    near = np.flatnonzero(np.abs(line.arc - arc) < _PASSED)
    station = near[np.linalg.norm(line.points[near] - place, axis=1).argmin()]
    across = (place - line.points[station]) @ line.frames[station, :, :2]
    angles = colon.radius.shape[1]
    angle = round(float(np.arctan2(across[1], across[0])) / (2 * np.pi) * angles) % angles
    return float(np.linalg.norm(across) - width * colon.radius[station, angle])


def without(colon: Colon, taken: Mapping[int, Instrument]) -> Colon:
    """The colon without what instruments took of its lesions, which are named by their indices.

    Raises:
        InvalidMeshError: when cutting did not leave one closed surface.
    """
    for lesion in sorted(taken, reverse=True):  # those behind a resected one move up
        if taken[lesion] == "snare":
            own = {"margin": instrument_number("snare.margin"), "depth": instrument_number("snare.defect")}
            colon = resected(colon, lesion, **own)
        else:
            colon = bitten(colon, lesion, size=instrument_number("forceps.bite"))
    return colon


class Treatment:
    """One instrument, and what was done with it."""

    def __init__(self, scene: Scene, instrument: Instrument) -> None:
        """Take an instrument into a scene."""
        self.instrument: Instrument = instrument
        self.events: list[TreatmentEvent] = []
        self.too_far = False
        """Whether the polyp at hand is farther than the instrument reaches: whoever drives may go on a little."""
        self._reach, self._colon = Reach(scene), scene.colon
        self._left = list(self._reach.polyps)
        self._since: dict[int, float] = {}

    def goal(self, seen: Readings, arc: float) -> Float[np.ndarray, "3"] | None:
        """Where the tip's axis is to point so that the instrument meets the polyp at hand [m]; None without one.

        A polyp that is within reach is taken at once.
        """
        near = [index for index in self._left if 0 <= self._colon.lesions[index].arc - BEFORE - arc < _PASSED]
        if not near:
            return None
        index = near[0]
        began = self._since.setdefault(index, float(seen.time))
        why = self._reach.why_not(self.instrument, index, seen, arc)
        polyp, mouth = self._reach.pose(index, seen), channel_mouth(seen.tip, seen.tip_frame)
        if why is None or seen.time - began > PATIENCE:
            self._left.remove(index)
            bleeding = 0.0 if why else self._reach.wound(self.instrument, index)
            event = TreatmentEvent(index, float(seen.time), polyp.lesion.arc, not why, why or "reached", bleeding)
            self.events.append(event)
            return None
        self.too_far = why == TOO_FAR
        return (polyp.top + polyp.foot) / 2 + (seen.tip - mouth)

    def after(self) -> Colon:
        """The colon without what was taken."""
        return without(self._colon, {event.lesion: self.instrument for event in self.events if event.taken})

    def scores(self) -> dict[str, Any]:
        """What was done, as plain JSON values."""
        return {
            "instrument": self.instrument,
            "polyps_taken": sum(event.taken for event in self.events),
            "bleeding_events": sum(event.bleeding_mm2 > 0 for event in self.events),
            "treatments": [asdict(event) for event in self.events],
        }
