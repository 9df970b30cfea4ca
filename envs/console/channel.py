"""Snare and biopsy forceps in a driven scope's channel: brought out, closed, and what they took of the colon."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.runs.treatment import Reach, without
from haustra.envs.sim.state import Readings
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.lesion_surface import lesion_axis
from haustra.models.devices.scope.instrument import Instrument, instrument_number
from haustra.models.scene import Scene

IN_CHANNEL = ("none", "snare", "snare closed", "forceps", "forceps closed")
"""What may be brought out of the channel; an instrument that is closed takes what it reaches."""
INTACT = 0
"""What `Channel.tissue` says of a polyp from which nothing was taken; otherwise it is the place of the instrument."""
_INSTRUMENTS: tuple[Instrument, ...] = ("forceps", "snare")


class Channel:
    """The instrument in a scope's channel. One that is closed takes one polyp at most, the next along the colon."""

    def __init__(self, scene: Scene) -> None:
        """An empty channel in a scene."""
        self._reach = Reach(scene)
        self._closed = False
        self.tissue: Int[np.ndarray, " lesions"] = np.full(len(scene.colon.lesions), INTACT, np.int8)
        """What was taken of each of the colon's lesions: `INTACT`, 1 where forceps bit, 2 where a snare cut it off."""
        self.said = ""
        """What came of closing the instrument last."""

    def hold(self, what: str, seen: Readings, arc: float) -> bool:
        """Hold an instrument as one of `IN_CHANNEL` says; when it has just been closed, it takes a polyp in reach.

        Says whether it has just been closed.

        Args:
            what: of `IN_CHANNEL`.
            seen: where the tip is, and the colon.
            arc: arc length of the tip [m].
        """
        name, _, closed = what.partition(" ")
        closes, self._closed = bool(closed) and not self._closed, bool(closed)
        if closes:
            self._close(next(one for one in _INSTRUMENTS if one == name), seen, arc)
        return closes

    def _close(self, instrument: Instrument, seen: Readings, arc: float) -> None:
        number = _INSTRUMENTS.index(instrument) + 1
        left = [index for index in self._reach.polyps if self.tissue[index] < number]
        near = sorted(left, key=lambda index: abs(self._reach.colon.lesions[index].arc - arc))
        why = {index: self._reach.why_not(instrument, index, seen, arc) for index in near}
        taken = next((index for index in near if why[index] is None), None)
        if taken is None:
            self.said = f"{instrument}: {why[near[0]]}" if near else f"{instrument}: no polyp is left"
            return
        self.tissue[taken] = number
        area = self._reach.wound(instrument, taken)
        self.said = (
            f"{instrument}: a polyp of {1e3 * self._reach.colon.lesions[taken].size:.0f} mm; {area:.0f} mm² bleed"
        )

    @property
    def bleeding_mm2(self) -> float:
        """Raw surface of all that was taken, which bleeds [mm^2]."""
        return sum(self._reach.wound(_INSTRUMENTS[self.tissue[index] - 1], index) for index in self._cut())

    @property
    def taken(self) -> int:
        """From how many polyps tissue was taken."""
        return len(self._cut())

    def keep(self) -> tuple[np.ndarray, bool, str]:
        """All that `put_back` needs."""
        return self.tissue.copy(), self._closed, self.said

    def put_back(self, kept: tuple[np.ndarray, bool, str]) -> None:
        """Go back to what was kept."""
        tissue, self._closed, self.said = kept
        self.tissue[:] = tissue

    def _cut(self) -> list[int]:
        return np.flatnonzero(self.tissue != INTACT).tolist()


def treated(colon: Colon, tissue: Sequence[int]) -> Colon:
    """The colon without what was taken, as `Channel.tissue` says.

    Raises:
        InvalidMeshError: when cutting did not leave one closed surface.
    """
    return without(colon, {index: _INSTRUMENTS[number - 1] for index, number in enumerate(tissue) if number != INTACT})


def wounds(colon: Colon, tissue: Sequence[int]) -> list[tuple[Float[np.ndarray, "3"], float]]:
    """Where blood lies on the wall at rest, and how far round it [m]: as wide as what was taken."""
    found = []
    for lesion, number in zip(colon.lesions, tissue, strict=True):
        foot = np.array(lesion.position)
        if number != INTACT and _INSTRUMENTS[number - 1] == "forceps":  # these bite the top
            found.append((foot + lesion.extent * lesion_axis(colon, lesion), instrument_number("forceps.bite")))
        elif number != INTACT:
            found.append((foot, lesion.size))
    return found
